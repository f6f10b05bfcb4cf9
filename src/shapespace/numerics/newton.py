"""Damped Newton with an affine-invariant acceptance test, reusing the Jacobian while it contracts well."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, Rate


@dataclass(frozen=True)
class Newton:
    """Options. tolerance: accepted size of the last correction, in the problem's norm.

    That correction must be smaller than the one before by `reuse_contraction`, and so is the error left; or else both
    are below `round_off`, where corrections shrink no more. Factors from another state are not trusted there, as
    round-off may hide an error that they reduce slowly.
    """

    tolerance: float = 1e-8
    round_off: float = 1e-12
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
    (natural monotonicity test, Deuflhard 2011, Sec. 3.3): the test does not depend on how equations are scaled. While
    corrections shrink by `reuse_contraction` the Jacobian is kept. `linearisation`: factors from a nearby state to try first.
    """
    jacobians = 0
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
        trial = _damped_step(problem, linearisation, x, p, rate, step, size, newton)
        step = None
        if trial is None:
            if fresh:
                return Root(x, Outcome.DIVERGED, iteration, jacobians, size, None)
            linearisation = None
            continue
        x, residual = trial.x, trial.residual
        contracts = trial.damping == 1.0 and trial.size <= newton.reuse_contraction * size
        stagnates = jacobians > 0 and not contracts and max(size, trial.size) <= newton.round_off
        if stagnates or (contracts and trial.size <= newton.tolerance):
            return Root(x + trial.correction, Outcome.CONVERGED, iteration, jacobians, trial.size, linearisation)
        if contracts:
            # The simplified correction is the next step with the Jacobian kept.
            step, size = trial.correction, trial.size
        else:
            linearisation = None
    return Root(x, Outcome.MAX_ITERATIONS, newton.max_iterations, jacobians, size, None)


class _Trial(NamedTuple):
    """An accepted point: its residual, the simplified correction there, that correction's size, the damping used."""

    x: Array
    residual: Array
    correction: Array
    size: float
    damping: float


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
            if correction_size <= max((1.0 - 0.25 * damping) * size, newton.round_off):
                return _Trial(trial, residual, correction, correction_size, damping)
        damping *= 0.5
    return None
