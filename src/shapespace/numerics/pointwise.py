"""The equations of an AbstractSystem and their derivatives at a tile of points and at both ends, compiled once per system.

Meshes differ in their numbers of points; compiled functions see tiles of fixed sizes only, so that no mesh ever waits for
the compiler. A point is a row v = (slope, algebraic, field, scalars), the ends are one vector (y(0), y(1), scalars).
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.numerics.system import AbstractSystem

Density = Callable[..., dict[str, Traced]]
"""Named densities of (system, dy, y, a, s, dq, p) at one point."""

TILES = (80, 160)
"""Numbers of points per tile: padding costs little on small meshes, and large ones take several tiles."""


class Tile(NamedTuple):
    """Where to evaluate. rows (T, 2n + n_a + n_s), history (T, n_q), u (T,); ends (2n + n_s,), end_history (2, n_q).

    Arrays of the host or of the compiler.
    """

    rows: Any
    history: Any
    u: Any
    ends: Any
    end_history: Any


class Values(NamedTuple):
    """rows (T, m + n_i): equations, then integrands; ends (n_b,): end conditions; targets (n_i,)."""

    rows: Traced
    ends: Traced
    targets: Traced


def _split_row(system: AbstractSystem, v: Traced) -> tuple[Traced, Traced, Traced, Traced]:
    """(slope, algebraic, field, scalars) of one point."""
    n, n_a = len(system.fields), len(system.algebraic)
    return v[:n], v[n : n + n_a], v[n + n_a : 2 * n + n_a], v[2 * n + n_a :]


def _split_ends(system: AbstractSystem, v: Traced) -> tuple[Traced, Traced, Traced]:
    """(y(0), y(1), scalars)."""
    n = len(system.fields)
    return v[:n], v[n : 2 * n], v[2 * n :]


def _at_point(system: AbstractSystem, v: Traced, history: Traced, coefficient: Traced, u: Traced, p: Traced) -> Traced:
    """Equations and integrands at one point as a function of its row v."""
    dy, a, y, s = _split_row(system, v)
    dq = coefficient * system.stored(y, s) + history
    return jnp.concatenate([system.equations(dy, y, a, s, dq, u, p), system.integrands(dy, y, a, s, u, p)])


def _at_ends(system: AbstractSystem, v: Traced, history: Traced, coefficient: Traced, p: Traced) -> Traced:
    """End conditions."""
    y0, y1, s = _split_ends(system, v)
    dq0, dq1 = (coefficient * system.stored(y, s) + q for y, q in ((y0, history[0]), (y1, history[1])))
    return system.end_conditions(y0, y1, s, dq0, dq1, p)


def _stored(system: AbstractSystem, rows: Traced, ends: Traced) -> tuple[Traced, Traced]:
    """q at the points (T, n_q) and at both ends (2, n_q)."""

    def at(v: Traced) -> Traced:
        _, _, y, s = _split_row(system, v)
        return system.stored(y, s)

    y0, y1, s = _split_ends(system, ends)
    return jax.vmap(at)(rows), jnp.stack([system.stored(y0, s), system.stored(y1, s)])


def _values(system: AbstractSystem, tile: Tile, coefficient: Traced, p: Traced) -> Values:
    rows = jax.vmap(lambda v, q, u: _at_point(system, v, q, coefficient, u, p))(tile.rows, tile.history, tile.u)
    ends = _at_ends(system, tile.ends, tile.end_history, coefficient, p)
    return Values(rows, ends, system.targets(_split_ends(system, tile.ends)[2], p))


def _linearised(system: AbstractSystem, tile: Tile, coefficient: Traced, p: Traced) -> tuple[Values, Values]:
    """Values, and their Jacobians over the row, the ends, the scalars: rows (m + n_i, columns, T), ends, targets."""

    def at(v: Traced, q: Traced, u: Traced) -> tuple[Traced, Traced]:
        value = _at_point(system, v, q, coefficient, u, p)
        return value, value

    # Points run along the last axis, which is what the elimination vectorises over.
    slopes, rows = jax.vmap(jax.jacfwd(at, has_aux=True), out_axes=(-1, 0))(tile.rows, tile.history, tile.u)
    ends = jax.jacfwd(lambda v: _at_ends(system, v, tile.end_history, coefficient, p))(tile.ends)
    scalars = _split_ends(system, tile.ends)[2]
    values = Values(rows, _at_ends(system, tile.ends, tile.end_history, coefficient, p), system.targets(scalars, p))
    return values, Values(slopes, ends, jax.jacfwd(lambda s: system.targets(s, p))(scalars))


def _at_rest(system: AbstractSystem, u: Traced, rows: Traced, ends: Traced, p: Traced) -> Values:
    history, end_history = (jnp.zeros_like(q) for q in _stored(system, rows, ends))
    return _values(system, Tile(rows, history, u, ends, end_history), jnp.zeros(()), p)


Increment = tuple[Traced, Traced, Traced]
"""(rows, ends, p)."""


def _derivative(system: AbstractSystem, u: Traced, at: Increment, along: Increment) -> Values:
    """The derivative of the values at rest."""
    return jax.jvp(partial(_at_rest, system, u), at, along)[1]


def _second_derivative(system: AbstractSystem, u: Traced, at: Increment, one: Increment, other: Increment) -> Values:
    """The second derivative of the values at rest."""
    return jax.jvp(lambda *at: _derivative(system, u, at, one), at, other)[1]


def _mass(system: AbstractSystem, u: Traced, at: Increment, rows: Traced, ends: Traced) -> Values:
    """d(values)/d(dq/dt) dq at rest, dq being the change of q along (rows, ends)."""
    q, dq = jax.jvp(partial(_stored, system), at[:2], (rows, ends))

    def moving(history: Traced, end_history: Traced) -> Values:
        return _values(system, Tile(at[0], history, u, at[1], end_history), jnp.zeros(()), at[2])

    return jax.jvp(moving, (jnp.zeros_like(q[0]), jnp.zeros_like(q[1])), dq)[1]


def _densities(
    system: AbstractSystem, density: Density, rows: Traced, history: Traced, coefficient: Traced, p: Traced
) -> dict[str, Traced]:
    """Named densities (T,)."""

    def at(v: Traced, q: Traced) -> dict[str, Traced]:
        dy, a, y, s = _split_row(system, v)
        return density(system, dy, y, a, s, coefficient * system.stored(y, s) + q, p)

    return jax.vmap(at)(rows, history)


class Functions(NamedTuple):
    """The functions above, compiled for one system; they compile again for each of the TILES."""

    values: Callable[..., Values]
    linearised: Callable[..., tuple[Values, Values]]
    stored: Callable[..., tuple[Traced, Traced]]
    derivative: Callable[..., Values]
    second_derivative: Callable[..., Values]
    mass: Callable[..., Values]
    densities: Callable[..., dict[str, Traced]]


@cache
def compiled_functions(system: AbstractSystem) -> Functions:
    """Compiled functions of arrays only: looking up a system at each call would cost more than small evaluations."""
    return Functions(
        values=jax.jit(partial(_values, system)),
        linearised=jax.jit(partial(_linearised, system)),
        stored=jax.jit(partial(_stored, system)),
        derivative=jax.jit(partial(_derivative, system)),
        second_derivative=jax.jit(partial(_second_derivative, system)),
        mass=jax.jit(partial(_mass, system)),
        densities=jax.jit(partial(_densities, system), static_argnums=0),
    )
