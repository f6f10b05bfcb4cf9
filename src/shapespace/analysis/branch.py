"""Points of a branch, the geometry around them, and what two neighbours tell of the folds and branch points between them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from shapespace.analysis.extended import Affine, ExtendedProblem
from shapespace.base.arrays import Array
from shapespace.base.problem import REST, AbstractContinuableProblem, AbstractLinearisation

TANGENT_ERROR = 1e-4
"""Of a tangent found with factors from nearby, in the norm of the problem; predictions need no better."""
MAX_CORRECTIONS = 4
"""Of such a tangent; new factors cost as much."""
MAX_REFINEMENTS = 2
"""Of the solution that tells whether factors are near."""
NEARBY = 0.1
"""Factors stand for the Jacobian at a point where its refinements reduce the error of any solution at least this much."""


@dataclass(frozen=True)
class Point:
    """A state of a branch in parameter `index`, on its own discretisation.

    p (n_p,): all parameters. tangent (n + 1,): (dx, dp[index]) per arclength, of unit length in the `metric`. arclength:
    from the start. step: the next one to try. test: of `Direction`, comparable between states of equal size; NaN where it
    is unknown. label: why the branch stopped here, if it did.
    """

    problem: AbstractContinuableProblem
    x: Array
    p: Array
    index: int
    tangent: Array
    arclength: float = 0.0
    step: float = 0.0
    test: float = float("nan")
    iterations: int = 0
    jacobians: int = 0
    label: str = ""

    @property
    def parameter(self) -> float:
        """The parameter's value."""
        return float(self.p[self.index])

    @property
    def joined(self) -> Array:
        """(x, p[index]) (n + 1,)."""
        return np.append(self.x, self.p[self.index])

    def reversed(self) -> "Point":
        """The same point on the way back."""
        return replace(self, tangent=-self.tangent, test=-self.test)

    def on(self, problem: AbstractContinuableProblem) -> "Point":
        """The same point on another discretisation, as exact as interpolation leaves it."""
        if problem is self.problem:
            return self
        x, dx = (self.problem.carried(part, problem) for part in (self.x, self.tangent[:-1]))
        test = self.test if len(x) == len(self.x) else float("nan")
        return replace(self, problem=problem, x=x, tangent=np.append(dx, self.tangent[-1]), test=test)


def metric(problem: AbstractContinuableProblem, X: Array, parameter_scale: float = 0.0) -> Array:
    """Weights (n + 1,) of the inner product of tangents at X = (x, parameter): of the problem, and 1/scale^2.

    parameter_scale: what counts as a change of order one; 0 stands for max(|parameter|, 1).
    """
    scale = parameter_scale or max(abs(float(X[-1])), 1.0)
    return np.append(problem.weights(X[:-1]), scale**-2)


def orthogonal_plane(point: Point, row: Array, through: Array) -> ExtendedProblem:
    """F = 0 in the plane row . (X - through) = 0."""
    parameters = np.zeros_like(point.p)
    parameters[point.index] = row[-1]
    return ExtendedProblem(point.problem, (point.index,), (Affine(row[:-1], parameters, float(row @ through)),))


class Direction(NamedTuple):
    """A tangent (n + 1,), not yet of unit length, and the test function there.

    test: |1/(l . A^-1 g)| with the sign of det A for the bordered Jacobian A and fixed generic l, g (n + 1,). It crosses zero
    where the determinant does, smoothly along a branch, and is of moderate size.
    """

    tangent: Array
    test: float


def direction_at(
    plane: ExtendedProblem, X: Array, p: Array, nearby: AbstractLinearisation | None = None
) -> Direction | None:
    """The tangent at X across a plane, row . tangent = 1; None where the bordered Jacobian is singular.

    nearby: factors of it at a state nearby. Where they are near enough to leave the sign of the determinant in no doubt, the
    tangent is found by iteration with them, which is cheaper than new factors.
    """
    if nearby is not None:
        found = _direction_nearby(plane, X, p, nearby)
        if found is not None:
            return found
    _, linearisation = plane.linearise(X, p, REST)
    if linearisation.is_singular:
        return None
    response = linearisation.solve(_generic(len(X), 0))
    return Direction(linearisation.solve(_last_unit(X)), _test(linearisation, response))


