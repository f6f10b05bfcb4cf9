"""Curves of folds and of branch points in two parameters, with the special points on them.

Each kind is the zero of a function along the curve:

    cusp                   the quadratic coefficient psi F''(v, v) of a fold: it meets another one, and both vanish
    bogdanov-takens        psi B v of a fold: a second growth rate vanishes there
    fold-pitchfork         of a fold the determinant: a symmetry-breaking vector joins the kernel;
                           of a pitchfork the parameter component of the symmetric branch, which folds there
    degenerate-pitchfork   the curvature lambda'' of the side branch: super- and subcritical pitchforks meet
    branch-point           the determinant, without a symmetry or on a curve of branch points: curves cross
    turn                   the second parameter's slope: two points meet there and vanish, or the branches reconnect
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from shapespace.analysis.bifurcation import LARGEST_GAP, LOCATION, SAFETY, SingularPoint, branch_directions
from shapespace.analysis.branch import Point, direction_at, metric, orthogonal_plane, test_on
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.passage import find_zero, is_symmetric, point_between
from shapespace.analysis.singular import Kernel, SingularProblem, probe
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST

BRACKET = 1e-10
"""The search for a special point ends where its bracket is this part of the first one."""
BESIDE = 1e-5
"""Shares of the way by which to step aside from a point where the system is singular."""
ASIDE = 0.02
"""The same for places that tell where it is."""
AT_START = 1e-4
"""A function that is so much smaller at the start of a curve than at the next point vanishes at the start."""
TOGETHER = 1e-3
"""Special points nearer to each other, relative to the step, are one."""
STENCIL = 3e-3
"""Of the third derivative, as a change of the state."""


class CurveKind(StrEnum):
    """Kinds of special points of curves; one with a lower place here hides one with a higher place at the same point."""

    CUSP = "cusp"
    DEGENERATE_PITCHFORK = "degenerate-pitchfork"
    FOLD_PITCHFORK = "fold-pitchfork"
    BRANCH_POINT = "branch-point"
    BOGDANOV_TAKENS = "bogdanov-takens"
    TURN = "turn"


@dataclass(frozen=True)
class Special:
    """A special point of a curve. errors: estimated ones of its own parameter and of the second; NaN where unknown."""

    kind: CurveKind
    point: Point
    errors: tuple[float, float]


@dataclass(frozen=True)
class NotFound:
    """A bracket in which a special point was not found: said, not hidden."""

    kind: CurveKind
    before: Point
    after: Point


Function = Callable[[Point], float]


def start_curve(
    point: SingularPoint, second: int, direction: float = 1.0, options: Arclength = Arclength()
) -> Point | Outcome:
    """The first point of the curve of a fold or branch point in its own parameter and in p[second].

    `Continuation` follows it: its problem is the defining system with X = (x, p[index]) or (x, p[index], unfolding).
    """
    system = SingularProblem(point.problem, point.index, point.kernel)
    X = np.append(point.x, [point.parameter] if system.is_fold else [point.parameter, 0.0])
    return start_point(system.renewed(X, point.p), X, point.p, second, direction, options)


def system_of(point: Point) -> SingularProblem:
    """The defining system of a point of a curve."""
    assert isinstance(point.problem, SingularProblem)
    return point.problem


def parameters_at(point: Point) -> Array:
    """All parameters at a point of a curve, the curve's own one included."""
    return system_of(point).parameters(point.x, point.p)


def own_parameter(point: Point) -> float:
    """The parameter in which the singular point is one."""
    return float(parameters_at(point)[system_of(point).index])


def is_unfolded(point: Point) -> bool:
    """Whether the branches of a branch point have parted: it is none, for all that its defining system is solved."""
    system = system_of(point)
    return not system.is_fold and 2.0 * abs(point.x[-1]) > LARGEST_GAP**2 * np.abs(system.form(point.x, point.p)).max()


def branches_at(point: Point) -> tuple[Array, Array]:
    """Unit tangents (n + 1,) of the branches through a branch point: the one along the parameter, and the one across."""
    return _branches(point, system_of(point).factors(point.x, point.p))


