"""Labels of special points: each stands unmistakably at its own."""

import json
from itertools import combinations
from typing import NamedTuple

import pytest
from tests.app.browser import Browser
from tests.app.pages import BRANCH, DIVISION, STATES, open_page

from shapespace.app.explore import Explorer

CLEAR = 4.0
"""Pixels by which its own point must be the nearest."""
CROWDS = {
    "neighbours": [(300, 200), (310, 191)],
    "column": [(300, 100 + 9 * k) for k in range(5)],
    "row": [(200 + 11 * k, 200) for k in range(7)],
    "heap": [(300 + 5 * (k % 3), 200 + 4 * (k // 3)) for k in range(9)],
    "corner": [(595, 20), (592, 26), (598, 32)],
    "one place": [(300, 200), (300, 200)],
}


class Label(NamedTuple):
    """Where a label and its point are, and the line between them."""

    text: str
    left: float
    top: float
    right: float
    bottom: float
    tie: str | None


def distance(label: Label, point: tuple[float, float]) -> float:
    """From a point to the box of a label."""
    x, y = point
    across = max(label.left - x, 0.0, x - label.right)
    up = max(label.top - y, 0.0, y - label.bottom)
    return (across**2 + up**2) ** 0.5


def read_labels(browser: Browser, within: str) -> list[Label]:
    """All labels drawn in an element, in its own pixels."""
    return [
        Label(*one)
        for one in browser.all(
            f"{within} .special-label",
            "(() => { const b = e.getBBox(), svg = e.ownerSVGElement;"
            "const tie = [...svg.querySelectorAll('.tie')].find((one) => one.dataset.label === e.textContent);"
            "return [e.textContent, b.x, b.y, b.x + b.width, b.y + b.height, tie ? tie.getAttribute('d') : null]; })()",
        )
    ]


def check(labels: list[Label], points: dict[str, tuple[float, float]]) -> None:
    """No label may be taken for another point's, and none lies on another."""
    assert {label.text for label in labels} == points.keys()
    for label in labels:
        own = points[label.text]
        if label.tie is None:
            others = [distance(label, point) for text, point in points.items() if text != label.text]
            assert all(distance(label, own) + CLEAR <= other for other in others), label
        else:
            (x, y), end = ([*map(float, part.split())] for part in label.tie[1:].split("L"))
            assert (x, y) == pytest.approx(own)
            assert distance(label, (end[0], end[1])) < 3.0, label
    for one, other in combinations(labels, 2):
        apart = (
            one.right <= other.left
            or other.right <= one.left
            or one.bottom <= other.top + 2
            or other.bottom <= one.top + 2
        )
        assert apart, (one, other)


def test_labels_of_a_crowd_are_told_apart(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH)
    line = [[100, 390], [300, 200], [590, 15]]
    for name, crowd in CROWDS.items():
        points = {f"pitchfork-{k}": point for k, point in enumerate(crowd)}
        wanted = [{"text": text, "x": x, "y": y} for text, (x, y) in points.items()]
        browser.run(
            "import('./labels.js').then(({ place }) => { document.getElementById('crowd')?.remove();"
            "const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg'); svg.id = 'crowd';"
            "document.body.append(svg);"
            f"place({json.dumps(wanted)}, [{line}], {{ left: 50, right: 600, top: 10, bottom: 400 }}, svg); }})"
        )
        labels = read_labels(browser, "#crowd")
        check(labels, points)
        assert all(label.left >= 45 and label.right <= 612 for label in labels), name


@pytest.mark.parametrize("store", [BRANCH, DIVISION, STATES])
def test_labels_of_special_points_stand_at_them(browser: Browser, whole: Explorer, store: int):
    open_page(browser, whole, store)
    for width in (1280, 390):
        browser.resize(width, 800, mobile=width < 600)
        browser.settle()
        marks = browser.all(
            "#diagram .special:not([data-label=''])",
            "[e.dataset.label, e.transform.baseVal[0].matrix.e, e.transform.baseVal[0].matrix.f]",
        )
        labels = read_labels(browser, "#diagram")
        check(labels, {text: (x, y) for text, x, y in marks if not text.startswith("end-")})
        assert len(labels) >= 1
