"""Curves of folds and of branch points in two parameters, and the cusps on them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyval

from shapespace.analysis.bifurcation import SingularPoint
from shapespace.analysis.branch import Point, hermite, metric, orthogonal_plane
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.singular import SingularProblem
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.numerics.newton import Newton, solve_root

CUSP = 1e-10
"""Where secant steps along the curve, relative to the bracket, end the search for a cusp."""


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


def traced_curve(curve: Continuation, newton: Newton = Newton(tolerance=1e-10)) -> Iterator[Point | Cusp]:
    """The points of a curve of folds, each after the cusp that lies before it."""
    last, form = curve.past[-1], fold_form(curve.past[-1])
    for point in curve:
        next_form = fold_form(point)
        if form * next_form < 0.0:
            found = locate_cusp(last, point, newton)
            if found is not None:
                yield found
        yield point
        last, form = point, next_form


def locate_cusp(before: Point, after: Point, newton: Newton = Newton(tolerance=1e-10)) -> Cusp | None:
    """The cusp between two neighbours on a curve of folds, by the Illinois method along it; None where Newton fails."""
    system = after.problem
    assert isinstance(system, SingularProblem)
    start = before.on(system)
    length = after.arclength - before.arclength
    cubic = hermite(start.joined, start.tangent, after.joined, after.tangent, length)
    row = metric(system, after.joined) * (after.joined - start.joined)
    rate = Rate.of_growth(system.stored(after.x, after.p))
    low, high = (0.0, fold_form(before)), (length, fold_form(after))
    for _ in range(60):
        s = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
        guess = np.asarray(polyval(s, cubic))
        plane = orthogonal_plane(start, row, guess)
        root = solve_root(plane, guess, after.p, rate, newton)
        if root.outcome is not Outcome.CONVERGED:
            return None
        x, p = plane.split(root.x, after.p)
        form = float(system.form(x, p)[0, 0])
        if form * high[1] < 0.0:
            low, high = high, (s, form)
        else:
            low, high = (low[0], 0.5 * low[1]), (s, form)
        if abs(high[0] - low[0]) <= CUSP * length or form == 0.0 or abs(form) <= 1e-12 * abs(fold_form(before)):
            break
    full = system.parameters(x, p)
    return Cusp(float(full[system.index]), float(p[after.index]), system.state(x), full)
