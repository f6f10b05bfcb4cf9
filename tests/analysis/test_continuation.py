"""Branches of classic and algebraic problems: folds and branch points bracketed, exact stops, meshes that move, failures."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, pairwise

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyroots, polyval
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.bifurcation import SingularPoint, locate_branch_point, locate_fold
from shapespace.analysis.branch import Bracket, Point, all_brackets, brackets, hermite
from shapespace.analysis.continuation import MEMORY, Arclength, Continuation, Event, Stop, start_point
from shapespace.analysis.extended import AbstractMeasure, Parameter
from shapespace.analysis.passage import meets_mirror_image, passed_start
from shapespace.analysis.stationary import solve_stationary
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractContinuableProblem, AbstractSmoothProblem
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.verification.classic import (
    at_rest,
    bratu,
    carrier,
    chafee_infante,
    chan,
    gelfand,
    mean_free,
    middle,
    neumann_bratu,
)

BRATU_FOLD = 3.513830719125161
LAMBDA = Parameter(0)


def start(
    problem: AbstractSmoothProblem, p: Sequence[float], x: Array, direction: float = 1.0, **options: float
) -> Point:
    """The first point of a branch in p[0], from a guess."""
    found = solve_stationary(problem, x, np.array(p, dtype=float))
    assert found.outcome is Outcome.CONVERGED
    point = start_point(found.problem, found.x, found.p, 0, direction, Arclength(**options))
    assert isinstance(point, Point)
    return point


def follow(
    begin: Point, stops: Sequence[Stop] = (), events: Sequence[Event] = (), **options: float
) -> tuple[list[Point], Outcome]:
    """All points of a branch, and how it ended."""
    made = Continuation([begin], stops, Arclength(**options), events=events)
    points = [begin, *made]
    assert made.outcome is not None
    return points, made.outcome


def until(value: float) -> Stop:
    return Stop(LAMBDA, value, "end", ends=True)


def near(points: Sequence[Point], kind: str) -> list[float]:
    """Estimates of the parameter at bracketed points: where its cubic between neighbours turns, or halfway."""
    out = []
    for bracket in all_brackets(points):
        if bracket.kind == kind == "fold":
            a, b = bracket.before, bracket.after
            ends = (np.array(v) for v in (a.parameter, a.tangent[-1], b.parameter, b.tangent[-1]))
            cubic = hermite(*ends, b.arclength - a.arclength)
            turns = polyroots(polyder(cubic))
            (turn,) = turns[(turns > 0.0) & (turns < b.arclength - a.arclength)]
            out.append(float(polyval(turn, cubic)))
        elif bracket.kind == kind:
            out.append(0.5 * (bracket.before.parameter + bracket.after.parameter))
    return out


def located(bracket: Bracket) -> float:
    """The parameter of the singular point in a bracket."""
    point = bracket.after
    problem = point.problem
    assert isinstance(problem, AbstractSmoothProblem)
    if bracket.kind == "fold":
        found = locate_fold(problem, 0, point.x, point.p, point.tangent[:-1])
    else:
        found = locate_branch_point(problem, 0, point.x, point.p, point.tangent)
    assert isinstance(found, SingularPoint)
    return found.parameter


def assert_reconverges(points: Sequence[Point]) -> None:
    """Each point is a solution on its own mesh: one or two Newton steps and no move of it."""
    for point in points:
        again = solve_stationary(point.problem, point.x, point.p, max_moves=0)
        assert again.outcome is Outcome.CONVERGED
        assert again.iterations <= 2
        assert point.problem.norm(again.x - point.x, point.x) < 1e-7


def test_bratu_around_its_fold():
    """Both states at lambda = 1 as exact stops (closed form; Buckmire), the fold between them, an exact end."""
    problem = bratu()
    points, outcome = follow(start(problem, [0.2], at_rest(problem)), [Stop(LAMBDA, 1.0), until(0.1)])
    assert outcome is Outcome.REACHED_STOP
    assert (points[0].label, points[-1].label, points[-1].parameter) == ("start", "end", 0.1)
    lower, upper = (point for point in points if point.label == "user")
    assert lower.parameter == upper.parameter == 1.0
    for point, exact in ((lower, 0.140539214400472), (upper, 4.091467246189261)):
        assert isinstance(point.problem, CollocationProblem)
        assert abs(middle(point.problem, point.x) - exact) < 1e-8
    (bracket,) = all_brackets(points)
    assert bracket.kind == "fold"
    assert located(bracket) == pytest.approx(BRATU_FOLD, abs=1e-9)
    (estimate,) = near(points, "fold")
    assert abs(estimate - BRATU_FOLD) < 1e-4
    assert lower.arclength < bracket.before.arclength < bracket.after.arclength < upper.arclength
    assert_reconverges(points)
    assert sum(point.jacobians for point in points) <= 1.2 * len(points)


def test_arclength_does_not_know_the_mesh():
    """Equal stops lie at equal arclengths on meshes of other sizes and degrees, but for the sums that stand for integrals."""
    places = []
    for elements, degree in ((10, 4), (20, 4), (80, 4), (80, 6)):
        problem = bratu(elements, degree)
        points, _ = follow(
            start(problem, [0.2], at_rest(problem), largest=0.02), [Stop(LAMBDA, 1.0), until(0.1)], largest=0.02
        )
        places.append([point.arclength for point in points if point.label in ("user", "end")])
    coarse, fine, finest, other = np.array(places)
    assert np.abs(coarse / finest - 1.0).max() < 1e-3
    assert (np.abs(coarse - finest) > 2.0 * np.abs(fine - finest)).all()
    np.testing.assert_allclose(other, finest, rtol=2e-5)


def test_a_branch_run_twice_or_resumed_has_the_same_points():
    """Bit for bit, whether uninterrupted, run again, or taken up from its last points at any place, stops included."""
    problem, stops = bratu(), [Stop(LAMBDA, 1.0)]
    points, _ = follow(start(problem, [0.5], at_rest(problem)), stops, max_points=25)
    for count in (1, 3, 9, 20):
        again = Continuation(points[max(count - MEMORY, 0) : count], stops, Arclength(max_points=25 - count))
        for first, second in zip(points[count:], again, strict=False):
            np.testing.assert_array_equal(first.x, second.x)
            np.testing.assert_array_equal(first.tangent, second.tangent)
            assert (first.parameter, first.step, first.label) == (second.parameter, second.step, second.label)


class EndSlope(AbstractMeasure):
    """y'(0)."""

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        return float(x[1])

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        row = np.zeros_like(x)
        row[1] = 1.0
        return row, np.zeros_like(p)


