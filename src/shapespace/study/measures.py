"""Observables as measures: numbers that a branch can be held at or stopped at, with their derivatives by the state."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shapespace.analysis.extended import AbstractMeasure
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.problem import AbstractContinuableProblem
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.state import State
from shapespace.study.engine import Engine
from shapespace.study.keyed import HeldProblem, KeyedProblem
from shapespace.study.observables import largest_value, neck
from shapespace.study.scenario import Scenario

Linear = tuple[float, Array]
"""A value and its gradient (n,) by x."""


@dataclass(frozen=True)
class Observable(AbstractMeasure):
    """An observable in the scenario's units, `unit` being the value of a dimensionless one. NaN where it does not apply."""

    name: str
    unit: float

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        assert isinstance(problem, KeyedProblem | HeldProblem)
        return self.unit * OBSERVED[self.name](problem.base, problem.surface(x))[0]

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        assert isinstance(problem, KeyedProblem | HeldProblem)
        row = self.unit * OBSERVED[self.name](problem.base, problem.surface(x))[1]
        return np.append(row, np.zeros(len(x) - len(row))), np.zeros_like(p)


def make_observable(scenario: Scenario, name: str, key: str) -> Observable:
    """The measure of an observable while a key varies. InputError where it cannot be held, or the key changes its unit."""
    system = Engine.of(scenario).system
    names = [known for known in OBSERVED if NEEDS.get(known, "h") in (*system.fields, *system.scalars)]
    if name not in names:
        raise InputError(
            f"{name}: is neither a parameter nor an observable to hold; of these choose {', '.join(names)}."
        )
    unit = scenario.scales.factor(name)
    value = float(scenario.values()[key])
    if scenario.with_overrides({key: 2.0 * value if value else 1.0}).scales.factor(name) != unit:
        raise InputError(f"{key}: changes the unit of {name}; choose another key to vary or free.")
    return Observable(name, unit)


def blank_row(base: CollocationProblem) -> State:
    """A gradient to fill in: zero, laid out as a state."""
    return base.unpack(
        np.zeros((base.elements + 1) * base.n + base.elements * base.degree * base.n_rows + len(base.system.scalars))
    )


def value_at(base: CollocationProblem, x: Array, field: str, u: float) -> Linear:
    """A differential field at u."""
    state, gradient, column = base.unpack(x), blank_row(base), base.system.fields.index(field)
    if u == 1.0:
        gradient.nodes[-1, column] = 1.0
        return float(state.nodes[-1, column]), base.pack(gradient)
    element, share = state.place(u)
    gradient.nodes[element, column] = 1.0
    gradient.slopes[element, :, column] = state.widths[element] * state.rule.basis_integral(np.array([share]))[0]
    row = base.pack(gradient)
    return float(row @ x), row


def slope_at(base: CollocationProblem, x: Array, field: str, u: float) -> Linear:
    """The derivative of a differential field at u."""
    state, gradient = base.unpack(x), blank_row(base)
    element, share = state.place(u)
    gradient.slopes[element, :, base.system.fields.index(field)] = state.rule.basis(np.array([share]))[0]
    row = base.pack(gradient)
    return float(row @ x), row


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


OBSERVED: dict[str, Callable[[CollocationProblem, Array], Linear]] = {
    "height": _height,
    "neck_radius": _neck,
    "equator_radius": lambda base, x: value_at(base, x, "r", 0.5),
    "length": _scalar("h"),
    "pressure": _scalar("p"),
    "velocity": _scalar("v0"),
    "polarity": _polarity,
    "max_concentration": _largest_concentration,
}
NEEDS = {"pressure": "p", "velocity": "v0", "polarity": "c", "max_concentration": "c"}
"""The field or scalar that a surface must have for an observable."""
