"""How observables and the outline of a state at rest change with the parameters: derivatives by the adjoint.

Along a family of states F(x; p) = 0 an observable O(x; p) changes with a key q, on which p depends, as

    dO/dq = (O_p - y^T F_p) p'(q),   F_x^T y = O_x^T,

with one solve of the transposed Jacobian for each observable, by the factors that Newton's method uses, however many keys
there are. These are the derivatives of the discretised problem on the mesh that the state has: exact but for round-off.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationLinearisation
from shapespace.study.engine import Engine
from shapespace.study.gradients import gradients
from shapespace.study.keyed import make_powers, powers_of
from shapespace.study.rows import value_at
from shapespace.study.scenario import Scenario


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
        found = gradients(self.engine.problem, self.x, self.engine.p, names)

        def units(one: Scenario) -> Array:
            return np.array([one.scales.factor(name) for name in found.names])

        slopes = self._along(found.by_x, found.by_p, found.values, keys, units)
        return {name: dict(zip(keys, row.tolist(), strict=True)) for name, row in zip(found.names, slopes, strict=True)}

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