def test_stops_at_values_of_observables():
    """At the fold of Bratu's problem y'(0) = 4 exactly: stopping there gives the fold itself."""
    problem = bratu()
    points, outcome = follow(start(problem, [0.2], at_rest(problem)), [Stop(EndSlope(), 4.0, "steep", ends=True)])
    assert outcome is Outcome.REACHED_STOP
    assert points[-1].label == "steep"
    assert abs(points[-1].x[1] - 4.0) < 1e-9
    assert abs(points[-1].parameter - BRATU_FOLD) < 1e-9
    assert abs(points[-1].tangent[-1]) < 1e-6
    assert_reconverges(points[:-1])


def test_two_folds_of_chan():
    """a = 4.041401867 and 3.155897933 at b = 0.01."""
    problem = chan()
    points, outcome = follow(start(problem, [0.5, 0.01], at_rest(problem)), [until(5.0)])
    assert outcome is Outcome.REACHED_STOP
    assert near(points, "fold") == pytest.approx([4.041401867, 3.155897933], abs=3e-4)
    assert [located(bracket) for bracket in all_brackets(points)] == pytest.approx([4.041401867, 3.155897933], abs=2e-9)


def test_folds_of_gelfand():
    """Three folds in the ball, their parameters and u(0); the mesh follows the spike at the pole."""
    problem = replace(gelfand(), tolerance=1e-5)
    peak: Event = lambda point: Outcome.REACHED_END if point.x[0] > 13.0 else None
    points, outcome = follow(start(problem, [0.5], at_rest(problem)), events=[peak])
    assert outcome is Outcome.REACHED_END
    assert near(points, "fold") == pytest.approx([3.321992118, 1.664156190, 2.108541102], abs=1e-3)
    folds = all_brackets(points)
    for bracket, top in zip(folds, (1.607456775, 6.740792420, 11.37650972), strict=True):
        assert bracket.before.x[0] < top < bracket.after.x[0]
    meshes = {id(point.problem) for point in points}
    assert len(meshes) > 2
    assert_reconverges(points)


