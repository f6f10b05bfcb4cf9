"""A branch with its singular points: located between the points that bracket them, named, and ways onto other branches."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from shapespace.analysis.bifurcation import Kind, SingularPoint, locate_branch_point, locate_fold
from shapespace.analysis.branch import Bracket, Point, brackets, hermite, metric, real_roots, test_on
from shapespace.analysis.continuation import Continuation
from shapespace.analysis.passage import find_zero, point_between
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractSmoothProblem

CLOSE = 1e-6
"""Shares of the way between two neighbours to which a change of sign is told."""


@dataclass(frozen=True)
class Located:
    """A singular point on the way from one point to the next."""

    point: SingularPoint
    bracket: Bracket


@dataclass(frozen=True)
class Missed:
    """A bracket in which no singular point was found, and why: said, not hidden."""

    bracket: Bracket
    outcome: Outcome


def traced(branch: Continuation) -> Iterator[Point | Located | Missed]:
    """The points of a branch, each after the singular points that lie before it."""
    last = branch.past[-1]
    for point in branch:
        yield from singular_points(last, point)
        yield point
        last = point


def singular_points(before: Point, after: Point) -> list[Located | Missed]:
    """What lies between two neighbours. A pitchfork met from its side branch turns the parameter too: one point, not two."""
    found: list[Located | Missed] = []
    for bracket in sorted(brackets(before, after), key=lambda bracket: bracket.kind):
        if bracket.kind == "fold" and any(isinstance(one, Located) and _turns(one.point) for one in found):
            continue
        found.append(_located(bracket))
    return found


def _turns(point: SingularPoint) -> bool:
    """Whether the parameter turns on one of the branches through a point."""
    return point.kind in (Kind.PITCHFORK, Kind.BRANCH_POINT)


def _located(bracket: Bracket) -> Located | Missed:
    """Locate the singular point of a bracket, on the discretisation of its end."""
    outcome = Outcome.DIVERGED
    for X, tangent in _guesses(bracket):
        point = _solved(bracket, X, tangent)
        if isinstance(point, Outcome):
            outcome = point
        elif _is_inside(bracket, point):
            return Located(point, bracket)
    return Missed(bracket, outcome)


def _guesses(bracket: Bracket) -> Iterator[tuple[Array, Array]]:
    """(x, parameter) and unit tangents near the singular point, the cheapest first."""
    yield between(bracket)
    if bracket.kind == "branch-point":
        # Where all along the branch another direction is nearly annulled, the null vector stands out only close by.
        place = _sign_change(bracket)
        if place is not None:
            yield place.joined, place.tangent


def _sign_change(bracket: Bracket) -> Point | None:
    """Where the test function of branch points changes its sign; None where it cannot be told."""
    before, after = bracket.before, bracket.after

    def at(share: float) -> float:
        place = point_between(before, after, share)
        return 0.0 if place is None else float(np.nan_to_num(test_on(place, after.problem)))

    share = find_zero(at, CLOSE)
    return None if share is None else point_between(before, after, share)


def _solved(bracket: Bracket, X: Array, tangent: Array) -> SingularPoint | Outcome:
    """The singular point near X, or why it is not found."""
    problem, index = bracket.after.problem, bracket.after.index
    assert isinstance(problem, AbstractSmoothProblem)
    x, p = X[:-1], bracket.after.p.copy()
    p[index] = X[-1]
    if bracket.kind == "fold":
        point = locate_fold(problem, index, x, p, tangent[:-1])
        if not isinstance(point, Outcome):
            return point
    # Where the parameter turns at a pitchfork, F_p lies in the range of F_x, and a fold's defining system is singular.
    return locate_branch_point(problem, index, x, p, tangent)


def _is_inside(bracket: Bracket, point: SingularPoint) -> bool:
    """Whether a located point lies no farther from either end than they from each other, but for the arc between."""
    problem = point.problem
    there = np.append(point.x, point.parameter)
    weights = metric(problem, there)
    ends = [bracket.before.on(problem).joined, bracket.after.joined]
    distance = max(float(np.sqrt(weights @ (there - end) ** 2)) for end in ends)
    return distance <= 1.5 * (bracket.after.arclength - bracket.before.arclength)


def between(bracket: Bracket) -> tuple[Array, Array]:
    """(x, parameter) and the unit tangent (n + 1,) in a bracket: where the parameter turns, or half way."""
    problem = bracket.after.problem
    start, end = bracket.before.on(problem), bracket.after
    length = end.arclength - start.arclength
    cubic = hermite(start.joined, start.tangent, end.joined, end.tangent, length)
    s = 0.5 * length
    if bracket.kind == "fold":
        turns = real_roots(np.asarray(polyder(cubic[:, -1])), 0.0, length)
        s = float(turns[0]) if len(turns) else s
    X, tangent = np.asarray(polyval(s, cubic)), np.asarray(polyval(s, polyder(cubic)))
    weights = metric(problem, X)
    return X, tangent / np.sqrt(weights @ tangent**2)


def side_branches(point: SingularPoint, along: Array, step: float) -> list[Point]:
    """Starts of the other branch through a branch point, to both sides; `along` (n + 1,) is the branch already known."""
    weights = metric(point.problem, np.append(point.x, point.parameter))
    overlaps = [abs(weights @ (direction * along)) for direction in point.directions]
    other = point.directions[int(np.argmin(overlaps))]
    start = Point(point.problem, point.x, point.p, point.index, other, step=step, label=str(point.kind))
    return [start, replace(start, tangent=-other)]