def _direction_nearby(plane: ExtendedProblem, X: Array, p: Array, nearby: AbstractLinearisation) -> Direction | None:
    """The direction by iteration with factors A0 from nearby; None where they are too far for it.

    They are near where the iteration for A^-1 g converges, a solution in which directions that A almost annuls stand out: the
    determinants of A0 and A can differ in sign only where A0^-1 A has a negative eigenvalue, and there it diverges.
    """
    known = _generic(len(X), 0)
    generic = nearby.solve(known)
    for refinement in range(1, MAX_REFINEMENTS + 1):
        missing = nearby.solve(known - plane.derivative(X, p, generic))
        generic = generic + missing
        if plane.norm(missing, X) <= NEARBY * plane.norm(generic, X):
            contraction = NEARBY ** (1.0 / refinement)
            break
    else:
        return None
    tangent = nearby.solve(_last_unit(X))
    for _ in range(MAX_CORRECTIONS):
        correction = nearby.solve(plane.derivative(X, p, tangent) - _last_unit(X))
        tangent = tangent - correction
        if contraction * plane.norm(correction, X) <= TANGENT_ERROR:
            return Direction(tangent, _test(nearby, generic))
    return None


def _test(linearisation: AbstractLinearisation, response: Array) -> float:
    """The test function from the sign of A and A^-1 g."""
    return linearisation.sign / abs(float(_generic(len(response), 1) @ response))


def _last_unit(X: Array) -> Array:
    unit = np.zeros_like(X)
    unit[-1] = 1.0
    return unit


@cache
def _generic(size: int, number: int) -> Array:
    return np.random.default_rng(number).standard_normal(size)


def hermite(start: Array, start_slope: Array, end: Array, end_slope: Array, length: float) -> Array:
    """Coefficients (4, ...) in powers of s of the cubic with these values and slopes at s = 0 and s = length."""
    mean = (end - start) / length
    return np.stack(
        [
            start,
            start_slope,
            (3.0 * mean - 2.0 * start_slope - end_slope) / length,
            (start_slope + end_slope - 2.0 * mean) / length**2,
        ]
    )


def real_roots(coefficients: Array, start: float, end: float) -> Array:
    """The real roots of a polynomial, coefficients in rising powers, in (start, end], in rising order."""
    reach = max(abs(start), abs(end)) ** np.arange(1, len(coefficients))
    if abs(coefficients[0]) > np.abs(coefficients[1:]) @ reach:
        return np.zeros(0)
    kept = np.trim_zeros(coefficients, "b")
    roots = np.polynomial.polynomial.polyroots(kept) if len(kept) > 1 else np.zeros(0)
    real = np.sort(roots.real[np.abs(roots.imag) <= 1e-9 * (end - start)])
    return np.asarray(real[(real > start) & (real <= end)])


@dataclass(frozen=True)
class Bracket:
    """Two neighbours on a branch with a singular point between them.

    A pitchfork met on its side branch appears as both kinds in one place, as the parameter turns there too.
    """

    kind: Literal["fold", "branch-point"]
    before: Point
    after: Point


def brackets(before: Point, after: Point) -> list[Bracket]:
    """Singular points between two neighbours: the parameter turns at a fold, the bordered determinant changes sign at a
    branch point where an odd number of directions leave.
    """
    found = []
    if before.tangent[-1] * after.tangent[-1] < 0.0:
        found.append(Bracket("fold", before, after))
    if test_on(before, after.problem) * after.test < 0.0:
        found.append(Bracket("branch-point", before, after))
    return found


def all_brackets(points: Sequence[Point]) -> list[Bracket]:
    """Brackets of all neighbours, in the order of the branch."""
    return [bracket for pair in pairwise(points) for bracket in brackets(*pair)]


def test_on(point: Point, problem: AbstractContinuableProblem) -> float:
    """The test function of a point, comparable with that of states on another discretisation; NaN where it is unknown."""
    there = point.on(problem)
    if not np.isnan(there.test):
        return there.test
    X = there.joined
    plane = orthogonal_plane(there, metric(problem, X) * there.tangent, X)
    direction = direction_at(plane, X, there.p)
    return float("nan") if direction is None else direction.test