def test_branch_points_of_the_trivial_branch():
    """lambda = 1, 4, 9 for Chafee and Infante, none elsewhere; no side branch is taken."""
    problem = chafee_infante(40)
    points, outcome = follow(start(problem, [0.5], at_rest(problem)), [until(10.0)])
    assert outcome is Outcome.REACHED_STOP
    found = all_brackets(points)
    assert [bracket.kind for bracket in found] == 3 * ["branch-point"]
    for bracket, exact in zip(found, (1.0, 4.0, 9.0), strict=True):
        assert bracket.before.parameter < exact < bracket.after.parameter
        assert located(bracket) == pytest.approx(exact, abs=1e-9)
    assert max(np.abs(point.x).max() for point in points) < 1e-10


def test_fold_and_branch_points_of_constant_states():
    """Neumann Bratu: the fold 1/e and the three branch points of the constant states, in order."""
    problem = neumann_bratu()
    points, _ = follow(start(problem, [0.1], at_rest(problem)), [until(3e-4)])
    found = all_brackets(points)
    assert [bracket.kind for bracket in found] == ["fold", *3 * ["branch-point"]]
    y = [1.0, *(1.0 + (n * np.pi) ** 2 / 10.0 for n in (1, 2, 3))]
    for bracket, exact in zip(found, y, strict=True):
        assert bracket.before.x[0] < exact < bracket.after.x[0]


def test_integral_constraint():
    """int y = 0: the fold at 11.923790201."""
    problem = mean_free()
    points, _ = follow(start(problem, [0.5, 0.0], at_rest(problem)), [until(13.0), until(0.4)])
    (bracket,) = all_brackets(points)
    assert bracket.kind == "fold"
    assert located(bracket) == pytest.approx(11.923790201, abs=2e-9)


def test_the_mesh_moves_along():
    """Carrier's layers as eps falls from 0.6 to 0.05: the mesh grows and moves, every point is converged on its own."""
    problem = replace(carrier(), tolerance=1e-5)
    points, outcome = follow(start(problem, [0.6], at_rest(problem), -1.0), [until(0.05)])
    assert outcome is Outcome.REACHED_STOP
    assert points[-1].parameter == 0.05
    assert len({len(point.x) for point in points}) > 1
    assert_reconverges(points)
    # The pitchfork of the symmetric state at eps = 0.4688625139 (Chapman & Farrell's problem).
    (bracket,) = all_brackets(points)
    assert bracket.after.parameter < 0.4688625139 < bracket.before.parameter


@pytest.mark.parametrize(("values", "found"), [((0.9, 1.1), 1), ((0.8, 0.9), 0), ((3.9, 4.1), 1)])
@pytest.mark.parametrize("sizes", [(20, 40), (20, 20), (40, 20)])
def test_signs_are_compared_on_equal_sizes(values: tuple[float, float], found: int, sizes: tuple[int, int]):
    """A branch point between states on different numbers of elements is seen, and none where there is none."""
    pair = []
    for value, size in zip(values, sizes, strict=True):
        problem = chafee_infante(size)
        pair.append(start(problem, [value], at_rest(problem)))
    assert len(brackets(*pair)) == found