def _branches(point: Point, kernel: Kernel) -> tuple[Array, Array]:
    system = system_of(point)
    form = system.form_of(kernel, point.x, point.p)
    directions = branch_directions(form)
    if not len(directions):
        # Both are one, as where curves of pitchforks cross, and round-off left none.
        sizes, axes = np.linalg.eigh(0.5 * (form + form.T))
        directions = np.stack(2 * [axes[:, int(np.argmin(np.abs(sizes)))]])
    pair = directions @ kernel.vectors
    weights = metric(system.base, np.append(system.state(point.x), own_parameter(point)))
    pair = pair / np.sqrt(pair**2 @ weights)[:, None]
    across = int(np.argmin(np.abs(pair[:, -1])))
    return pair[1 - across], pair[across]


def fold_form(point: Point) -> float:
    """The quadratic coefficient of a fold."""
    return float(system_of(point).form(point.x, point.p)[0, 0])


def turning(point: Point) -> float:
    """The slope of the second parameter along the curve; NaN where the curve has no single direction."""
    X = point.joined
    plane = orthogonal_plane(point, metric(point.problem, X) * point.tangent, X)
    found = direction_at(plane, X, point.p)
    return float("nan") if found is None else float(found.tangent[-1])


def regularity(point: Point) -> float:
    """Zero where the curve's system is singular: the inverse size of a fixed solution, with the determinant's sign."""
    X = point.joined
    plane = orthogonal_plane(point, metric(point.problem, X) * point.tangent, X)
    _, linearisation = plane.linearise(X, point.p, REST)
    return linearisation.sign / float(np.linalg.norm(linearisation.solve(probe(len(X)))))


class Readings(NamedTuple):
    """Functions whose zeros are special points, at a point of a curve. along (n + 1,): of a branch point, to orient the next."""

    point: Point
    values: dict[CurveKind, float]
    along: Array = np.zeros(0)


def readings(point: Point, before: Readings | None = None) -> Readings:
    """The functions at a point; those that depend on an orientation take that of the reading before."""
    system, turn = system_of(point), float(point.tangent[-1])
    if system.is_fold:
        form, mass = fold_form(point), system.mass_form(point.x, point.p)
        return Readings(point, {CurveKind.CUSP: form, CurveKind.BOGDANOV_TAKENS: mass, CurveKind.TURN: turn})
    along = branches_at(point)[0]
    if before is not None:
        along = along * np.sign(along @ _carried(before.along, before.point, point))
    steep = float(along[-1])
    values = {
        CurveKind.DEGENERATE_PITCHFORK: side_curvature(point),
        CurveKind.FOLD_PITCHFORK: steep,
        CurveKind.TURN: turn,
    }
    return Readings(point, values, along)


def _carried(along: Array, home: Point, place: Point) -> Array:
    """A direction (n + 1,) on the discretisation of another point."""
    return np.append(system_of(home).base.carried(along[:-1], system_of(place).base), along[-1])


def function_of(kind: CurveKind, point: Point) -> Function:
    """The function whose zero near a point is a special point of this kind."""
    if kind is CurveKind.TURN:
        return turning
    if kind is CurveKind.CUSP:
        return fold_form
    if kind is CurveKind.BOGDANOV_TAKENS:
        return lambda place: system_of(place).mass_form(place.x, place.p)
    if kind is CurveKind.DEGENERATE_PITCHFORK:
        return side_curvature
    if kind is CurveKind.BRANCH_POINT or system_of(point).is_fold:
        return regularity
    along = branches_at(point)[0]

    def steepness(place: Point) -> float:
        tangent = branches_at(place)[0]
        return float(tangent[-1] * np.sign(tangent @ _carried(along, point, place)))

    return steepness


def side_curvature(point: Point) -> float:
    """lambda'' of the branch that leaves a pitchfork, in the amplitude of its unit tangent phi.

    With the base branch's tangent t = (t_x, t_lambda), x = x0 + a phi + a^2/2 w + ... and lambda = lambda0 + a^2/2 mu:

        F_x w + F_lambda mu = -F''(phi, phi),    psi [F'''(phi, phi, phi) + 3 F''(phi, (w, mu))] = 0,

    the second fixing how much of t is in (w, mu). F''' is a difference of fourth order.
    """
    system, p = system_of(point), parameters_at(point)
    x, base = system.state(point.x), system.base
    kernel = system.factors(point.x, point.p)
    along, across = _branches(point, kernel)
    phi, none = across[:-1], np.zeros_like(p)

    def second(at: Array, other: Array) -> Array:
        step = none.copy()
        step[system.index] = other[-1]
        return base.second_derivative(at, p, phi, none, other[:-1], step)

    flat = np.append(phi, 0.0)
    particular = kernel.increment(-second(x, flat))[:-1]
    stencil = [second(x + k * STENCIL * phi, flat) for k in (-2.0, -1.0, 1.0, 2.0)]
    third = (stencil[0] - 8.0 * stencil[1] + 8.0 * stencil[2] - stencil[3]) / (12.0 * STENCIL)
    share = kernel.project(third + 3.0 * second(x, particular)) / (3.0 * kernel.project(second(x, along)))
    return float(particular[-1] - share * along[-1])


