"""The dynamics of a scenario: frames of accepted time steps, and why they ended."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from shapespace.analysis.bdf import derivative_weights
from shapespace.analysis.evolution import Evolution, Moment, Stepping
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.engine import Engine, state_of
from shapespace.study.frame import Frame
from shapespace.study.observables import FLOWS, energy_law, measure, shape_end
from shapespace.study.scenario import Scenario

ORDER = 3
"""Of the adaptive method; against 2 it needs a third fewer steps at the same tolerance, and is no less stable here."""

_OF_A_STEP = (*FLOWS, "boundary_residual")
"""Observables that a state has only where it was solved for."""


class Simulation:
    """Iterate for the frames of a scenario; afterwards `outcome` says why they ended.

    history: the last frames of a stored run, to go on from. Without them the first frame is the start: a state that is
    given, or the scenario's initial one.
    """

    def __init__(self, scenario: Scenario, history: Sequence[Frame] = (), start: Frame | None = None) -> None:
        self.scenario = scenario
        self.history = list(history)
        self.start = start
        self.outcome = Outcome.REACHED_END
        self._engine = Engine.of(scenario)
        self._order = 1 if self._engine.values["dt"] > 0.0 else ORDER
        self._energies: list[tuple[float, float]] = []

    def __iter__(self) -> Iterator[Frame]:
        """Frames one by one, each after its step was accepted."""
        engine, time_scale = self._engine, self.scenario.scales.factor("time")
        if self.history:
            past = [self._moment(frame) for frame in self.history]
            unit = self.scenario.scales.factor("energy")
            self._energies = [(frame.time / time_scale, frame.observables["energy"] / unit) for frame in self.history]
        else:
            state = engine.initial_state() if self.start is None else state_of(self.start)
            past = [Moment(0.0, *engine.placed(state))]
            yield self._frame(past[0], resting=True)
        run = engine.values
        stepping = Stepping(
            order=self._order,
            fixed_step=run["dt"],
            tolerance=run["time_tolerance"],
            stationary_rate=run["stationary_rate"],
            max_steps=self.scenario.run.max_steps,
        )
        evolution = Evolution(past, engine.p, run["until"], stepping, events=(_shape_event,))
        for moment in evolution:
            yield self._frame(moment)
        self.outcome = evolution.outcome or Outcome.REACHED_END

    def _moment(self, frame: Frame) -> Moment:
        """The moment of a stored frame."""
        scale = self.scenario.scales.factor("time")
        problem = self._engine.problem.on_mesh(frame.mesh)
        return Moment(
            frame.time / scale, problem, problem.pack(state_of(frame)), frame.step / scale, frame.next_step / scale
        )

    def _frame(self, moment: Moment, resting: bool = False) -> Frame:
        """Everything to store of a moment; the initial state has no rates yet."""
        problem = moment.problem
        assert isinstance(problem, CollocationProblem)
        engine = replace(self._engine, problem=problem)
        rate = moment.rate or Rate(0.0, np.zeros_like(problem.stored(moment.x, engine.p)))
        values = measure(engine, moment.x, rate)
        values |= self._energy_law(moment.time, values)
        if resting:
            values = {name: value for name, value in values.items() if name not in _OF_A_STEP}
        state, scales = problem.unpack(moment.x), self.scenario.scales
        return Frame(
            time=moment.time * scales.factor("time"),
            step=moment.step * scales.factor("time"),
            next_step=moment.next_step * scales.factor("time"),
            mesh=state.mesh,
            nodes=state.nodes,
            slopes=state.slopes,
            algebraic=state.algebraic,
            scalars=state.scalars,
            rates=problem.rates(moment.x, engine.p, rate)[..., :2],
            observables={name: value * scales.factor(name) for name, value in values.items()},
        )

    def _energy_law(self, time: float, values: dict[str, float]) -> dict[str, float]:
        """dF/dt by the differences that the step itself used, and the rest of the energy law."""
        self._energies = [*self._energies, (time, values["energy"])][-(self._order + 1) :]
        if len(self._energies) < 2:
            return {}
        times, energies = (np.array(column)[::-1] for column in zip(*self._energies, strict=True))
        return energy_law(values, float(derivative_weights(times) @ energies))


def _shape_event(moment: Moment) -> Outcome | None:
    """Where no physical shape lies beyond."""
    assert isinstance(moment.problem, CollocationProblem)
    return shape_end(moment.problem, moment.x)
