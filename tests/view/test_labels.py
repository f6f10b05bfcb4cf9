"""Labels of points: each at its own point, on free ground, however close the points are."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Annotation

from shapespace.view import style
from shapespace.view.labels import LED, label_points

DIVISION = {
    "fold-1": (2.36247, 0.6690), "pitchfork-1": (2.32872, 0.6001), "pitchfork-2": (1.78655, 0.3002),
    "pitchfork-3": (1.71701, 0.2702), "fold-2": (1.29349, 0.0885), "pitchfork-4": (1.43472, 0.0431),
}  # fmt: skip
"""Special points of guided division, in the ring amplitude and the equator radius."""


def labelled(points: dict[str, tuple[float, float]], line: np.ndarray) -> None:
    """Label points on a page and check what a reader needs."""
    with style.house_style():
        figure = style.new_figure(0.75, 110.0)
        axes = figure.add_subplot()
        axes.plot(*line.T, label="a branch")
        axes.plot(*np.array([*points.values()]).T, "o", markersize=4.0)
        axes.margins(0.1)
        axes.legend()
        notes = label_points(axes, [(text, x, y) for text, (x, y) in points.items()])
    figure.draw_without_rendering()
    marks = {text: axes.transData.transform(place) for text, place in points.items()}
    boxes = {note.get_text(): note.get_window_extent() for note in notes}
    led = [tuple(one.xy) for one in axes.findobj(Annotation) if one.arrow_patch is not None]
    for text, box in boxes.items():
        away = {other: np.linalg.norm(mark - np.clip(mark, box.min, box.max)) for other, mark in marks.items()}
        assert axes.bbox.x0 <= box.x0 <= box.x1 <= axes.bbox.x1
        assert axes.bbox.y0 <= box.y0 <= box.y1 <= axes.bbox.y1
        assert not box.overlaps(axes.get_legend().get_window_extent())
        assert all(distance > 1.0 for distance in away.values()), f"{text} lies over a mark"
        if points[text] not in led:
            assert away[text] <= LED * figure.dpi / 72.0 + 1.0
            near = [other for other in away if np.linalg.norm(marks[other] - marks[text]) > 1.5 and other != text]
            assert all(away[other] > 1.2 * away[text] for other in near), f"{text} stands at another point"
    for (one, box), (other, other_box) in combinations(boxes.items(), 2):
        assert not box.overlaps(other_box), f"{one} over {other}"


def test_the_special_points_of_division_have_their_own_names():
    labelled(DIVISION, np.array([(0.0, 1.0), (1.5, 0.92), *DIVISION.values(), (4.2, 0.004)]))


@pytest.mark.parametrize("angle", [0.0, 0.6, 1.5, 2.4])
@pytest.mark.parametrize("apart", [0.004, 0.02, 0.05])
def test_close_points_keep_their_names(angle: float, apart: float):
    """Five in a row, closer and closer."""
    towards = np.array([np.cos(angle), np.sin(angle)])
    places = [0.5 + 0.1 * towards, 0.5 * np.ones(2), *(0.5 - n * apart * towards for n in (1, 2, 3.5))]
    points = {f"pitchfork-{n}": (float(x), float(y)) for n, (x, y) in enumerate(places)}
    labelled(points, np.stack([0.5 - 0.5 * towards, 0.5 + 0.5 * towards]))


def test_points_that_coincide_have_all_their_names():
    labelled({"fold-1": (0.5, 0.5), "fold-2": (0.5, 0.5), "end-1": (0.9, 0.5)}, np.array([(0.0, 0.5), (1.0, 0.5)]))


def test_no_point_needs_no_label():
    figure = style.new_figure(0.5, 50.0)
    assert label_points(figure.add_subplot(), []) == []
