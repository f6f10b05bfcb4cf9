"""Gauss collocation of an AbstractSystem: residual, structured Jacobian and stored quantities on a given mesh."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, Rate
from shapespace.numerics import condensation
from shapespace.numerics.adaptation import adapted_mesh
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.small_lu import compiled
from shapespace.numerics.state import State
from shapespace.numerics.system import AbstractSystem

Density = Callable[..., dict[str, Traced]]
RELATIVE_FLOOR = 1.0
"""Fields and scalars smaller than this are measured absolutely in norms; problems are dimensionless and of order one."""


class _Points(NamedTuple):
    """What a packed vector x says at the points: rows (N k, 2n + n_a + n_s) of (slope, algebraic, field, scalars)."""

    rows: Traced
    ends: Traced
    u: Traced
    scalars: Traced
    continuity: Traced
    weights: Traced


def _points(system: AbstractSystem, k: int, mesh: Traced, x: Traced) -> _Points:
    """Unpack x = (nodes, slopes, algebraic, scalars) on a mesh and lay it out point by point, element after element."""
    n, n_a, elements = len(system.fields), len(system.algebraic), mesh.shape[0] - 1
    cuts = np.cumsum([(elements + 1) * n, elements * k * n, elements * k * n_a])
    nodes, slopes, algebraic, scalars = jnp.split(x, cuts)
    nodes, slopes = nodes.reshape(-1, n), slopes.reshape(elements, k, n)
    rule, widths = gauss_rule(k), mesh[1:] - mesh[:-1]
    values = nodes[:-1, None] + widths[:, None, None] * jnp.einsum("jl,eln->ejn", rule.matrix, slopes)
    points = elements * k
    spread = jnp.broadcast_to(scalars, (points, scalars.shape[0]))
    flat = (slopes.reshape(points, n), algebraic.reshape(points, n_a), values.reshape(points, n), spread)
    continuity = nodes[1:] - nodes[:-1] - widths[:, None] * jnp.einsum("l,eln->en", rule.weights, slopes)
    return _Points(
        rows=jnp.concatenate(flat, axis=1),
        ends=jnp.concatenate([nodes[0], nodes[-1], scalars]),
        u=(mesh[:-1, None] + widths[:, None] * rule.points).ravel(),
        scalars=scalars,
        continuity=continuity.ravel(),
        weights=(widths[:, None] * rule.weights).ravel(),
    )


def _split_row(system: AbstractSystem, v: Traced) -> tuple[Traced, Traced, Traced, Traced]:
    """(slope, algebraic, field, scalars) of one point."""
    n, n_a = len(system.fields), len(system.algebraic)
    return v[:n], v[n : n + n_a], v[n + n_a : 2 * n + n_a], v[2 * n + n_a :]


def _point_rows(
    system: AbstractSystem, v: Traced, history: Traced, coefficient: Traced, u: Traced, p: Traced
) -> Traced:
    """Equations and integrands at one point as a function of its row v."""
    dy, a, y, s = _split_row(system, v)
    dq = coefficient * system.stored(y, s) + history
    return jnp.concatenate([system.equations(dy, y, a, s, dq, u, p), system.integrands(dy, y, a, s, u, p)])


def _end_rows(system: AbstractSystem, v: Traced, history: Traced, coefficient: Traced, p: Traced) -> Traced:
    """End conditions as a function of (y(0), y(1), scalars)."""
    n = len(system.fields)
    y0, y1, s = v[:n], v[n : 2 * n], v[2 * n :]
    dq0 = coefficient * system.stored(y0, s) + history[0]
    dq1 = coefficient * system.stored(y1, s) + history[1]
    return system.end_conditions(y0, y1, s, dq0, dq1, p)


def _assemble(system: AbstractSystem, points: _Points, rows: Traced, ends: Traced, p: Traced) -> Traced:
    """The flat residual: equations, continuity, end conditions, integral conditions."""
    n_rows = len(system.fields) + len(system.algebraic)
    integrals = points.weights @ rows[:, n_rows:] - system.targets(points.scalars, p)
    return jnp.concatenate([rows[:, :n_rows].ravel(), points.continuity, ends, integrals])


def _residual(
    system: AbstractSystem, k: int, mesh: Traced, x: Traced, history: Traced, coefficient: Traced, p: Traced
) -> Traced:
    points = _points(system, k, mesh, x)
    history = history.reshape(points.rows.shape[0] + 2, -1)
    rows = jax.vmap(lambda v, q, u: _point_rows(system, v, q, coefficient, u, p))(points.rows, history[:-2], points.u)
    return _assemble(system, points, rows, _end_rows(system, points.ends, history[-2:], coefficient, p), p)


def _linearised(
    system: AbstractSystem, k: int, mesh: Traced, x: Traced, history: Traced, coefficient: Traced, p: Traced
) -> tuple[Traced, Traced, Traced, Traced]:
    """The flat residual, and the Jacobian by blocks: points (rows, columns, k, N), ends, targets."""
    points = _points(system, k, mesh, x)
    history = history.reshape(points.rows.shape[0] + 2, -1)

    def rows(v: Traced, q: Traced, u: Traced) -> tuple[Traced, Traced]:
        value = _point_rows(system, v, q, coefficient, u, p)
        return value, value

    def ends(v: Traced) -> Traced:
        return _end_rows(system, v, history[-2:], coefficient, p)

    # Points run along the last axis, in the order (stage, element), which is what the elimination vectorises over.
    jacobian, value = jax.vmap(jax.jacfwd(rows, has_aux=True), out_axes=(-1, 0))(points.rows, history[:-2], points.u)
    jacobian = jacobian.reshape(*jacobian.shape[:2], mesh.shape[0] - 1, k).swapaxes(2, 3)
    flat = _assemble(system, points, value, ends(points.ends), p)
    return flat, jacobian, jax.jacfwd(ends)(points.ends), jax.jacfwd(lambda s: system.targets(s, p))(points.scalars)


def _integrals(
    system: AbstractSystem, k: int, density: Density, mesh: Traced, x: Traced, history: Traced, c: Traced, p: Traced
) -> tuple[dict[str, Traced], dict[str, Traced]]:
    """Integrals of named densities, and their largest values among the Gauss points."""
    points = _points(system, k, mesh, x)
    history = history.reshape(points.rows.shape[0] + 2, -1)

    def at(v: Traced, q: Traced) -> dict[str, Traced]:
        dy, a, y, s = _split_row(system, v)
        return density(system, dy, y, a, s, c * system.stored(y, s) + q, p)

    values = jax.vmap(at)(points.rows, history[:-2])
    return {name: points.weights @ f for name, f in values.items()}, {name: f.max() for name, f in values.items()}


def _stored(system: AbstractSystem, k: int, mesh: Traced, x: Traced) -> Traced:
    """q at the points and at both ends, flat."""
    points, n = _points(system, k, mesh, x), len(system.fields)

    def at(v: Traced) -> Traced:
        _, _, y, s = _split_row(system, v)
        return system.stored(y, s)

    ends = points.ends
    at_ends = [system.stored(ends[:n], ends[2 * n :]), system.stored(ends[n : 2 * n], ends[2 * n :])]
    return jnp.concatenate([jax.vmap(at)(points.rows), jnp.stack(at_ends)]).ravel()


class _Functions(NamedTuple):
    """The functions above, compiled for one system and degree; they compile again for each number of elements."""

    residual: Callable[..., Traced]
    linearised: Callable[..., tuple[Traced, ...]]
    integrals: Callable[..., tuple[dict[str, Traced], dict[str, Traced]]]
    stored: Callable[..., Traced]


@cache
def _functions(system: AbstractSystem, k: int) -> _Functions:
    """Compiled functions of arrays only: looking up a system at each call would cost more than small evaluations."""
    return _Functions(
        residual=jax.jit(partial(_residual, system, k)),
        linearised=jax.jit(partial(_linearised, system, k)),
        integrals=jax.jit(partial(_integrals, system, k), static_argnums=0),
        stored=jax.jit(partial(_stored, system, k)),
    )


@compiled
def _largest_relative(change, values, columns, weights):  # type: ignore[no-untyped-def]
    """max over columns of max_i |weights_i change_ic| / max(max_i |values_ic|, floor), both flat and columns wide."""
    largest = 0.0
    for c in range(columns):
        top, scale = 0.0, RELATIVE_FLOOR
        for i in range(change.shape[0] // columns):
            difference = abs(weights[i] * change[i * columns + c])
            if not difference <= top:
                top = difference
        for i in range(values.shape[0] // columns):
            scale = max(scale, abs(values[i * columns + c]))
        if not top < np.inf:
            return np.inf
        largest = max(largest, top / scale)
    return largest


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
        return condensation.solve(self.factors, residual)


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
        return np.concatenate([state.nodes.ravel(), state.slopes.ravel(), state.algebraic.ravel(), state.scalars])

    def unpack(self, x: Array) -> State:
        """The state of x (size,)."""
        elements, k, n, n_a = self.elements, self.degree, self.n, len(self.system.algebraic)
        a = (elements + 1) * n
        b = a + elements * k * n
        c = b + elements * k * n_a
        nodes, slopes = x[:a].reshape(-1, n), x[a:b].reshape(elements, k, n)
        return State(self.mesh, nodes, slopes, x[b:c].reshape(elements, k, n_a), x[c:])

    @cached_property
    def _point_weights(self) -> tuple[Array, Array]:
        """Ones for as many rows as there are anywhere, and each Gauss point's element width."""
        return np.ones(self.elements * self.degree + 2), np.repeat(self._widths, self.degree)

    @cached_property
    def functions(self) -> _Functions:
        """Compiled evaluations; arguments (mesh, x, history, coefficient, p)."""
        return _functions(self.system, self.degree)

    @cached_property
    def _device_mesh(self) -> Traced:
        return jnp.asarray(self.mesh)

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """Equations at the Gauss points, continuity, end conditions, integral conditions."""
        return np.asarray(self.functions.residual(self._device_mesh, x, rate.history, rate.coefficient, p))

    def linearise(self, x: Array, p: Array, rate: Rate) -> tuple[Array, CollocationLinearisation]:
        """Residual and factorised Jacobian."""
        out = self.functions.linearised(self._device_mesh, x, rate.history, rate.coefficient, p)
        residual, points, ends, targets = (np.asarray(part) for part in out)
        rule = gauss_rule(self.degree)
        factors = condensation.factorise(self._widths, rule.matrix, rule.weights, points, ends, targets, self.n)
        return residual, CollocationLinearisation(self, factors)

    def stored(self, x: Array, p: Array) -> Array:
        """q at the Gauss points and at both ends, flattened."""
        return np.asarray(self.functions.stored(self._device_mesh, x))

    def integrals(self, density: Density, x: Array, p: Array, rate: Rate) -> tuple[dict[str, float], dict[str, float]]:
        """Gauss quadrature of density(system, dy, y, a, s, dq, p) over u, by name, and the largest point values."""
        out = self.functions.integrals(density, self._device_mesh, x, rate.history, rate.coefficient, p)
        sums, peaks = ({name: float(value) for name, value in part.items()} for part in out)
        return sums, peaks

    def rates(self, x: Array, p: Array, rate: Rate) -> Array:
        """dq/dt at the Gauss points, (N, k, n_q)."""
        dq = rate.coefficient * self.stored(x, p) + rate.history
        n_q = len(dq) // (self.elements * self.degree + 2)
        return np.asarray(dq.reshape(-1, n_q)[:-2].reshape(self.elements, self.degree, n_q))

    def norm(self, dx: Array, x: Array) -> float:
        """Largest change of any field, algebraic field or scalar relative to that field's largest value (or one).

        A change of a slope counts as what it adds over its element.
        """
        n, n_a, points = self.n, len(self.system.algebraic), self.elements * self.degree
        a = (self.elements + 1) * n
        b = a + points * n
        c = b + points * n_a
        ones, widths = self._point_weights
        nodes = _largest_relative(dx[:a], x[:a], n, ones)
        slopes = _largest_relative(dx[a:b], x[:a], n, widths)
        algebraic = _largest_relative(dx[b:c], x[b:c], n_a, ones)
        scalars = _largest_relative(dx[c:], x[c:], len(x) - c, ones)
        return float(max(nodes, slopes, algebraic, scalars))

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Largest change of any stored quantity relative to its largest value (or one)."""
        ones, _ = self._point_weights
        return float(_largest_relative(dq, q, len(q) // (self.elements * self.degree + 2), ones))

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
