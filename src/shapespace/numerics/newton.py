"""Damped Newton with an affine-invariant acceptance test, reusing the Jacobian while it contracts well."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, Rate

NEGLIGIBLE = 1e-12
"""Corrections smaller than this, relative to the unknowns, need no further look."""
ROUND_OFF_SPREAD = 10.0
"""Corrections up to this many times a sample of the round-off count as round-off; on surfaces they are 1 to 5 times it."""
SLOW = 0.5
"""Corrections that shrink by less than this factor say little of the error left."""
NEAR = 1e-3
"""Corrections larger than this are never round-off."""


@dataclass(frozen=True)
class Newton:
    """Options. tolerance: accepted size of the last correction, in the problem's norm.

    The error left, as the last two corrections let expect, must be smaller by `reuse_contraction`, unless round-off lets
    corrections shrink no more. max_iterations, min_damping: patience.
    """

    tolerance: float = 1e-8
    max_iterations: int = 25
    min_damping: float = 1e-4
    reuse_contraction: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise ValueError(f"tolerance must lie in (0, 1); got {self.tolerance}.")
        if not 0.0 < self.min_damping <= 1.0:
            raise ValueError(f"min_damping must lie in (0, 1]; got {self.min_damping}.")


@dataclass(frozen=True)
class Root:
    """The end of a Newton iteration. correction: size of the last correction; jacobians, iterations: work done."""

    x: Array
    outcome: Outcome
    iterations: int
    jacobians: int
    correction: float
    linearisation: AbstractLinearisation | None


def solve_root(
    problem: AbstractProblem,
    x: Array,
    p: Array,
    rate: Rate,
    newton: Newton,
    linearisation: AbstractLinearisation | None = None,
) -> Root:
    """Solve F(x, dq/dt; p) = 0 from the guess x.

    A full or damped step is accepted where the simplified correction of the trial point has shrunk by 1 - damping/4
    (natural monotonicity test, Deuflhard 2011, Sec. 3.3): the test does not depend on how equations are scaled. The Jacobian is
    kept while corrections shrink by `reuse_contraction`, or one more like the last will do. `linearisation`: factors from a
    nearby state to try first.
    """
    jacobians, goal = 0, newton.reuse_contraction * newton.tolerance
    residual = x[:0] if linearisation is None else problem.residual(x, p, rate)
    step, size = None, np.inf
    for iteration in range(1, newton.max_iterations + 1):
        fresh = linearisation is None
        if linearisation is None:
            residual, linearisation = problem.linearise(x, p, rate)
            jacobians += 1
        if not np.isfinite(residual).all():
            return Root(x, Outcome.NOT_FINITE, iteration, jacobians, np.inf, None)
        if linearisation.is_singular:
            return Root(x, Outcome.SINGULAR, iteration, jacobians, np.inf, None)
        if step is None:
            step = -linearisation.solve(residual)
            size = problem.norm(step, x)
        if size <= NEGLIGIBLE:
            return Root(x + step, Outcome.CONVERGED, iteration, jacobians, size, linearisation)
        trial = _damped_step(problem, linearisation, x, p, rate, step, size, newton)
        contracts_well = trial is not None and trial.contraction <= newton.reuse_contraction
        contracts = contracts_well or (
            trial is not None and trial.contraction <= SLOW and trial.contraction * trial.error_left <= goal
        )
        # Factors from another state are not trusted here: round-off may hide an error that they reduce slowly.
        may_stagnate = not contracts_well and jacobians > 0 and size <= (newton.tolerance if contracts else NEAR)
        if may_stagnate and size <= ROUND_OFF_SPREAD * _round_off(problem, linearisation, x, residual, p, rate):
            return Root(x + step, Outcome.CONVERGED, iteration, jacobians, size, linearisation)
        step = None
        if trial is None:
            if fresh:
                return Root(x, Outcome.DIVERGED, iteration, jacobians, size, None)
            linearisation = None
            continue
        x, residual = trial.x, trial.residual
        if contracts and trial.size <= newton.tolerance and trial.error_left <= goal:
            return Root(x + trial.correction, Outcome.CONVERGED, iteration, jacobians, trial.size, linearisation)
        if contracts:
            # The simplified correction is the next step with the Jacobian kept.
            step, size = trial.correction, trial.size
        else:
            linearisation = None
    return Root(x, Outcome.MAX_ITERATIONS, newton.max_iterations, jacobians, size, None)


def _round_off(
    problem: AbstractProblem, linearisation: AbstractLinearisation, x: Array, residual: Array, p: Array, rate: Rate
) -> float:
    """A sample of what round-off in F and in the solution makes of a correction at x, in the problem's norm.

    It is what the Jacobian does not explain of the change of F as each unknown moves to a neighbouring floating-point
    number: up or down without order, since a symmetric change says nothing of a nearly singular antisymmetric mode.
    Velocities are differences over a time step, so it grows as the step shrinks.
    """
    moved = np.nextafter(x, np.random.default_rng(0).choice([-np.inf, np.inf], x.size))
    change = linearisation.solve(problem.residual(moved, p, rate) - residual)
    return problem.norm(change - (moved - x), x)


class _Trial(NamedTuple):
    """An accepted point: its residual, the simplified correction there and its size.

    contraction: ratio of that size to the one before; infinite after a damped step, which tells nothing of the next.
    """

    x: Array
    residual: Array
    correction: Array
    size: float
    contraction: float

    @property
    def error_left(self) -> float:
        """Estimated size of all corrections after the simplified one, were they to shrink as it did."""
        return self.contraction / (1.0 - self.contraction) * self.size if self.contraction < 1.0 else np.inf


def _damped_step(
    problem: AbstractProblem,
    linearisation: AbstractLinearisation,
    x: Array,
    p: Array,
    rate: Rate,
    step: Array,
    size: float,
    newton: Newton,
) -> _Trial | None:
    """The first point x + damping step that passes the natural monotonicity test, halving the damping; None if none does."""
    damping = 1.0
    while damping >= newton.min_damping:
        trial = x + damping * step
        residual = problem.residual(trial, p, rate)
        if np.isfinite(residual).all():
            correction = -linearisation.solve(residual)
            correction_size = problem.norm(correction, x)
            if correction_size <= (1.0 - 0.25 * damping) * size:
                contraction = correction_size / size if damping == 1.0 else np.inf
                return _Trial(trial, residual, correction, correction_size, contraction)
        damping *= 0.5
    return None