CIRCLE = AlgebraicProblem(lambda x, p: x**2 + p**2 - 1.0, 1)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_once_around_the_circle(direction: float):
    """x^2 + lambda^2 = 1, where the arclength is Euclidean: both folds in the right order and 2 pi around."""
    first = start(CIRCLE, [0.0], np.ones(1), direction)
    round_trip: Event = lambda point: Outcome.REACHED_END if point.arclength > 6.25 else None
    points, _ = follow(first, [Stop(LAMBDA, 0.0)], [round_trip])
    assert near(points, "fold") == pytest.approx([direction, -direction], abs=1e-4)
    half, whole = (point for point in points if point.label == "user")
    np.testing.assert_allclose([half.x[0], whole.x[0]], [-1.0, 1.0], atol=1e-8)
    assert whole.arclength == pytest.approx(2.0 * np.pi, rel=2e-3)


def test_start_at_a_fold():
    """No plane of constant parameter crosses the branch at lambda = 1, x = 0; it is followed all the same."""
    point = start_point(CIRCLE, np.zeros(1), np.ones(1), 0)
    assert isinstance(point, Point)
    np.testing.assert_allclose(np.abs(point.tangent), [1.0, 0.0], atol=1e-12)
    points, outcome = follow(point, [until(0.0)])
    assert outcome is Outcome.REACHED_STOP
    assert abs(points[-1].x[0]) == pytest.approx(1.0, abs=1e-8)


CROSSING = AlgebraicProblem(lambda x, p: p[0] * x - x**3, 1)


def test_start_where_branches_cross():
    """At the pitchfork of lambda x = x^3 with a tangent given, that branch is followed (without one: test_beside.py)."""
    origin = np.zeros(1)
    point = start_point(CROSSING, origin, origin, 0, tangent=np.array([1.0, 0.0]))
    assert isinstance(point, Point)
    points, _ = follow(point, [until(0.25)])
    np.testing.assert_allclose(points[-1].x, [0.5], atol=1e-8)


def test_a_pitchfork_met_on_its_side_branch():
    """x = sqrt(lambda) downwards runs through the pitchfork at 0 to x = -sqrt(lambda): a turn and a branch point there."""
    points, _ = follow(start(CROSSING, [0.5], np.array([0.7]), -1.0), [until(0.6)])
    assert points[-1].x[0] == pytest.approx(-np.sqrt(0.6), abs=1e-8)
    found = all_brackets(points)
    assert [bracket.kind for bracket in found] == ["fold", "branch-point"]
    assert found[0].before.x > 0.0 > found[0].after.x


def test_another_branch_nearby_is_not_taken():
    """x^2 = lambda^2 + delta^2: two branches pass at a distance of 2 delta; steps of any size stay on theirs."""
    delta = 2e-3
    problem = AlgebraicProblem(lambda x, p: x**2 - p**2 - delta**2, 1)
    for largest in (0.1, 0.5, 2.0):
        first = start(problem, [-1.0], np.ones(1), first=min(0.3, largest), largest=largest)
        points, outcome = follow(first, [until(1.0)], first=min(0.3, largest), largest=largest)
        assert outcome is Outcome.REACHED_STOP
        assert min(point.x[0] for point in points) >= delta * (1.0 - 1e-8)
        assert not all_brackets(points)


def test_two_folds_within_a_step_are_not_jumped():
    """lambda = x^3 - x/100 turns twice within 0.12 of x, where steps would be 0.5."""
    problem = AlgebraicProblem(lambda x, p: p[0] - x**3 + 0.01 * x, 1)
    points, _ = follow(start(problem, [-1.0], -np.ones(1), largest=0.5), [until(1.0)], largest=0.5)
    turn = 2.0 * (0.01 / 3.0) ** 1.5
    assert near(points, "fold") == pytest.approx([turn, -turn], abs=1e-5)