def traced_curve(curve: Continuation) -> Iterator[Point | Special | NotFound]:
    """The points of a curve, each after the special points that lie before it."""
    last = readings(curve.past[-1])
    for point in curve:
        now = readings(point, last)
        yield from special_points(last, now)
        yield point
        last = now


def special_points(one: Readings, other: Readings) -> list[Special | NotFound]:
    """What lies between two neighbours of a curve with these readings, in its order."""
    before, after = one.point, other.point
    # A curve that starts at a special point need not find it again.
    least = AT_START if before.arclength == 0.0 else 0.0
    kinds = [
        kind
        for kind, value in one.values.items()
        if value * other.values[kind] < 0.0 and abs(value) > least * abs(other.values[kind])
    ]
    if test_on(before, after.problem) * after.test < 0.0:
        system = system_of(after)
        mirrored = system.is_fold and is_symmetric(system.base, system.state(after.x))
        kinds.append(CurveKind.FOLD_PITCHFORK if mirrored else CurveKind.BRANCH_POINT)
    found: list[tuple[float, Special | NotFound]] = []
    for kind in sorted(kinds, key=list(CurveKind).index):
        function = function_of(kind, after)
        share = locate(before, after, function)
        place = None if share is None else _place(before, after, share)
        if share is None or place is None:
            found.append((1.0, NotFound(kind, before, after)))
        elif all(abs(share - known) > TOGETHER for known, _ in found):
            labelled = replace(place, label=str(kind), test=float("nan"))
            found.append((share, Special(kind, labelled, _errors(before, after, function, place))))
    return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def locate(before: Point, after: Point, function: Function) -> float | None:
    """The share of the way to a zero of a function between two neighbours; None where it is not found.

    Where `regularity` vanishes Newton fails and round-off rules: its zero is that of a cubic through places beside it,
    and a place where Newton fails is where to look.
    """

    def at(share: float) -> float:
        place = point_between(before, after, share)
        return float("nan") if place is None else function(place)

    if function is not regularity:
        return find_zero(at, BRACKET)
    share = find_zero(lambda place: float(np.nan_to_num(at(place))), ASIDE)
    if share is None:
        return None
    places = share + ASIDE * np.array([-2.0, -1.0, 1.0, 2.0])
    values = np.array([at(place) for place in places])
    if not (np.sign(values) == np.sign(values[0]) * np.array([1.0, 1.0, -1.0, -1.0])).all():
        return None
    return float(np.polynomial.Polynomial.fit(values, places, 3)(0.0))


def _place(before: Point, after: Point, share: float) -> Point | None:
    """The point at a share of the way; where Newton fails the middle of two close by."""
    place = point_between(before, after, share)
    if place is not None:
        return place
    low, high = (point_between(before, after, share + side) for side in (-BESIDE, BESIDE))
    if low is None or high is None:
        return None
    middle = 0.5 * (low.p + high.p)
    return replace(high, x=0.5 * (low.x + high.x), p=middle, arclength=0.5 * (low.arclength + high.arclength))


def _errors(before: Point, after: Point, function: Function, place: Point) -> tuple[float, float]:
    """How far both parameters move on a discretisation twice as fine, and what the search leaves."""
    values = np.array([own_parameter(place), place.parameter])
    errors = LOCATION.tolerance * np.maximum(np.abs(values), 1.0)
    finer = system_of(after).refined()
    if finer is not None:
        there = after.on(finer)
        share = locate(before, there, function)
        other = None if share is None else _place(before, there, share)
        moved = np.nan if other is None else np.array([own_parameter(other), other.parameter]) - values
        errors = errors + SAFETY * np.abs(moved)
    return float(errors[0]), float(errors[1])
