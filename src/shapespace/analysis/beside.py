"""States at and just beside a branch point, where round-off drowns Newton's method, tangents and signs of determinants.

There the state is the branch point itself, located by its own regular system, moved along the direction of its branch:
exact to the square of the way.
"""

from typing import NamedTuple

import numpy as np

from shapespace.analysis.bifurcation import SingularPoint, locate_branch_point
from shapespace.analysis.branch import Direction, Point, direction_at, metric, orthogonal_plane
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractContinuableProblem, AbstractSmoothProblem

BESIDE = 1e-5
"""A state at most this far from a branch point, in the metric, lies beside it."""
AWAY = 1e-3
"""In the metric: so far from a branch point the determinant's sign is beyond doubt."""
BLURRED = 3e-2
"""A state with the very parameter of a pitchfork, this far from it in the metric, is the pitchfork: F grows with the third power
of the distance only, so that Newton's method ends anywhere about it."""
SUSPICIOUS = 1e-2
"""Ratio of the test function at a state to that a step AWAY below which a branch point is looked for."""
AT_POINT = 1e-9
"""A parameter within this of the branch point's, relative to it (or one), is the branch point's."""


class Beside(NamedTuple):
    """A state beside a branch point: X (n + 1,) = (x, parameter), the unit tangent (n + 1,) of its branch, its test function."""

    X: Array
    tangent: Array
    test: float


def beside_branch_point(
    problem: AbstractContinuableProblem,
    X: Array,
    p: Array,
    index: int,
    along: Array,
    parameter_scale: float = 0.0,
) -> Beside | None:
    """The state near X with its parameter if it lies beside a branch point; None where there is none.

    along (n + 1,): the way its branch is followed, as far as it is known. At the branch point itself the test function has the
    sign that it has beyond, so that the point is passed before the state.
    """
    if not isinstance(problem, AbstractSmoothProblem):
        return None
    weights = metric(problem, X, parameter_scale)
    row = weights * along
    here, there = (_direction(problem, place, p, index, row) for place in (X, _away(X, along, weights)))
    if there is None or (here is not None and abs(here.test) > SUSPICIOUS * abs(there.test)):
        return None
    point = branch_point_near(problem, X, p, index, along, parameter_scale)
    if isinstance(point, Outcome):
        return None
    home, way = np.append(point.x, point.parameter), float(X[-1]) - point.parameter
    is_there = abs(way) <= AT_POINT * max(abs(point.parameter), 1.0)
    if np.sqrt(weights @ (X - home) ** 2) > (BLURRED if is_there else BESIDE):
        return None
    directions = point.directions / np.sqrt(point.directions**2 @ weights)[:, None]
    tangent = directions[np.argmax(np.abs(directions @ row))]
    tangent = tangent * np.copysign(1.0, row @ tangent)
    if not is_there and abs(way) > 2.0 * BESIDE * abs(tangent[-1]):
        return None
    share = AT_POINT if is_there else way / float(tangent[-1])
    state = np.append(point.x, X[-1]) if is_there else home + share * tangent
    beyond = _direction(problem, home + AWAY * tangent, p, index, weights * tangent)
    return None if beyond is None else Beside(state, tangent, beyond.test * share / AWAY)


def branch_point_near(
    problem: AbstractSmoothProblem, X: Array, p: Array, index: int, along: Array, parameter_scale: float = 0.0
) -> SingularPoint | Outcome:
    """The branch point near X (n + 1,), on a branch that goes about `along`; an Outcome says why there is none.

    X may be the point itself: it is looked for from a place AWAY, where the null vector stands out and the tangent is known.
    """
    weights = metric(problem, X, parameter_scale)
    place = _away(X, along, weights)
    found = _direction(problem, place, p, index, weights * along)
    if found is None:
        return Outcome.SINGULAR
    unit = found.tangent / np.sqrt(weights @ found.tangent**2)
    return locate_branch_point(problem, index, place[:-1], _full(place, p, index), unit)


def _away(X: Array, along: Array, weights: Array) -> Array:
    return np.asarray(X + AWAY * along / np.sqrt(weights @ along**2))


def _direction(problem: AbstractContinuableProblem, X: Array, p: Array, index: int, row: Array) -> Direction | None:
    """The direction at X across a plane."""
    full = _full(X, p, index)
    point = Point(problem, X[:-1], full, index, row)
    return direction_at(orthogonal_plane(point, row, X), X, full)


def _full(X: Array, p: Array, index: int) -> Array:
    """All parameters (n_p,), that of X in its place."""
    out = p.copy()
    out[index] = X[-1]
    return out
