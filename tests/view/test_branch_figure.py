"""The line styles of a branch: solid, dashed or dotted by what grows, without gaps between."""

from itertools import pairwise
from types import SimpleNamespace

import pytest

import shapespace as ss
from shapespace.view.branch import _line, stretches, telling_observable


def step(n_unstable: int | None) -> SimpleNamespace:
    return SimpleNamespace(observables={"height": 1.0}, n_unstable=n_unstable, label="", is_step=True)


def special(before: int | None, after: int | None) -> SimpleNamespace:
    return SimpleNamespace(
        observables={"height": 1.0},
        n_unstable=None,
        label="fold-1",
        is_step=False,
        n_unstable_before=before,
        n_unstable_after=after,
    )


@pytest.mark.parametrize(
    ("points", "lengths"),
    [
        ([step(0), step(0), special(0, 1), step(1), step(1)], [3, 3]),
        ([step(0), step(0), special(0, 0), step(0)], [4]),
        ([step(None), step(0), step(0)], [3]),
        ([step(0), step(1), step(1), step(None)], [3, 2]),
    ],
)
def test_stretches_change_where_stability_does(points: list[SimpleNamespace], lengths: list[int]):
    """Neighbouring stretches share the point at which they meet; a start whose stability is unknown is no stretch."""
    found = stretches(points, "height")
    assert [len(stretch) for stretch in found] == lengths
    for before, after in pairwise(found):
        assert before[-1] is after[0]


def test_a_gap_is_left_where_the_observable_is_missing():
    gap = step(0)
    gap.observables = {}
    assert [len(s) for s in stretches([step(0), step(0), gap, step(0), step(0)], "height")] == [2, 2]


def test_lines():
    assert [_line(n) for n in (0, 2, None)] == ["-", "--", ":"]


def test_along_an_observable_the_one_that_answers_is_drawn():
    scenario = ss.scenario("membrane-protrusion")
    point = SimpleNamespace(observables={"height": 0.7, "pulling_force": 3.0, "bending_energy": 20.0})
    for key, free, name in (
        ("height", "pulling_force", "pulling_force"),
        ("height", "coat_area", "bending_energy"),
        ("coat_area", None, "height"),
    ):
        branch = SimpleNamespace(scenario=scenario, key=key, free=free, points=(point,))
        assert telling_observable(branch) == name
