"""How observables and the outline of a state at rest change with the parameters: derivatives by the adjoint.

Along a family of states F(x; p) = 0 an observable O(x; p) changes with a key q, on which p depends, as

    dO/dq = (O_p - y^T F_p) p'(q),   F_x^T y = O_x^T,

with one solve of the transposed Jacobian for each observable, by the factors that Newton's method uses, however many keys
there are. These are the derivatives of the discretised problem on the mesh that the state has: exact but for round-off.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationLinearisation, CollocationProblem
from shapespace.numerics.state import State
from shapespace.study.engine import Engine
from shapespace.study.keyed import make_powers, powers_of
from shapespace.study.keys import nearest
from shapespace.study.measures import blank_row, slope_at, value_at
from shapespace.study.observables import PEAKS, combined, energy_law, neck, readings
from shapespace.study.scenario import Scenario
from shapespace.variational.ledger import densities
from shapespace.variational.surface import SurfaceSystem


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of a state x at rest by keys of its scenario, each with all others as they are given."""

    scenario: Scenario
    engine: Engine
    x: Array

    def of_observables(self, names: Sequence[str], keys: Sequence[str]) -> dict[str, dict[str, float]]:
        """d(observable)/d(key) in the scenario's units, by observable and key; of all observables where none is named.

        InputError for a name that this state does not report, a key that is no parameter, and where the Jacobian is singular.
        """
        system, p, size = self.engine.system, jnp.asarray(self.engine.p), len(self.x)
        parts = self._parts
        known = _reported(system, parts, p)
        for name in names:
            if name not in known:
                raise InputError(
                    f"{name}: is no observable of this state with a derivative; the nearest one is {nearest(name, known)}."
                )
        chosen = tuple(dict.fromkeys(names)) or tuple(known)

        def stacked(parts: Mapping[str, Any], p: Any) -> Any:
            values = _reported(system, parts, p)
            return jnp.stack([jnp.asarray(values[name]) for name in chosen])

        by_parts, by_p = jax.jacrev(stacked, argnums=(0, 1))(parts, p)
        rows, direct = np.zeros((len(chosen), size)), np.array(by_p)
        for name, (by_x, also_by_p) in _slopes_of_parts(self.engine, self.x, parts).items():
            weights = np.asarray(by_parts[name]).reshape(len(chosen), -1)
            rows += weights @ by_x
            direct += weights @ also_by_p
        values = np.array([float(known[name]) for name in chosen])
        slopes = self._along(rows, direct, values, keys, lambda one: np.array([*map(one.scales.factor, chosen)]))
        return {name: dict(zip(keys, row.tolist(), strict=True)) for name, row in zip(chosen, slopes, strict=True)}

    def of_outline(self, u: Array, keys: Sequence[str]) -> Array:
        """d(r, z)/d(key) (m, 2, n_keys) of the points (m,) of the outline at u in [0, 1], in the scenario's units."""
        base = self.engine.problem
        read = [value_at(base, self.x, name, float(at)) for at in np.ravel(u) for name in ("r", "z")]
        values, rows = np.array([value for value, _ in read]), np.array([row for _, row in read])
        direct, count = np.zeros((len(rows), len(self.engine.p))), len(rows)
        slopes = self._along(rows, direct, values, keys, lambda one: np.full(count, one.scales.factor("radius")))
        return slopes.reshape(-1, 2, len(keys))

    def _along(
        self, rows: Array, direct: Array, values: Array, keys: Sequence[str], units: Callable[[Scenario], Array]
    ) -> Array:
        """The derivatives (m, n_keys) of values (m,) in their units by each key, from those by x (m, size) and p (m, n_p)."""
        adjoint = np.stack([self._linearisation.solve_transposed(row) for row in rows])
        total, out = direct - adjoint @ self._by_parameters, np.empty((len(rows), len(keys)))
        one = np.ones(1)
        for i, key in enumerate(keys):
            powers, unit = make_powers(self.scenario, (key,)), powers_of(self.scenario, (key,), units)
            q = np.array([float(self.scenario.values()[key])])
            out[:, i] = unit.value(q) * (total @ powers.slope(q, one)) + unit.slope(q, one) * values
        return out

    @cached_property
    def _linearisation(self) -> CollocationLinearisation:
        problem, p = self.engine.problem, self.engine.p
        _, found = problem.linearise(self.x, p, REST)
        if found.is_singular:
            raise InputError(
                "this state is a fold or branch point: it has no derivative by parameters; choose another."
            )
        return found

    @cached_property
    def _by_parameters(self) -> Array:
        """F_p (size, n_p)."""
        problem, p, still = self.engine.problem, self.engine.p, np.zeros_like(self.x)
        return np.stack([problem.derivative(self.x, p, still, one) for one in np.eye(len(p))], axis=1)

    @cached_property
    def _parts(self) -> dict[str, Any]:
        """What the observables are combined from, as `observables.measure` does."""
        problem, p = self.engine.problem, self.engine.p
        integrals, peaks = problem.integrals(densities, self.x, p, REST)
        read = readings(self.engine.system, problem.unpack(self.x))
        parts = integrals | {name: peaks[name] for name in PEAKS} | read
        return {name: jnp.asarray(value) for name, value in parts.items()}


