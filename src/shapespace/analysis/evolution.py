"""Time evolution of F(x, dq/dt; p) = 0 by backward differentiation, at fixed or controlled steps, with events."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from shapespace.analysis.bdf import derivative_weights, error_factor, extrapolation_weights
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, Rate
from shapespace.numerics.newton import Newton, Root, solve_root

START_LIMIT = 4.0**7
"""How much longer than asked the first step may be where Newton needs it."""

MEMORY = 4
"""Moments that are remembered: their cubic predicts the next state, whatever the order of differentiation."""

STEP_NEWTON = Newton(max_iterations=12, min_damping=1.0 / 32.0)
"""Patience of a time step: where Newton needs more, a shorter step is cheaper."""


@dataclass(frozen=True)
class Stepping:
    """Options of time stepping.

    order: of the backward differentiation; 1 is backward Euler. fixed_step: 0 for error control at `tolerance` (local
    error of the stored quantities per step, relative), else the step length. first_step: the first, which no estimate can
    control. min_step: below it the run ends in step-underflow. max_growth: largest ratio of successive steps; beyond
    1.53 order 3 is not stable. stationary_rate: largest relative rate of change of a state that counts as stationary.
    """

    order: int = 3
    fixed_step: float = 0.0
    tolerance: float = 1e-4
    first_step: float = 1e-6
    min_step: float = 1e-12
    max_growth: float = 1.5
    stationary_rate: float = 1e-6
    max_steps: int = 20_000

    def __post_init__(self) -> None:
        if self.order not in (1, 2, 3):
            raise ValueError(f"order must be 1, 2 or 3; got {self.order}.")
        if self.fixed_step < 0.0 or not self.tolerance > 0.0:
            raise ValueError("fixed_step must be >= 0 and tolerance > 0.")


@dataclass(frozen=True)
class Moment:
    """A state in time, on its own discretisation. step: the step that led here; next_step: the one to try next."""

    time: float
    problem: AbstractProblem
    x: Array
    step: float = 0.0
    next_step: float = 0.0
    rate: Rate | None = None
    iterations: int = 0
    jacobians: int = 0


Event = Callable[[Moment], Outcome | None]
"""Looks at an accepted moment; an outcome ends the evolution there."""


@dataclass
class Evolution:
    """Iterate to get the accepted moments one after another; then `outcome` says why they ended.

    past: the start, or the last moments of an earlier evolution (oldest first), to go on as if never interrupted.
    """

    past: Sequence[Moment]
    p: Array
    until: float
    stepping: Stepping
    newton: Newton = STEP_NEWTON
    events: Sequence[Event] = ()
    outcome: Outcome | None = None
    _times: list[float] = field(default_factory=list)
    _states: list[Array] = field(default_factory=list)
    _stored: list[Array] = field(default_factory=list)
    _linearisation: tuple[AbstractLinearisation, float] | None = None

    def __iter__(self) -> Iterator[Moment]:
        """Accepted moments, not including those of the past."""
        now = self.past[-1]
        problem = now.problem
        self._times = [moment.time for moment in reversed(self.past)]
        self._states = [moment.problem.carried(moment.x, problem) for moment in reversed(self.past)]
        self._stored = [problem.stored(x, self.p) for x in self._states]
        step = now.next_step or self.stepping.fixed_step or self.stepping.first_step
        for _ in range(self.stepping.max_steps):
            if self._at_end():
                break
            accepted = self._advance(problem, step)
            if accepted is None:
                return
            now, step = accepted, accepted.next_step
            yield now
            self.outcome = self._ending(now)
            if self.outcome is not None:
                return
            problem = self._adapt(problem)
        self.outcome = Outcome.REACHED_END if self._at_end() else Outcome.MAX_STEPS

    def _at_end(self) -> bool:
        return self._times[0] >= self.until * (1.0 - 1e-14)

    def _advance(self, problem: AbstractProblem, step: float) -> Moment | None:
        """Try steps until one is accepted; None and an outcome where the step falls below its minimum."""
        options = self.stepping
        while step >= options.min_step:
            trial, proposed = self._within(step), step
            order = min(options.order, len(self._times))
            if len(self._times) == 1 and not options.fixed_step:
                trial, root, rate = self._start(problem, trial)
            else:
                root, rate = self._solve(problem, trial, order)
            if root.outcome is not Outcome.CONVERGED:
                if options.fixed_step or len(self._times) == 1:
                    break
                step = 0.25 * trial
                continue
            stored = problem.stored(root.x, self.p)
            factor = 1.0
            if len(self._times) > 1 and not options.fixed_step:
                error = self._local_error(problem, trial, order, stored) / options.tolerance
                factor = float(np.clip(0.85 * max(error, 1e-10) ** (-1.0 / (order + 1)), 0.2, options.max_growth))
                if error > 1.0:
                    step = min(factor, 0.7) * trial
                    continue
            next_step = max(factor * trial, proposed) if trial < proposed else factor * trial
            moment = Moment(
                self._times[0] + trial, problem, root.x, trial, next_step, rate, root.iterations, root.jacobians
            )
            self._remember(moment, stored)
            return moment
        self.outcome = Outcome.STEP_UNDERFLOW
        return None

    def _start(self, problem: AbstractProblem, step: float) -> tuple[float, Root, Rate]:
        """The first step, which may leave a singular state: a flat disc buckles as the root of time.

        Newton then fails at small steps from that state, but not at larger ones, from which smaller ones are reached.
        """
        length, largest = step, min(START_LIMIT * step, self.until - self._times[0])
        root, rate = self._solve(problem, length, 1)
        while root.outcome is not Outcome.CONVERGED and length < largest:
            length = min(4.0 * length, largest)
            root, rate = self._solve(problem, length, 1)
        while root.outcome is Outcome.CONVERGED and length > step:
            shorter = max(0.25 * length, step)
            found = self._solve(problem, shorter, 1, root.x)
            if found[0].outcome is not Outcome.CONVERGED:
                break
            length, (root, rate) = shorter, found
        if root.outcome is not Outcome.CONVERGED:
            length = step
        while root.outcome is not Outcome.CONVERGED and length >= self.stepping.min_step:
            length *= 0.25
            root, rate = self._solve(problem, length, 1)
        return length, root, rate

    def _within(self, step: float) -> float:
        """The step, shortened to land on `until`, or halved where it would leave a sliver before it."""
        left = self.until - self._times[0]
        if step >= left * (1.0 - 1e-10):
            return left
        return 0.5 * left if not self.stepping.fixed_step and step > 0.6 * left else step

    def _solve(
        self, problem: AbstractProblem, step: float, order: int, guess: Array | None = None
    ) -> tuple[Root, Rate]:
        """Solve one backward-differentiation step, from the extrapolated guess unless another is given."""
        time = self._times[0] + step
        weights = derivative_weights(np.array([time, *self._times[:order]]))
        history = sum((w * q for w, q in zip(weights[1:], self._stored, strict=False)), np.zeros_like(self._stored[0]))
        rate = Rate(float(weights[0]), history)
        points = min(MEMORY, len(self._times))
        extrapolation = extrapolation_weights(time, np.array(self._times[:points]))
        if guess is None:
            guess = sum((w * x for w, x in zip(extrapolation, self._states, strict=False)), 0.0 * self._states[0])
        known = None
        if self._linearisation is not None and abs(self._linearisation[1] / rate.coefficient - 1.0) < 0.2:
            known = self._linearisation[0]
        newton = Newton(self.newton.tolerance) if len(self._times) == 1 else self.newton
        root = solve_root(problem, guess, self.p, rate, newton, known)
        if root.outcome is not Outcome.CONVERGED and points > 1:
            root = solve_root(problem, self._states[0], self.p, rate, newton)
        if root.linearisation is not None and root.jacobians > 0:
            self._linearisation = (root.linearisation, rate.coefficient)
        return root, rate

    def _local_error(self, problem: AbstractProblem, step: float, order: int, stored: Array) -> float:
        """Estimated local error of the stored quantities, from the predictor through as many moments as there are."""
        order = min(order, len(self._times) - 1)
        time = self._times[0] + step
        weights = extrapolation_weights(time, np.array(self._times[: order + 1]))
        predicted = sum((w * q for w, q in zip(weights, self._stored, strict=False)), np.zeros_like(stored))
        factor = error_factor(time, np.array(self._times), order)
        return factor * problem.stored_norm(stored - predicted, stored)

    def _remember(self, moment: Moment, stored: Array) -> None:
        self._times = [moment.time, *self._times][:MEMORY]
        self._states = [moment.x, *self._states][:MEMORY]
        self._stored = [stored, *self._stored][:MEMORY]

    def _ending(self, now: Moment) -> Outcome | None:
        """Why to stop at this moment, if anything says so."""
        for event in self.events:
            if (outcome := event(now)) is not None:
                return outcome
        change = now.problem.stored_norm(self._stored[0] - self._stored[1], self._stored[0])
        if change <= self.stepping.stationary_rate * now.step:
            return Outcome.STATIONARY
        return None

    def _adapt(self, problem: AbstractProblem) -> AbstractProblem:
        """Move to a better discretisation where the problem asks for one, and take the history along."""
        better = problem.adapted(self._states[0])
        if better is not problem:
            self._states = [problem.carried(x, better) for x in self._states]
            self._stored = [better.stored(x, self.p) for x in self._states]
            self._linearisation = None
        return better
