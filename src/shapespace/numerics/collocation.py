"""Gauss collocation of an AbstractSystem: residual, structured Jacobian and stored quantities on a given mesh."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, Rate
from shapespace.numerics import condensation
from shapespace.numerics.adaptation import adapted_mesh
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.state import State
from shapespace.numerics.system import AbstractSystem

RELATIVE_FLOOR = 1.0
"""Fields and scalars smaller than this are measured absolutely in norms; problems are dimensionless and of order one."""


def _stage_values(widths: Traced, nodes: Traced, slopes: Traced) -> Traced:
    matrix = gauss_rule(slopes.shape[1]).matrix
    return nodes[:-1, None] + widths[:, None, None] * jnp.einsum("jl,eln->ejn", matrix, slopes)


def _point_rows(system: AbstractSystem, v: Traced, history: Traced, coefficient: Traced, u: Traced, p: Traced) -> Traced:
    """Equations and integrands at one point as a function of v = (slope, algebraic, field, scalars)."""
    n, n_a = len(system.fields), len(system.algebraic)
    dy, a, y, s = v[:n], v[n : n + n_a], v[n + n_a : 2 * n + n_a], v[2 * n + n_a :]
    dq = coefficient * system.stored(y, s) + history
    return jnp.concatenate([system.equations(dy, y, a, s, dq, u, p), system.integrands(dy, y, a, s, u, p)])


def _end_rows(system: AbstractSystem, v: Traced, history: Traced, coefficient: Traced, p: Traced) -> Traced:
    n = len(system.fields)
    y0, y1, s = v[:n], v[n : 2 * n], v[2 * n :]
    dq0 = coefficient * system.stored(y0, s) + history[0]
    dq1 = coefficient * system.stored(y1, s) + history[1]
    return system.end_conditions(y0, y1, s, dq0, dq1, p)


def _arguments(nodes: Traced, slopes: Traced, algebraic: Traced, scalars: Traced, widths: Traced) -> tuple[Traced, Traced]:
    """Point arguments (N k, 2n + n_a + n_s) and end arguments (2n + n_s,)."""
    values = _stage_values(widths, nodes, slopes)
    points = slopes.shape[0] * slopes.shape[1]
    spread = jnp.broadcast_to(scalars, (points, scalars.shape[0]))
    flat = [x.reshape(points, x.shape[2]) for x in (slopes, algebraic, values)]
    return jnp.concatenate([*flat, spread], axis=1), jnp.concatenate([nodes[0], nodes[-1], scalars])


@partial(jax.jit, static_argnums=0)
def _residual(system: AbstractSystem, parts: Any, history: Any, coefficient: Traced, p: Traced) -> tuple[Traced, ...]:
    points, ends, widths, stage_u = _points(parts)
    rows = jax.vmap(lambda v, q, u: _point_rows(system, v, q, coefficient, u, p))(points, history[0], stage_u)
    return rows, _end_rows(system, ends, history[1], coefficient, p), system.targets(parts[4], p)


@partial(jax.jit, static_argnums=0)
def _linearised(system: AbstractSystem, parts: Any, history: Any, coefficient: Traced, p: Traced) -> tuple[Traced, ...]:
    points, ends, widths, stage_u = _points(parts)

    def rows(v: Traced, q: Traced, u: Traced) -> tuple[Traced, Traced]:
        value = _point_rows(system, v, q, coefficient, u, p)
        return value, value

    # Points run along the last axis, in the order (stage, element), which is what the elimination vectorises over.
    jacobian, value = jax.vmap(jax.jacfwd(rows, has_aux=True), out_axes=(-1, 0))(points, history[0], stage_u)
    jacobian = jacobian.reshape(*jacobian.shape[:2], *parts[2].shape[:2]).swapaxes(2, 3)
    end_jacobian = jax.jacfwd(lambda v: _end_rows(system, v, history[1], coefficient, p))(ends)
    end_value = _end_rows(system, ends, history[1], coefficient, p)
    target_jacobian = jax.jacfwd(lambda s: system.targets(s, p))(parts[4])
    return value, end_value, system.targets(parts[4], p), jacobian, end_jacobian, target_jacobian


def _points(parts: Any) -> tuple[Traced, Traced, Traced, Traced]:
    mesh, nodes, slopes, algebraic, scalars = parts
    widths = mesh[1:] - mesh[:-1]
    points, ends = _arguments(nodes, slopes, algebraic, scalars, widths)
    stage_u = mesh[:-1, None] + widths[:, None] * gauss_rule(slopes.shape[1]).points
    return points, ends, widths, stage_u.ravel()


@partial(jax.jit, static_argnums=(0, 1))
def _integrals(
    system: AbstractSystem, density: Callable[..., dict[str, Traced]], parts: Any, history: Any, c: Traced, p: Traced
) -> tuple[dict[str, Traced], dict[str, Traced]]:
    """Integrals of named densities, and their largest values among the Gauss points."""
    points, _, widths, _ = _points(parts)
    n, n_a = len(system.fields), len(system.algebraic)

    def at(v: Traced, q: Traced) -> dict[str, Traced]:
        dy, a, y, s = v[:n], v[n : n + n_a], v[n + n_a : 2 * n + n_a], v[2 * n + n_a :]
        return density(system, dy, y, a, s, c * system.stored(y, s) + q, p)

    values = jax.vmap(at)(points, history[0])
    weights = (widths[:, None] * gauss_rule(parts[2].shape[1]).weights).ravel()
    return {name: weights @ x for name, x in values.items()}, {name: x.max() for name, x in values.items()}


@partial(jax.jit, static_argnums=0)
def _stored(system: AbstractSystem, parts: Any) -> Traced:
    points, ends, _, _ = _points(parts)
    n, n_a = len(system.fields), len(system.algebraic)
    at_stages = jax.vmap(lambda v: system.stored(v[n + n_a : 2 * n + n_a], v[2 * n + n_a :]))(points)
    at_ends = [system.stored(ends[:n], ends[2 * n :]), system.stored(ends[n : 2 * n], ends[2 * n :])]
    return jnp.concatenate([at_stages, jnp.stack(at_ends)])


@dataclass(frozen=True)
class CollocationLinearisation(AbstractLinearisation):
    """The factorised Jacobian of a CollocationProblem."""

    problem: "CollocationProblem"
    factors: condensation.Factors

    @property
    def is_singular(self) -> bool:
        """A pivot vanished or is not finite."""
        return self.factors.singular

    def solve(self, residual: Array) -> Array:
        """J dx = residual."""
        problem = self.problem
        n_stage = problem.elements * problem.degree * problem.n_rows
        n_chain = problem.elements * problem.n
        stage_rows = residual[:n_stage].reshape(problem.elements, problem.degree, problem.n_rows)
        rhs = condensation.Update(
            residual[n_stage : n_stage + n_chain].reshape(problem.elements, problem.n),
            np.ascontiguousarray(stage_rows.transpose(1, 2, 0)),
            residual[n_stage + n_chain :],
        )
        nodes, stages, scalars = condensation.solve(self.factors, rhs)
        stages = stages.transpose(2, 0, 1)
        return np.concatenate(
            [nodes.ravel(), stages[..., : problem.n].ravel(), stages[..., problem.n :].ravel(), scalars]
        )


@dataclass(frozen=True)
class CollocationProblem(AbstractProblem):
    """An AbstractSystem on a mesh with k Gauss points per element; x packs nodes, slopes, algebraic fields and scalars."""

    system: AbstractSystem
    mesh: Array
    degree: int
    n_integrals: int
    tolerance: float = 1e-6

    @property
    def elements(self) -> int:
        """Number of elements N."""
        return len(self.mesh) - 1

    @property
    def n(self) -> int:
        """Number of differential fields."""
        return len(self.system.fields)

    @property
    def n_rows(self) -> int:
        """Equations per point, n + n_a."""
        return self.n + len(self.system.algebraic)

    @cached_property
    def _widths(self) -> Array:
        return np.diff(self.mesh)

    def pack(self, state: State) -> Array:
        """x (size,) of a state on this mesh."""
        return np.concatenate(
            [state.nodes.ravel(), state.slopes.ravel(), state.algebraic.ravel(), state.scalars]
        )

    def unpack(self, x: Array) -> State:
        """The state of x (size,)."""
        elements, k, n, n_a = self.elements, self.degree, self.n, len(self.system.algebraic)
        a = (elements + 1) * n
        b = a + elements * k * n
        c = b + elements * k * n_a
        nodes, slopes = x[:a].reshape(-1, n), x[a:b].reshape(elements, k, n)
        return State(self.mesh, nodes, slopes, x[b:c].reshape(elements, k, n_a), x[c:])

    def _parts(self, state: State) -> tuple[Array, ...]:
        return state.mesh, state.nodes, state.slopes, state.algebraic, state.scalars

    def _history(self, rate: Rate) -> tuple[Array, Array]:
        n_q = len(rate.history) // (self.elements * self.degree + 2)
        history = rate.history.reshape(-1, n_q)
        return history[:-2], history[-2:]

    def _flat_residual(self, state: State, rows: Array, ends: Array, targets: Array) -> Array:
        rule = gauss_rule(self.degree)
        rows = rows.reshape(self.elements, self.degree, -1)
        increments = self._widths[:, None] * np.matmul(rule.weights, state.slopes)
        continuity = state.nodes[1:] - state.nodes[:-1] - increments
        integrals = self._widths @ np.matmul(rule.weights, rows[..., self.n_rows :]) - targets
        return np.concatenate([rows[..., : self.n_rows].ravel(), continuity.ravel(), ends, integrals])

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """Equations at the Gauss points, continuity, end conditions, integral conditions."""
        state = self.unpack(x)
        out = _residual(self.system, self._parts(state), self._history(rate), np.float64(rate.coefficient), p)
        return self._flat_residual(state, *(np.asarray(part) for part in out))

    def linearise(self, x: Array, p: Array, rate: Rate) -> tuple[Array, CollocationLinearisation]:
        """Residual and factorised Jacobian."""
        state = self.unpack(x)
        out = _linearised(self.system, self._parts(state), self._history(rate), np.float64(rate.coefficient), p)
        rows, ends, targets, jacobian, end_jacobian, target_jacobian = (np.asarray(part) for part in out)
        rule = gauss_rule(self.degree)
        factors = condensation.factorise(
            self._widths, rule.matrix, rule.weights, jacobian, end_jacobian, target_jacobian, self.n
        )  # fmt: skip
        return self._flat_residual(state, rows, ends, targets), CollocationLinearisation(self, factors)

    def stored(self, x: Array, p: Array) -> Array:
        """q at the Gauss points and at both ends, flattened."""
        return np.asarray(_stored(self.system, self._parts(self.unpack(x)))).ravel()

    def integrals(
        self, density: Callable[..., dict[str, Traced]], x: Array, p: Array, rate: Rate
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Gauss quadrature of density(system, dy, y, a, s, dq, p) over u, by name, and the largest point values."""
        parts = self._parts(self.unpack(x))
        out = _integrals(self.system, density, parts, self._history(rate), np.float64(rate.coefficient), p)
        sums, peaks = ({name: float(value) for name, value in part.items()} for part in out)
        return sums, peaks

    def rates(self, x: Array, p: Array, rate: Rate) -> Array:
        """dq/dt at the Gauss points, (N, k, n_q)."""
        dq = rate.coefficient * self.stored(x, p) + rate.history
        n_q = len(dq) // (self.elements * self.degree + 2)
        return np.asarray(dq.reshape(-1, n_q)[:-2].reshape(self.elements, self.degree, n_q))

    def norm(self, dx: Array, x: Array) -> float:
        """Largest change of any nodal field, algebraic field or scalar relative to that field's largest value (or one)."""
        change, state = self.unpack(dx), self.unpack(x)
        sizes = [_relative(change.nodes, state.nodes), _relative(change.algebraic, state.algebraic)]
        increments = self._widths[:, None, None] * change.slopes
        scale = np.maximum(np.abs(state.nodes).max(axis=0), RELATIVE_FLOOR)
        sizes += [float(np.max(np.abs(increments) / scale)), _relative(change.scalars[None], state.scalars[None])]
        return max(sizes)

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Largest change of any stored quantity relative to its largest value (or one)."""
        shape = (self.elements * self.degree + 2, -1)
        return _relative(dq.reshape(shape), q.reshape(shape))

    def adapted(self, x: Array) -> "CollocationProblem":
        """On a mesh that follows x, refined to the next size where the estimated error exceeds the tolerance."""
        mesh = adapted_mesh(self.unpack(x), self.tolerance)
        return self if mesh is self.mesh else self.on_mesh(mesh)

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """x on the mesh of another problem with the same system."""
        assert isinstance(other, CollocationProblem)
        return other.pack(self.unpack(x).on_mesh(other.mesh))

    def on_mesh(self, mesh: Array) -> "CollocationProblem":
        """The same problem on another mesh."""
        return replace(self, mesh=mesh)


def _relative(change: Array, values: Array) -> float:
    """max over fields of max|change| / max(max|value|, floor); fields run along the last axis."""
    if change.size == 0:
        return 0.0
    axes = tuple(range(change.ndim - 1))
    scale = np.maximum(np.abs(values).max(axis=axes), RELATIVE_FLOOR)
    return float(np.max(np.abs(change).max(axis=axes) / scale))
