"""What every picture must keep to: its texts lie on the page and apart, legends leave lines free."""

from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

PRINTED = 300.0
"""Dots per inch of the pictures that the command line writes."""


def texts_of(figure: Figure) -> list[Text]:
    """Every text that is really drawn: tick labels outside the limits are not."""
    found = []
    for text in figure.findobj(Text):
        if not (text.get_visible() and text.get_text().strip()):
            continue
        box = text.get_window_extent()
        if box.width > 0 and np.isfinite(box.extents).all():
            found.append(text)
    drawn_ticks, all_ticks = set(), set()
    for axes in figure.findobj(Axes):
        for axis in (axes.xaxis, axes.yaxis):
            place = axis.get_transform().transform
            low, high = sorted(place(np.array(axis.get_view_interval())))
            for tick in axis.get_major_ticks() + axis.get_minor_ticks():
                labels = {id(tick.label1), id(tick.label2)}
                all_ticks |= labels
                slack = 1e-9 * (high - low)
                if (
                    axes.axison
                    and axis.get_visible()
                    and low - slack <= place(np.array([tick.get_loc()]))[0] <= high + slack
                ):
                    drawn_ticks |= labels
    return [text for text in found if id(text) in drawn_ticks or id(text) not in all_ticks]


def assert_on_page(figure: Figure, dpi: float = PRINTED) -> None:
    """No text is cut off at the margin, the first time that the figure is drawn at this resolution."""
    before = figure.dpi
    figure.set_dpi(dpi)
    figure.draw_without_rendering()
    page = Bbox.from_bounds(0.0, 0.0, figure.bbox.width, figure.bbox.height).padded(0.002 * dpi)
    boxes = {text.get_text(): text.get_window_extent() for text in texts_of(figure)}
    figure.set_dpi(before)
    off = [text for text, box in boxes.items() if not (page.containsx(box.x0) and page.containsx(box.x1))]
    off += [text for text, box in boxes.items() if not (page.containsy(box.y0) and page.containsy(box.y1))]
    assert off == [], off


def assert_apart(figure: Figure) -> None:
    """No text is written over another one."""
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent().padded(-0.5)) for text in texts_of(figure)]
    for (one, box), (other, other_box) in combinations(boxes, 2):
        assert not box.overlaps(other_box), f"{one!r} over {other!r}"


def assert_legends_clear(figure: Figure) -> None:
    """No line of an axes passes under its legend."""
    figure.draw_without_rendering()
    for axes in figure.findobj(Axes):
        legends = [one.get_window_extent() for one in axes.findobj(Legend)]
        for line in axes.get_lines() if legends else []:
            path = axes.transData.transform(np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float))
            is_along = line.get_transform().contains_branch(axes.transData) and len(path) > 1
            path = path[np.isfinite(path).all(axis=1)]
            length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
            at = np.linspace(0.0, length[-1], 2000) if is_along and len(path) > 1 else np.zeros(0)
            x, y = (np.interp(at, length, path[:, i]) if len(at) else at for i in range(2))
            for box in legends:
                under = (x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)
                assert not under.any(), f"a line under the legend of {axes.get_ylabel()!r}"
