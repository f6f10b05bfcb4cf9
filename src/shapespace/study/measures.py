"""Observables as measures: numbers that a branch can be held at or stopped at, with their derivatives by the state."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shapespace.analysis.extended import AbstractMeasure
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.problem import AbstractContinuableProblem
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.engine import Engine
from shapespace.study.gradients import gradients, reported
from shapespace.study.keyed import HeldProblem, KeyedProblem
from shapespace.study.keys import nearest
from shapespace.study.observables import largest_value, neck
from shapespace.study.rows import Linear, slope_at, value_at
from shapespace.study.scenario import Scenario


@dataclass(frozen=True)
class Observable(AbstractMeasure):
    """An observable in the scenario's units, `unit` being the value of a dimensionless one. NaN where it does not apply."""

    name: str
    unit: float

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        assert isinstance(problem, KeyedProblem | HeldProblem)
        keyed, state, q = _keyed(problem, x, p)
        if self.name in READ:
            return self.unit * READ[self.name](keyed.base, state)[0]
        return self.unit * reported(keyed.base, state, keyed.powers.value(q)).get(self.name, float("nan"))

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        assert isinstance(problem, KeyedProblem | HeldProblem)
        keyed, state, q = _keyed(problem, x, p)
        by_q = np.zeros_like(q)
        if self.name in READ:
            row = self.unit * READ[self.name](keyed.base, state)[1]
        else:
            found = gradients(keyed.base, state, keyed.powers.value(q), (self.name,))
            row = self.unit * found.by_x[0]
            slopes = [keyed.powers.slope(q, unit) for unit in np.eye(len(q))]
            by_q = self.unit * np.array([found.by_p[0] @ slope for slope in slopes])
        if isinstance(problem, KeyedProblem):
            return row, by_q
        # The key that answers is the last unknown, and the parameter in its place is what is held.
        answer = by_q[problem.index]
        by_q[problem.index] = 0.0
        return np.append(row, answer), by_q


def _keyed(problem: KeyedProblem | HeldProblem, x: Array, p: Array) -> tuple[KeyedProblem, Array, Array]:
    """The problem in keys, its state and the values of the keys."""
    return (problem, x, p) if isinstance(problem, KeyedProblem) else (problem.inner, *problem.split(x, p))


def make_observable(scenario: Scenario, name: str, key: str) -> Observable:
    """The measure of an observable while a key varies. InputError where it cannot be held, or the key changes its unit."""
    names = observed_names(scenario)
    if name not in names:
        what = "is a parameter, and stays as it is" if name in scenario.values() else "is no observable"
        raise InputError(f"{name}: {what}; the nearest observable is {nearest(name, names)}.")
    unit = scenario.scales.factor(name)
    value = float(scenario.values()[key])
    if scenario.with_overrides({key: 0.5 * value if value else 0.5}).scales.factor(name) != unit:
        raise InputError(f"{key}: changes the unit of {name}; choose another key to vary or free.")
    return Observable(name, unit)


def observed_names(scenario: Scenario) -> tuple[str, ...]:
    """Observables of the scenario's states that have derivatives."""
    engine = Engine.of(scenario)
    known = reported(engine.problem, engine.problem.pack(engine.initial_state()), engine.p)
    return tuple(dict.fromkeys((*known, "neck_radius")))


def _scalar(name: str) -> Callable[[CollocationProblem, Array], Linear]:
    def measured(base: CollocationProblem, x: Array) -> Linear:
        place = len(x) - len(base.system.scalars) + base.system.scalars.index(name)
        row = np.zeros_like(x)
        row[place] = 1.0
        return float(x[place]), row

    return measured


def _height(base: CollocationProblem, x: Array) -> Linear:
    (first, one), (last, other) = (value_at(base, x, "z", u) for u in (0.0, 1.0))
    return first - last, one - other


def _neck(base: CollocationProblem, x: Array) -> Linear:
    """r where it is smallest, so that moving the place changes nothing to first order."""
    found = neck(base.unpack(x), base.system.fields.index("r"))
    return (float("nan"), np.zeros_like(x)) if found is None else (found[1], value_at(base, x, "r", found[0])[1])


def _largest_concentration(base: CollocationProblem, x: Array) -> Linear:
    place, value = largest_value(base.unpack(x), base.system.fields.index("c"))
    return value, value_at(base, x, "c", place)[1]


def _polarity(base: CollocationProblem, x: Array) -> Linear:
    """1 - psi'(0)/psi'(1)."""
    (first, one), (last, other) = (slope_at(base, x, "psi", u) for u in (0.0, 1.0))
    return 1.0 - first / last, (first / last * other - one) / last


READ: dict[str, Callable[[CollocationProblem, Array], Linear]] = {
    "height": _height,
    "neck_radius": _neck,
    "equator_radius": lambda base, x: value_at(base, x, "r", 0.5),
    "length": _scalar("h"),
    "pressure": _scalar("p"),
    "velocity": _scalar("v0"),
    "polarity": _polarity,
    "max_concentration": _largest_concentration,
}
"""Those that are read off a state at a few places, which costs less than the integrals of `gradients`."""