def test_the_end_of_a_branch_is_an_outcome():
    """x = sqrt(1 - lambda) ends at lambda = 1: steps shrink below their minimum, and the last point is close to it."""
    problem = AlgebraicProblem(lambda x, p: x - jnp.sqrt(1.0 - p), 1)
    points, outcome = follow(start(problem, [0.5], np.ones(1)))
    assert outcome is Outcome.BRANCH_STALLED
    assert not outcome.is_success
    assert "minimum" in outcome.advice
    assert abs(points[-1].parameter - 1.0) < 1e-6
    assert np.isfinite(points[-1].x).all()


def test_the_number_of_points_is_bounded():
    points, outcome = follow(start(CIRCLE, [0.0], np.ones(1)), max_points=7)
    assert (len(points), outcome) == (8, Outcome.MAX_STEPS)


@pytest.mark.parametrize("wrong", [{"first": 1.0}, {"smallest": 0.0}, {"turn": 2.0}])
def test_options_are_checked(wrong: dict[str, float]):
    with pytest.raises(ValueError, match="must"):
        Arclength(**wrong)


def first_return(begin: Point, options: Arclength) -> float:
    """The arclength at which a branch passes its start."""
    points = pairwise(chain([begin], Continuation([begin], (), options)))
    return next(found for one, other in points if (found := passed_start(begin, one, other)) is not None)


@pytest.mark.parametrize("largest", [0.02, 0.2])
@pytest.mark.parametrize("angle", [0.3, np.pi / 2.0, 4.0])
def test_a_closed_branch_passes_its_start(largest: float, angle: float):
    """x^2 + p^2 = 1, from any point of it, folds included: once round."""
    circle = AlgebraicProblem(lambda x, p: x**2 + p[0] ** 2 - 1.0, 1)
    x, p = np.array([np.cos(angle)]), np.array([np.sin(angle)])
    options = Arclength(first=0.01, largest=largest, max_points=500)
    begin = start_point(circle, x, p, 0, 1.0, options)
    assert isinstance(begin, Point)
    assert first_return(begin, options) == pytest.approx(2.0 * np.pi, rel=1e-2)


def test_a_branch_that_crosses_its_start_another_way_goes_on():
    """The figure eight x^2 = p^2 (1 - p^2) from its middle: through the middle the other way, then round to the start."""
    eight = AlgebraicProblem(lambda x, p: x**2 - p[0] ** 2 * (1.0 - p[0] ** 2), 1)
    diagonal = np.array([1.0, 1.0])
    options = Arclength(first=0.01, largest=0.1, max_points=500)
    begin = start_point(eight, np.zeros(1), np.zeros(1), 0, 1.0, options, diagonal)
    assert isinstance(begin, Point)
    # The arc of x = p sqrt(1 - p^2) from p = 0 to 1, four times.
    angle = np.linspace(0.0, 0.5 * np.pi, 20001)
    length = 4.0 * np.trapezoid(np.hypot(np.cos(angle), np.cos(2.0 * angle)), angle)
    assert first_return(begin, options) == pytest.approx(length, rel=1e-2)


class OddProblem(AlgebraicProblem):
    """f(-x) = -f(x)."""

    def reflected(self, x: Array, increment: bool = False) -> Array:
        return -x


@pytest.mark.parametrize(
    ("x", "p", "tangent", "expected"),
    [
        (0.0, 1.0, [1.0, 0.0], True),  # through the second pitchfork
        (0.0, 1.0, [0.0, 1.0], False),  # along the symmetric branch
        (0.5, 0.5, [1.0, 0.0], False),  # between the pitchforks
    ],
)
def test_a_branch_between_pitchforks_goes_on_as_its_mirror_image(
    x: float, p: float, tangent: list[float], expected: bool
):
    """x' = x (p (1 - p) - x^2): the side branch is a closed curve through both pitchforks."""
    odd = OddProblem(lambda x, p: x * (p[0] * (1.0 - p[0]) - x**2), 1)
    point = Point(odd, np.array([x]), np.array([p]), 0, np.array(tangent))
    assert meets_mirror_image(point) is expected
