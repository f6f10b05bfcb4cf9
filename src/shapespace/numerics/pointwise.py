"""The equations of an AbstractSystem at all Gauss points of a mesh, and their derivatives, as compiled functions of arrays."""

from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Traced
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.system import AbstractSystem

Density = Callable[..., dict[str, Traced]]


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


def _derivative(system: AbstractSystem, k: int, mesh: Traced, x: Traced, p: Traced, dx: Traced, dp: Traced) -> Traced:
    """d(residual at rest) along (dx, dp)."""
    rest = jnp.zeros_like(_stored(system, k, mesh, x))

    def at_rest(x: Traced, p: Traced) -> Traced:
        return _residual(system, k, mesh, x, rest, jnp.zeros(()), p)

    return jax.jvp(at_rest, (x, p), (dx, dp))[1]


def _second_derivative(
    system: AbstractSystem,
    k: int,
    mesh: Traced,
    x: Traced,
    p: Traced,
    one: Traced,
    dp: Traced,
    other: Traced,
    ep: Traced,
) -> Traced:
    """The second derivative of the residual at rest along (one, dp) and (other, ep)."""
    return jax.jvp(lambda x, p: _derivative(system, k, mesh, x, p, one, dp), (x, p), (other, ep))[1]


def _mass(system: AbstractSystem, k: int, mesh: Traced, x: Traced, p: Traced, dx: Traced) -> Traced:
    """d(residual)/d(dq/dt) dq/dx dx at rest."""
    stored, rates = jax.jvp(lambda x: _stored(system, k, mesh, x), (x,), (dx,))

    def in_motion(history: Traced) -> Traced:
        return _residual(system, k, mesh, x, history, jnp.zeros(()), p)

    return jax.jvp(in_motion, (jnp.zeros_like(stored),), (rates,))[1]


class Functions(NamedTuple):
    """The functions above, compiled for one system and degree; they compile again for each number of elements."""

    residual: Callable[..., Traced]
    linearised: Callable[..., tuple[Traced, ...]]
    integrals: Callable[..., tuple[dict[str, Traced], dict[str, Traced]]]
    stored: Callable[..., Traced]
    derivative: Callable[..., Traced]
    second_derivative: Callable[..., Traced]
    mass: Callable[..., Traced]


@cache
def compiled_functions(system: AbstractSystem, k: int) -> Functions:
    """Compiled functions of arrays only: looking up a system at each call would cost more than small evaluations."""
    return Functions(
        residual=jax.jit(partial(_residual, system, k)),
        linearised=jax.jit(partial(_linearised, system, k)),
        integrals=jax.jit(partial(_integrals, system, k), static_argnums=0),
        stored=jax.jit(partial(_stored, system, k)),
        derivative=jax.jit(partial(_derivative, system, k)),
        second_derivative=jax.jit(partial(_second_derivative, system, k)),
        mass=jax.jit(partial(_mass, system, k)),
    )
