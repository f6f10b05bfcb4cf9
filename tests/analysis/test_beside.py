"""Branches that begin, stop or end at a branch point, or so near that round-off hides it."""

import jax.numpy as jnp
import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.branch import Point, all_brackets
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome

LAMBDA = Parameter(0)
STIFF = 1e6
"""Size of the regular equation: with both mixed its round-off, 1e-10, drowns the other within some 1e-6 of the branch point."""
TURN = np.array([[0.6, -0.8], [0.8, 0.6]])


def _pitchfork(x, p):
    y = TURN.T @ x
    return TURN @ jnp.stack([STIFF * (y[1] - p[0] ** 2), p[0] * y[0] - y[0] ** 3])


PITCHFORK = AlgebraicProblem(_pitchfork, 2)
"""With x = T y: y_0 = 0, y_1 = lambda^2 is crossed at lambda = 0 by y_0^2 = lambda."""


def at(first: float, value: float) -> Array:
    """x of y_0 and lambda."""
    return TURN @ np.array([first, value**2])


TRANSCRITICAL = AlgebraicProblem(lambda x, p: x * (p[0] - x), 1)
OPTIONS = Arclength(first=0.1, largest=0.3, parameter_scale=1.0)


def followed(begin: Point | Outcome, *values: float, end: float) -> list[Point]:
    """All points, with exact ones at values."""
    assert isinstance(begin, Point)
    stops = [Stop(LAMBDA, value) for value in values] + [Stop(LAMBDA, end, "end", ends=True)]
    branch = Continuation([begin], stops, OPTIONS)
    points = [begin, *branch]
    assert branch.outcome is Outcome.REACHED_STOP
    return points


def on_trunk(points: list[Point]) -> None:
    """All of them on y_0 = 0, y_1 = lambda^2."""
    for point in points:
        np.testing.assert_allclose(point.x, at(0.0, point.parameter), atol=1e-8)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_start_at_a_pitchfork_stays_on_the_branch_that_changes_least(direction: float):
    points = followed(start_point(PITCHFORK, np.zeros(2), np.zeros(1), 0, direction, OPTIONS), end=direction)
    on_trunk(points)
    assert points[-1].parameter == direction
    assert not all_brackets(points)  # the start itself is not passed again


@pytest.mark.parametrize("value", [0.0, 1e-9, -1e-9, 1e-7, -1e-7, 1e-5, -1e-5, 1e-3])
def test_a_stop_at_or_beside_a_pitchfork_is_exact_and_the_pitchfork_is_met_once(value: float):
    points = followed(start_point(PITCHFORK, at(0.0, 1.0), np.array([-1.0]), 0, 1.0, OPTIONS), value, 0.5, end=1.0)
    on_trunk(points)
    assert [point.parameter for point in points if point.label == "user"] == [value, 0.5]
    (bracket,) = all_brackets(points)
    assert bracket.kind == "branch-point"
    # Also where the stop is the pitchfork: that lies before it then.
    assert bracket.before.parameter < 0.0 <= bracket.after.parameter + 1e-9


def test_a_branch_may_end_at_a_pitchfork_and_begin_there_again():
    points = followed(start_point(PITCHFORK, at(0.0, 1.0), np.array([-1.0]), 0, 1.0, OPTIONS), end=0.0)
    on_trunk(points)
    assert len(all_brackets(points)) == 1
    last = points[-1]
    onwards = start_point(PITCHFORK, last.x, last.p, 0, 1.0, OPTIONS, last.tangent)
    on_trunk(followed(onwards, end=1.0))


@pytest.mark.parametrize("tangent", [None, np.array([0.0, 1.0]), np.array([1.0, 1.0])])
def test_a_start_where_two_branches_cross(tangent):
    """Without a tangent x = 0, which changes least, is followed; with one the branch that has it."""
    points = followed(start_point(TRANSCRITICAL, np.zeros(1), np.zeros(1), 0, 1.0, OPTIONS, tangent), end=1.0)
    wanted = 1.0 if tangent is not None and tangent[0] else 0.0
    np.testing.assert_allclose(
        [point.x[0] for point in points], [wanted * point.parameter for point in points], atol=1e-9
    )


def test_a_state_off_a_branch_point_is_left_as_it_is():
    """Beside the pitchfork, but on the other branch."""
    value = 1e-4
    x = at(np.sqrt(value), value)
    begin = start_point(PITCHFORK, x, np.array([value]), 0, 1.0, OPTIONS)
    points = followed(begin, end=0.5)
    np.testing.assert_array_equal(begin.x, x)
    np.testing.assert_allclose(points[-1].x, at(np.sqrt(0.5), 0.5), atol=1e-8)
