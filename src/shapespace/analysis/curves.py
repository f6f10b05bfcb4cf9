"""Curves of folds and of branch points in two parameters, and the cusps on them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shapespace.analysis.bifurcation import SingularPoint
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.passage import point_between
from shapespace.analysis.singular import SingularProblem
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome

CUSP = 1e-10
"""The search for a cusp ends where its bracket is this part of the first one."""


@dataclass(frozen=True)
class Cusp:
    """Two folds meet: first, second: the values of the curve's own parameter and of the one it was followed in."""

    first: float
    second: float
    x: Array
    p: Array


def start_curve(
    point: SingularPoint, second: int, direction: float = 1.0, options: Arclength = Arclength()
) -> Point | Outcome:
    """The first point of the curve of a fold or branch point in its own parameter and in p[second].

    `Continuation` follows it: its problem is the defining system with X = (x, p[index]) or (x, p[index], unfolding).
    """
    system = SingularProblem(point.problem, point.index, point.kernel)
    X = np.append(point.x, [point.parameter] if system.is_fold else [point.parameter, 0.0])
    return start_point(system, X, point.p, second, direction, options)


def parameters_at(point: Point) -> Array:
    """All parameters at a point of a curve, the curve's own one included."""
    assert isinstance(point.problem, SingularProblem)
    return point.problem.parameters(point.x, point.p)


def fold_form(point: Point) -> float:
    """The quadratic coefficient of a fold, which vanishes at a cusp."""
    assert isinstance(point.problem, SingularProblem)
    return float(point.problem.form(point.x, point.p)[0, 0])


def traced_curve(curve: Continuation) -> Iterator[Point | Cusp]:
    """The points of a curve of folds, each after the cusp that lies before it."""
    last, form = curve.past[-1], fold_form(curve.past[-1])
    for point in curve:
        next_form = fold_form(point)
        if form * next_form < 0.0:
            found = locate_cusp(last, point)
            if found is not None:
                yield found
        yield point
        last, form = point, next_form


def locate_cusp(before: Point, after: Point) -> Cusp | None:
    """The cusp between two neighbours on a curve of folds, by the Illinois method along it; None where Newton fails."""
    at_start = fold_form(before)
    low, high = (0.0, at_start), (1.0, fold_form(after))
    place = after
    for _ in range(60):
        share = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
        found = point_between(before, after, share)
        if found is None:
            return None
        place, form = found, fold_form(found)
        low, high = (high if form * high[1] < 0.0 else (low[0], 0.5 * low[1])), (share, form)
        if abs(high[0] - low[0]) <= CUSP or abs(form) <= 1e-12 * abs(at_start):
            break
    assert isinstance(place.problem, SingularProblem)
    full = parameters_at(place)
    return Cusp(float(full[place.problem.index]), place.parameter, place.problem.state(place.x), full)
