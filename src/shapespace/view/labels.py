"""Labels of points in diagrams: each unmistakably at its own point, beside the lines and beside each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from shapespace.base.arrays import Array
from shapespace.view import style

SIZE = 7.0
DISTANCES = (5.0, 7.0, 9.0, 14.0, 20.0, 28.0, 38.0, 50.0)
"""From the point to its label, to try, in points."""
LED = 12.0
"""A thin line leads to labels that are further off than this."""
TOWARDS = tuple(np.pi * n / 8.0 for n in (2, 14, 6, 10, 0, 8, 4, 12, 1, 15, 3, 13, 5, 11, 7, 9))
"""Directions from the point, the corners first."""
CLEARER = 1.6
"""Any other point should be this many times further from a label than its own."""
MARK = 3.0
"""Half the size of a mark, in points."""
PADDING = 1.0
"""Around a label, in points."""
FORBIDDEN, MISLEADING, FAR = 1e5, 1e2, 0.5
"""Costs: of lying over something or off the axes; per point that another mark is too near; per point of distance. A spot of a
line that is covered costs 1."""
SPOT, MOST_SPOTS = 1.5, 20_000
"""Points from one spot of a line to the next, and how many spots a line has at most."""
SWEEPS = 3
"""How often all labels are placed anew among each other."""


@dataclass(frozen=True)
class _Place:
    """Where a label may stand. offset: from its point, with anchor the corner that is there; lead: ends of a line to it."""

    box: Bbox
    offset: tuple[float, float]
    anchor: tuple[str, str]
    lead: Array | None
    cost: float


def label_points(axes: Axes, labels: Sequence[tuple[str, float, float]], **looks: Any) -> list[Annotation]:
    """Write (text, x, y) beside each point and return the texts; to be called last, when all else is drawn.

    Lines, also those of a twin, legends and other labels are kept free as far as can be. Where a label cannot stand near its
    point without seeming to be another one's, it stands further off at the end of a thin line. looks: of the texts.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    looks = {"fontsize": SIZE, **looks}
    notes = [axes.annotate(text, (x, y), (0, 0), textcoords="offset points", **looks) for text, x, y in labels]
    if not notes:
        return notes
    for note in notes:
        note.set_in_layout(False)
        note.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    figure.draw_without_rendering()  # settles the limits and the layout
    point = figure.dpi / 72.0
    marks = axes.transData.transform([(x, y) for _, x, y in labels]) / point
    crowd = _Crowd(axes, marks, point)
    sizes = [np.array(note.get_window_extent().size) / point for note in notes]
    choices = [crowd.places(number, size) for number, size in enumerate(sizes)]
    for note, mark, place in zip(notes, marks, _chosen(choices, crowd.room), strict=True):
        note.set(position=place.offset, ha=place.anchor[0], va=place.anchor[1])
        if place.lead is not None:
            line = {"arrowstyle": "-", "linewidth": 0.5, "color": style.INK, "shrinkA": 0.0, "shrinkB": MARK}
            start = tuple(place.lead[0] - mark)
            axes.annotate("", note.xy, start, textcoords="offset points", arrowprops=line).set_in_layout(False)
    return notes


def _chosen(choices: Sequence[Sequence[_Place]], room: Array) -> list[_Place]:
    """One place for each label: those with the least room choose first, then all once more among the others."""
    chosen: dict[int, _Place] = {}
    for _, number in product(range(SWEEPS), np.argsort(room, kind="stable").tolist()):
        others = [place for other, place in chosen.items() if other != number]
        chosen[number] = min(choices[number], key=lambda place: place.cost + sum(_clash(place, one) for one in others))
    return [chosen[number] for number in range(len(choices))]


