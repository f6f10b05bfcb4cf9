"""Labels of points in diagrams, beside the lines and beside each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shapespace.base.arrays import Array

SIZE = 6.5
NEAR, FAR = 5, 16
"""Distances from the point to try, in points."""
ALONG = 40
"""Places looked at on each piece of a line between two of its vertices."""


def label_points(axes: Axes, labels: Sequence[tuple[str, float, float]]) -> None:
    """Write (text, x, y) beside each point, where least of a line or of an earlier label is covered; to be called last."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # settles the limits
    taken = _drawn(axes)
    for text, x, y in labels:
        best, fewest, box = None, np.inf, None
        for distance in (NEAR, FAR):
            for right, up in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                note = axes.annotate(
                    text,
                    (x, y),
                    (right * distance, up * distance),
                    textcoords="offset points",
                    ha="left" if right > 0 else "right",
                    va="bottom" if up > 0 else "top",
                    fontsize=SIZE,
                )
                place = note.get_window_extent().padded(2.0)
                covered = _covered(place, taken) + len(taken) * (not _is_within(place, axes.bbox))
                if covered < fewest:
                    if best is not None:
                        best.remove()
                    best, fewest, box = note, covered, place
                else:
                    note.remove()
        assert box is not None
        grid = np.meshgrid(np.linspace(box.x0, box.x1, 9), np.linspace(box.y0, box.y1, 5))
        taken = np.concatenate([taken, np.stack(grid, axis=-1).reshape(-1, 2)])


def _drawn(axes: Axes) -> Array:
    """Pixels (n, 2) along all lines."""
    found = [np.zeros((0, 2))]
    shares = np.linspace(0.0, 1.0, ALONG)[:, None, None]
    for line in axes.get_lines():
        path = axes.transData.transform(np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float))
        path = path[np.isfinite(path).all(axis=1)]
        found.append(path)
        found.append(((1.0 - shares) * path[:-1] + shares * path[1:]).reshape(-1, 2))
    return np.concatenate(found)


def _covered(box: Any, pixels: Array) -> int:
    inside = (pixels[:, 0] > box.x0) & (pixels[:, 0] < box.x1) & (pixels[:, 1] > box.y0) & (pixels[:, 1] < box.y1)
    return int(np.count_nonzero(inside))


def _is_within(box: Any, frame: Any) -> bool:
    return bool(box.x0 >= frame.x0 and box.x1 <= frame.x1 and box.y0 >= frame.y0 and box.y1 <= frame.y1)
