"""Locate and classify folds and branch points, with an error of the parameter; directions of the branches that meet there."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from shapespace.analysis.singular import SingularProblem, probe
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractSmoothProblem, Border
from shapespace.numerics.newton import Newton, Root, solve_root

LOCATION = Newton(tolerance=1e-10, max_iterations=30)
LARGEST_GAP = 1e-3
"""Branches that pass each other at this distance, relative to the state, count as crossing: discretisation breaks a crossing
that no symmetry protects."""
PROBES = 6
"""Vectors from which a null direction is guessed."""
SAFETY = 8.0
"""Of the parameter's error, over its change on a finer mesh, which falls short of it where convergence is slow, or where the
errors of single elements cancel in it: by a factor of 5 at the fold of a pulled membrane (Fig. 3c of the paper)."""
TILT = 1e-6
"""A branch whose unit tangent has a smaller parameter component than this turns there: one does at a pitchfork, none at a
transcritical point, and both where a symmetry exchanges them, a branch point without another name."""


class Kind(StrEnum):
    """Kinds of singular points."""

    FOLD = "fold"
    PITCHFORK = "pitchfork"
    TRANSCRITICAL = "transcritical"
    BRANCH_POINT = "branch-point"


@dataclass(frozen=True)
class SingularPoint:
    """A singular point of a branch in parameter `index`.

    p: complete, at the point. parameter_error: estimated error of p[index], from the same point on a mesh twice as fine.
    kernel (1, n) or (2, n + 1): orthonormal, the null vector last. directions (2, n + 1): unit tangents (dx, dparameter)
    of the two branches through a branch point (a fold has one).
    """

    kind: Kind
    problem: AbstractSmoothProblem
    index: int
    x: Array
    p: Array
    parameter_error: float
    kernel: Array
    directions: Array

    @property
    def parameter(self) -> float:
        """The parameter's value."""
        return float(self.p[self.index])


def locate_fold(
    problem: AbstractSmoothProblem, index: int, x: Array, p: Array, tangent: Array
) -> SingularPoint | Outcome:
    """The fold near (x, p), where the branch has the tangent dx (n,); an Outcome says why there is none."""
    kernel = _unit_vectors(problem, x, tangent[None])
    root = solve_singular(problem, index, x, p, kernel)
    if root.outcome is not Outcome.CONVERGED:
        return root.outcome
    final = SingularProblem(problem, index, kernel).with_kernel(root.x, p)
    at = final.parameters(root.x, p)
    directions = np.append(final.kernel[0], 0.0)[None]
    error = parameter_error(final, root.x, p)
    return SingularPoint(Kind.FOLD, problem, index, final.state(root.x), at, error, final.kernel, directions)


def locate_branch_point(
    problem: AbstractSmoothProblem, index: int, x: Array, p: Array, tangent: Array
) -> SingularPoint | Outcome:
    """The branch point near (x, p), where one branch has the unit tangent (dx, dparameter) (n + 1,)."""
    kernel = np.stack([tangent, second_direction(problem, index, x, p, tangent)])
    root = solve_singular(problem, index, x, p, kernel)
    if root.outcome is not Outcome.CONVERGED:
        return root.outcome
    final = SingularProblem(problem, index, kernel).with_kernel(root.x, p)
    form = final.form(root.x, p)
    if 2.0 * abs(root.x[-1]) > LARGEST_GAP**2 * np.abs(form).max():
        return Outcome.DIVERGED
    directions = branch_directions(form) @ final.kernel
    if len(directions) < 2:
        return Outcome.DIVERGED
    at, error = final.parameters(root.x, p), parameter_error(final, root.x, p)
    tilts = np.abs(directions[:, -1]) / max(abs(at[index]), 1.0)
    kind = (Kind.TRANSCRITICAL, Kind.PITCHFORK, Kind.BRANCH_POINT)[np.count_nonzero(tilts < TILT)]
    return SingularPoint(kind, problem, index, final.state(root.x), at, error, final.kernel, directions)


def solve_singular(problem: AbstractSmoothProblem, index: int, x: Array, p: Array, kernel: Array) -> Root:
    """Newton on the defining system from a known fold, kernel (1, n), or branch point, kernel (2, n + 1), near (x, p).

    Where F_x is singular Newton on F alone creeps or leaves. The root holds x, p[index] and, of a branch point, the unfolding.
    """
    start = SingularProblem(problem, index, kernel)
    guess = np.append(x, [p[index], 0.0][: len(kernel)])
    return solve_root(start, guess, p, REST, LOCATION)


def second_direction(problem: AbstractSmoothProblem, index: int, x: Array, p: Array, tangent: Array) -> Array:
    """The unit vector (n + 1,) orthogonal to a tangent that [F_x F_p] near a branch point shrinks most.

    The inverse of a nearly singular matrix sends any vector almost into its null direction: what several such images
    share is their leading singular vector.
    """
    weights = np.append(problem.weights(x), max(abs(p[index]), 1.0) ** -2)
    unit = np.zeros_like(p)
    unit[index] = 1.0
    slope = problem.derivative(x, p, np.zeros_like(x), unit)
    row = weights * tangent
    border = Border(slope[None], row[None, :-1], np.array([[row[-1]]]))
    _, linearisation = problem.linearise(x, p, REST, border)
    images = np.stack([linearisation.solve(np.append(probe(len(x), number), 0.0)) for number in range(PROBES)])
    images = images / np.sqrt(images**2 @ weights)[:, None]
    _, _, shared = np.linalg.svd(images * np.sqrt(weights), full_matrices=False)
    combination = images @ (np.sqrt(weights) * shared[0])
    vector = combination @ images
    return np.asarray(vector / np.sqrt(weights @ vector**2))


def branch_directions(form: Array) -> Array:
    """Unit solutions tau (2, 2) of tau^T form tau = 0 for a symmetric form (2, 2); (0, 2) where there is none but zero."""
    form = 0.5 * (form + form.T)
    (a, b), c = form[0], form[1, 1]
    root = b**2 - a * c
    if root <= 0.0:
        return np.zeros((0, 2))
    # The stable one of the two formulas for each root of a t1^2 + 2 b t1 t2 + c t2^2.
    large = -(b + np.copysign(np.sqrt(root), b))
    pair = np.array([[large, a], [c, large]])
    return np.asarray(pair / np.linalg.norm(pair, axis=1)[:, None])


def _unit_vectors(problem: AbstractSmoothProblem, x: Array, vectors: Array) -> Array:
    lengths = np.sqrt((problem.weights(x) * vectors**2).sum(axis=1))
    return np.asarray(vectors / lengths[:, None])


def parameter_error(final: SingularProblem, big_x: Array, p: Array) -> float:
    """How far the parameter moves on a mesh twice as fine, and what Newton leaves; NaN where that cannot be found."""
    value = big_x[len(final.state(big_x))]
    left = LOCATION.tolerance * max(abs(value), 1.0)
    finer = final.refined()
    if finer is None:
        return float(left)
    start = final.carried(big_x, finer)
    root = solve_root(finer, start, p, REST, LOCATION)
    if root.outcome is not Outcome.CONVERGED:
        return float("nan")
    return float(SAFETY * abs(root.x[len(finer.state(root.x))] - value) + left)