class _Crowd:
    """What is there before the labels, in points of the page."""

    def __init__(self, axes: Axes, marks: Array, point: float) -> None:
        twins = [one for one in axes.figure.axes if one.bbox.bounds == axes.bbox.bounds]
        self._marks = marks
        self._spots = np.concatenate([_spots(one, point) for one in twins])
        self._frame = _scaled(axes.bbox, point)
        legends = [legend for one in twins if (legend := one.get_legend()) is not None]
        self._legends = [_scaled(legend.get_window_extent(), point) for legend in legends]

    @property
    def room(self) -> Array:
        """Distance of each mark from the nearest other one."""
        apart = np.linalg.norm(self._marks[:, None] - self._marks, axis=-1)
        return np.asarray(np.min(apart + np.where(np.eye(len(apart)) > 0.0, np.inf, 0.0), axis=1))

    def places(self, number: int, size: Array) -> list[_Place]:
        """All places for the label of a mark, with what each costs without regard to other labels."""
        mark = self._marks[number]
        # Marks that coincide on the page cannot be told apart by any label.
        others = self._marks[np.linalg.norm(self._marks - mark, axis=1) > 1.0]
        return [self._place(mark, others, size, offset) for offset in _offsets()]

    def _place(self, mark: Array, others: Array, size: Array, offset: Array) -> _Place:
        sides = np.sign(np.where(np.abs(offset) > 0.3 * np.abs(offset).max(), offset, 0.0))
        corner = mark + offset - 0.5 * (1.0 - sides) * size
        box = Bbox([corner, corner + size])
        own = float(_distances(box, mark[None])[0])
        lead = np.stack([np.clip(mark, box.min, box.max), mark]) if own > LED else None
        wide = box.padded(PADDING)
        off = (
            wide.x0 < self._frame.x0 or wide.x1 > self._frame.x1 or wide.y0 < self._frame.y0 or wide.y1 > self._frame.y1
        )
        over = sum(wide.overlaps(legend) for legend in self._legends)
        over += int(np.count_nonzero(_distances(wide, self._marks) < MARK))
        wanted = CLEARER * own if lead is None else LED
        doubt = float(np.maximum(0.0, wanted - _distances(box, others)).sum())
        covered = np.count_nonzero(_distances(wide, self._spots) == 0.0)
        if lead is not None:
            # No closer to another mark than its own one is anyway.
            clear = np.minimum(2.0 * MARK, np.linalg.norm(others - mark, axis=1))
            doubt += float(np.maximum(0.0, clear - _from_segment(others, lead)).sum())
            covered += np.count_nonzero(_from_segment(self._spots, lead) < SPOT)
        cost = FORBIDDEN * (off + over) + MISLEADING * doubt + covered + FAR * own
        horizontal, vertical = (int(side) for side in sides)
        anchor = ({1: "left", 0: "center", -1: "right"}[horizontal], {1: "bottom", 0: "center", -1: "top"}[vertical])
        return _Place(box, (float(offset[0]), float(offset[1])), anchor, lead, float(cost))


def _offsets() -> Iterator[Array]:
    for distance, angle in product(DISTANCES, TOWARDS):
        towards = np.array([np.cos(angle), np.sin(angle)])
        yield distance * towards / np.abs(towards).max()


def _clash(one: _Place, other: _Place) -> float:
    """What two labels with their lines cost together."""
    clashes = int(one.box.padded(PADDING).overlaps(other.box))
    for place, label in ((one, other), (other, one)):
        if place.lead is not None:
            share = np.linspace(0.0, 1.0, 20)[:, None]
            along = place.lead[0] + share * (place.lead[1] - place.lead[0])
            clashes += int((_distances(label.box, along) == 0.0).any())
            if label.lead is not None:
                clashes += int((_from_segment(along, label.lead) < PADDING).any())
    return FORBIDDEN * clashes


def _spots(axes: Axes, point: float) -> Array:
    """Places along all lines, equally spaced on the page."""
    found = [np.zeros((0, 2))]
    for line in axes.get_lines():
        path = (
            line.get_transform().transform(np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float)) / point
        )
        path = path[np.isfinite(path).all(axis=1)]
        length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        count = min(int(length[-1] / SPOT) + 2, MOST_SPOTS) if len(path) else 0
        at = np.linspace(0.0, length[-1], count)
        found.append(np.stack([np.interp(at, length, path[:, i]) for i in range(2)], axis=-1) if count else path)
    return np.concatenate(found)


def _scaled(box: Any, point: float) -> Bbox:
    return Bbox(np.asarray(box.get_points()) / point)


def _distances(box: Bbox, points: Array) -> Array:
    """Of points (n, 2) from a box; zero inside."""
    return np.asarray(np.linalg.norm(points - np.clip(points, box.min, box.max), axis=1))


def _from_segment(points: Array, ends: Array) -> Array:
    """Distances of points (n, 2) from a segment given by its two ends."""
    along = ends[1] - ends[0]
    share = np.clip((points - ends[0]) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - ends[0] - share[:, None] * along, axis=1))
