"""States at rest, F(x; p) = 0: from a guess, and from a known state by stepping to other parameters."""

from dataclasses import dataclass, replace

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractContinuableProblem
from shapespace.numerics.newton import Newton, solve_root

STEP_NEWTON = Newton(max_iterations=12, min_damping=1.0 / 32.0)
"""Patience on the way to other parameters: where Newton needs more, a shorter step is cheaper."""
LARGEST_MISS = 0.5
"""How far from its prediction, relative to itself, a state may be that counts as the same one at other parameters."""


@dataclass(frozen=True)
class Stationary:
    """The end of a search for a state at rest; x is the best found where it failed, and p the parameters it belongs to.

    correction: size of the last Newton correction, the error left. residual: max |F_i|. settled: the discretisation
    asks for no more moves.
    """

    problem: AbstractContinuableProblem
    x: Array
    p: Array
    outcome: Outcome
    correction: float
    residual: float
    iterations: int
    settled: bool


def solve_stationary(
    problem: AbstractContinuableProblem, x: Array, p: Array, newton: Newton = Newton(), max_moves: int = 6
) -> Stationary:
    """Solve F(x; p) = 0 from the guess x, moving to better discretisations of the problem, at most `max_moves` times."""
    iterations, moves = 0, 0
    while True:
        root = solve_root(problem, x, p, REST, newton)
        iterations += root.iterations
        converged = root.outcome is Outcome.CONVERGED
        better = problem.adapted(root.x) if converged else problem
        if better is problem or moves == max_moves:
            residual = float(np.abs(problem.residual(root.x, p, REST)).max())
            settled = converged and better is problem
            return Stationary(problem, root.x, p, root.outcome, root.correction, residual, iterations, settled)
        assert isinstance(better, AbstractContinuableProblem)
        x, problem, moves = problem.carried(root.x, better), better, moves + 1


def step_to(
    start: Stationary,
    p: Array,
    newton: Newton = STEP_NEWTON,
    smallest: float = 1e-3,
    largest_miss: float = LARGEST_MISS,
) -> Stationary:
    """The state that a known one becomes at parameters p, along the straight line from its own.

    Each step is predicted by the tangent -F_x^-1 F_p dp, halved where it fails and doubled where it succeeds. Where steps fall
    below the share `smallest` of the way, the search ends as NOT_REACHED with the last state and its parameters. largest_miss:
    of a step from its prediction. A start that is no solution comes back as it is.
    """
    if not start.outcome.is_success:
        return start
    now, done, share = start, 0.0, 1.0
    while done < 1.0:
        share = min(share, 1.0 - done)
        last = share == 1.0 - done
        found = _stepped(now, p if last else start.p + (done + share) * (p - start.p), newton, largest_miss)
        if found is not None:
            now, done, share = found, 1.0 if last else done + share, 2.0 * share
        elif share < 2.0 * smallest:
            return replace(now, outcome=Outcome.NOT_REACHED)
        else:
            share *= 0.5
    return now


def _stepped(now: Stationary, p: Array, newton: Newton, largest_miss: float) -> Stationary | None:
    """The same state at parameters p nearby; None where Newton fails or ends far from the prediction."""
    problem, x = now.problem, now.x
    _, linearisation = problem.linearise(x, now.p, REST)
    if linearisation.is_singular:
        return None
    guess = x - linearisation.solve(problem.derivative(x, now.p, np.zeros_like(x), p - now.p))
    found = solve_stationary(problem, guess, p, newton)
    if found.outcome is not Outcome.CONVERGED:
        return None
    miss = problem.norm(found.problem.carried(found.x, problem) - guess, guess)
    return replace(found, iterations=now.iterations + found.iterations) if miss <= largest_miss else None