def _reported(system: SurfaceSystem, parts: Mapping[str, Any], p: Any) -> dict[str, Any]:
    """Observables at rest; those that tell of the error of the solution have no derivative."""
    values = combined(system, parts, p)
    return values | energy_law(values, 0.0)


def _slopes_of_parts(engine: Engine, x: Array, parts: Mapping[str, Any]) -> dict[str, tuple[Array, Array]]:
    """Of each part of the observables its derivatives by x (m, size) and directly by p (m, n_p), m its components."""
    problem, system = engine.problem, engine.system
    state, none = problem.unpack(x), np.zeros(len(engine.p))
    sums, peaks = problem.integral_slopes(densities, x, engine.p)
    found = {
        name: (by_x[None], by_p[None]) for name, (by_x, by_p) in (sums | {one: peaks[one] for one in PEAKS}).items()
    }
    read: dict[str, list[Array]] = {
        "first": [value_at(problem, x, name, 0.0)[1] for name in system.fields],
        "last": [value_at(problem, x, name, 1.0)[1] for name in system.fields],
        "scalars": [*np.eye(len(x))[len(x) - len(system.scalars) :]],
        "equator_radius": [value_at(problem, x, "r", 0.5)[1]],
    }
    # Where r is smallest, and c largest, moving the place changes nothing to first order.
    if (narrowest := neck(state, system.fields.index("r"))) is not None:
        read["neck_radius"] = [value_at(problem, x, "r", narrowest[0])[1]]
    if "gamma_pole" in parts:
        read["gamma_pole"] = [_algebraic_at(problem, state, "gamma", 0.0)]
    if "poles" in parts:
        read["poles"] = [slope_at(problem, x, "psi", u)[1] for u in (0.0, 1.0)]
    if "ring_position" in parts:
        place = float(parts["ring_position"])
        read["max_concentration"] = [value_at(problem, x, "c", place)[1]]
        read["ring_position"] = [place_moves(problem, x, state, "c", place)]
    return found | {name: (np.array(rows), np.tile(none, (len(rows), 1))) for name, rows in read.items()}


def _algebraic_at(problem: CollocationProblem, state: State, name: str, u: float) -> Array:
    """The gradient of an algebraic field at u."""
    gradient, (element, share) = blank_row(problem), state.place(u)
    column = problem.system.algebraic.index(name)
    gradient.algebraic[element, :, column] = state.rule.basis(np.array([share]))[0]
    return problem.pack(gradient)


def place_moves(problem: CollocationProblem, x: Array, state: State, name: str, u: float) -> Array:
    """The gradient of where a field has its largest value, du = -dy'(u)/y''(u); it stays at an end, and of an even field."""
    (element, share), rule = state.place(u), state.rule
    values = state.slopes[element, :, problem.system.fields.index(name)]
    slopes = np.polynomial.Polynomial.fit(rule.points, values, rule.degree - 1, domain=[0.0, 1.0])
    bend = float(slopes.deriv()(share)) / state.widths[element]
    row = slope_at(problem, x, name, u)[1]
    return -row / bend if 0.0 < u < 1.0 and bend < 0.0 else np.zeros_like(row)
