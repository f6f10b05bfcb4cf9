"""The equations of an AbstractSystem and their derivatives at a tile of points and at both ends, compiled once per system.

Meshes differ in their numbers of points; compiled functions see tiles of fixed sizes only, so that no mesh ever waits for
the compiler. Tiles come as flat vectors (layout.py). A point's row is v = (slope, algebraic, field).
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.numerics.kept import Kept
from shapespace.numerics.system import AbstractSystem

Density = Callable[..., dict[str, Traced]]
"""Named densities of (system, dy, y, a, s, dq, p) at one point."""

TILES = (80, 160, 240)
"""Numbers of points per tile: padding costs little on small meshes, and large ones take several tiles."""
CALL = 50
"""Calling a compiled function costs about as much as this many points."""


def points_per_tile(points: int) -> int:
    """The tile that serves so many points at least cost."""
    return min(TILES, key=lambda size: -(-points // size) * (size + CALL))


class Numbers(NamedTuple):
    """Of stored quantities n_q and of integral conditions n_i."""

    stored: int
    integrals: int


@cache
def numbers(system: AbstractSystem) -> Numbers:
    """As the system's functions return them."""
    y, a, s, p = (
        jnp.zeros(len(names)) for names in (system.fields, system.algebraic, system.scalars, system.parameters)
    )
    return Numbers(jax.eval_shape(system.stored, y, a, s).shape[0], jax.eval_shape(system.targets, s, p).shape[0])


class Tile(NamedTuple):
    """Where to evaluate. rows (2n + n_a, T), history (n_q, T), u (T,), scalars (n_s,); ends (2, n), end_history (2, n_q)."""

    rows: Traced
    history: Traced
    u: Traced
    scalars: Traced
    ends: Traced
    end_history: Traced
    coefficient: Traced
    p: Traced


class DensitySlopes(NamedTuple):
    """Derivatives of a density at each point: by the rows (2n + n_a, T), the scalars (n_s, T) and the parameters (n_p, T)."""

    rows: Traced
    scalars: Traced
    p: Traced


class Values(NamedTuple):
    """rows (m + n_i, T): equations, then integrands; ends (n_b,): end conditions; targets (n_i,)."""

    rows: Traced
    ends: Traced
    targets: Traced

    def flat(self) -> Traced:
        """All in one."""
        return jnp.concatenate([self.rows.ravel(), self.ends, self.targets])


def _opened(system: AbstractSystem, packed: Traced) -> Tile:
    """The tile of a flat vector, as layout.lay_out packs it."""
    n, n_s, n_q = len(system.fields), len(system.scalars), numbers(system).stored
    columns, beside = 2 * n + len(system.algebraic), n_s + 2 * n + 2 * n_q + 1 + len(system.parameters)
    size = (packed.shape[0] - beside) // (columns + n_q + 1)
    lengths = (columns * size, n_q * size, size, n_s, 2 * n, 2 * n_q, 1)
    cuts = [sum(lengths[: i + 1]) for i in range(len(lengths))]
    rows, history, u, scalars, ends, end_history, coefficient, p = jnp.split(packed, cuts)
    rows, history = rows.reshape(columns, size), history.reshape(n_q, size)
    return Tile(rows, history, u, scalars, ends.reshape(2, n), end_history.reshape(2, n_q), coefficient[0], p)


def _split_row(system: AbstractSystem, v: Traced) -> tuple[Traced, Traced, Traced]:
    """(slope, algebraic, field) of one point."""
    n, n_a = len(system.fields), len(system.algebraic)
    return v[:n], v[n : n + n_a], v[n + n_a :]


def _at_point(
    system: AbstractSystem, v: Traced, s: Traced, history: Traced, coefficient: Traced, u: Traced, p: Traced
) -> Traced:
    """Equations and integrands at one point as a function of its row v and the scalars s."""
    dy, a, y = _split_row(system, v)
    dq = coefficient * system.stored(y, a, s) + history
    return jnp.concatenate([system.equations(dy, y, a, s, dq, u, p), system.integrands(dy, y, a, s, u, p)])


def _at_ends(system: AbstractSystem, ends: Traced, s: Traced, tile: Tile) -> Traced:
    """End conditions."""
    none = jnp.zeros(len(system.algebraic))
    dq0, dq1 = (tile.coefficient * system.stored(ends[i], none, s) + tile.end_history[i] for i in (0, 1))
    return system.end_conditions(ends[0], ends[1], s, dq0, dq1, tile.p)


def _stored_at(system: AbstractSystem, rows: Traced, scalars: Traced, ends: Traced) -> tuple[Traced, Traced]:
    """q at the points (n_q, T) and at both ends (2, n_q)."""

    def at(v: Traced) -> Traced:
        _, a, y = _split_row(system, v)
        return system.stored(y, a, scalars)

    none = jnp.zeros(len(system.algebraic))
    inner = jax.vmap(at, in_axes=-1, out_axes=-1)(rows)
    return inner, jnp.stack([system.stored(ends[i], none, scalars) for i in (0, 1)])


def _values_at(system: AbstractSystem, tile: Tile) -> Values:
    def at(v: Traced, q: Traced, u: Traced) -> Traced:
        return _at_point(system, v, tile.scalars, q, tile.coefficient, u, tile.p)

    rows = jax.vmap(at, in_axes=-1, out_axes=-1)(tile.rows, tile.history, tile.u)
    return Values(rows, _at_ends(system, tile.ends, tile.scalars, tile), system.targets(tile.scalars, tile.p))


def _values(system: AbstractSystem, packed: Traced) -> Traced:
    return _values_at(system, _opened(system, packed)).flat()


def _stored(system: AbstractSystem, packed: Traced) -> tuple[Traced, Traced]:
    tile = _opened(system, packed)
    return _stored_at(system, tile.rows, tile.scalars, tile.ends)


def _linearised(system: AbstractSystem, packed: Traced) -> tuple[Traced, Values]:
    """Flat values, and their Jacobians: rows (m + n_i, columns, T), over row and scalars; ends over both ends and scalars."""
    tile = _opened(system, packed)
    columns, n = len(tile.rows), len(system.fields)

    def at(v: Traced, q: Traced, u: Traced) -> tuple[Traced, Traced]:
        value = _at_point(system, v[:columns], v[columns:], q, tile.coefficient, u, tile.p)
        return value, value

    def at_ends(v: Traced) -> tuple[Traced, Traced]:
        value = _at_ends(system, v[: 2 * n].reshape(2, n), v[2 * n :], tile)
        return value, value

    # Points run along the last axis, which is what the elimination vectorises over.
    scalars = jnp.broadcast_to(tile.scalars[:, None], (len(tile.scalars), tile.u.shape[0]))
    wide = jnp.concatenate([tile.rows, scalars])
    slopes, rows = jax.vmap(jax.jacfwd(at, has_aux=True), in_axes=-1, out_axes=-1)(wide, tile.history, tile.u)
    end_slopes, ends = jax.jacfwd(at_ends, has_aux=True)(jnp.concatenate([tile.ends.ravel(), tile.scalars]))
    target_slopes = jax.jacfwd(lambda s: system.targets(s, tile.p))(tile.scalars)
    values = Values(rows, ends, system.targets(tile.scalars, tile.p))
    return values.flat(), Values(slopes, end_slopes, target_slopes)


def _mass(system: AbstractSystem, packed: Traced) -> Values:
    """At rest, what a growth rate of one adds to the Jacobians of `_linearised`: dF/d(dq/dt) dq/dx, as few q are stored."""
    tile = _opened(system, packed)
    columns, n, (n_q, n_i) = len(tile.rows), len(system.fields), numbers(system)
    s, none = tile.scalars, jnp.zeros(len(system.algebraic))

    def stored(v: Traced) -> Traced:
        _, a, y = _split_row(system, v[:columns])
        return system.stored(y, a, v[columns:])

    def at(v: Traced, u: Traced) -> Traced:
        dy, a, y = _split_row(system, v[:columns])
        by_rate = jax.jacfwd(lambda dq: system.equations(dy, y, a, s, dq, u, tile.p))(jnp.zeros(n_q))
        by_state, rows = jax.jacfwd(stored)(v), jnp.zeros((len(by_rate), len(v)))
        for i in range(n_q):  # not as a product of matrices, which XLA would hand to a routine for each point
            rows += by_rate[:, i, None] * by_state[i]
        return jnp.concatenate([rows, jnp.zeros((n_i, len(v)))])

    def stored_at_ends(v: Traced) -> Traced:
        ends = v[: 2 * n].reshape(2, n)
        return jnp.stack([system.stored(ends[i], none, v[2 * n :]) for i in (0, 1)])

    def at_ends(dq: Traced) -> Traced:
        return system.end_conditions(tile.ends[0], tile.ends[1], s, dq[0], dq[1], tile.p)

    wide = jnp.concatenate([tile.rows, jnp.broadcast_to(s[:, None], (len(s), tile.u.shape[0]))])
    rows = jax.vmap(at, in_axes=-1, out_axes=-1)(wide, tile.u)
    by_ends = jax.jacfwd(stored_at_ends)(jnp.concatenate([tile.ends.ravel(), s]))
    return Values(rows, jnp.tensordot(jax.jacfwd(at_ends)(jnp.zeros((2, n_q))), by_ends, 2), jnp.zeros((n_i, len(s))))


def _change(system: AbstractSystem, packed: Traced) -> Tile:
    """The tile of a change of the state and the parameters, where points stay."""
    tile = _opened(system, packed)
    return tile._replace(u=jnp.zeros_like(tile.u))


def _derivative(system: AbstractSystem, at: Tile, along: Tile) -> Traced:
    """The derivative of the values."""
    return jax.jvp(lambda tile: _values_at(system, tile).flat(), (at,), (along,))[1]


def _first_derivative(system: AbstractSystem, at: Traced, along: Traced) -> Traced:
    return _derivative(system, _opened(system, at), _change(system, along))


def _second_derivative(system: AbstractSystem, at: Traced, one: Traced, other: Traced) -> Traced:
    """The second derivative of the values."""
    along = _change(system, one)
    return jax.jvp(lambda at: _derivative(system, at, along), (_opened(system, at),), (_change(system, other),))[1]


def _densities(system: AbstractSystem, density: Density, packed: Traced) -> dict[str, Traced]:
    """All densities as one array (names, T) under their names, with spaces between: handing over twenty would take longer."""
    tile = _opened(system, packed)

    def at(v: Traced, q: Traced) -> dict[str, Traced]:
        dy, a, y = _split_row(system, v)
        s = tile.scalars
        return density(system, dy, y, a, s, tile.coefficient * system.stored(y, a, s) + q, tile.p)

    found = jax.vmap(at, in_axes=-1)(tile.rows, tile.history)
    return {" ".join(found): jnp.stack(list(found.values()))}


def _density_slopes(system: AbstractSystem, density: Density, packed: Traced) -> dict[str, DensitySlopes]:
    """Derivatives of named densities at rest."""
    tile = _opened(system, packed)
    dq = jnp.zeros(numbers(system).stored)

    def at(v: Traced, s: Traced, p: Traced) -> dict[str, Traced]:
        dy, a, y = _split_row(system, v)
        return density(system, dy, y, a, s, dq, p)

    slopes = jax.vmap(jax.jacrev(at, argnums=(0, 1, 2)), in_axes=(-1, None, None), out_axes=-1)
    found = slopes(tile.rows, tile.scalars, tile.p)
    return {name: DensitySlopes(*one) for name, one in found.items()}


class Functions(NamedTuple):
    """The functions above, compiled for one system; they compile again for each of the TILES.

    Derivatives take tiles of the state and of its changes.
    """

    values: Callable[..., Traced]
    linearised: Callable[..., tuple[Traced, Values]]
    mass: Callable[..., Values]
    stored: Callable[..., tuple[Traced, Traced]]
    derivative: Callable[..., Traced]
    second_derivative: Callable[..., Traced]
    densities: Callable[..., dict[str, Traced]]
    density_slopes: Callable[..., dict[str, DensitySlopes]]


_NAMES: dict[AbstractSystem, str] = {}


def name_system(system: AbstractSystem, name: str) -> None:
    """Keep the compiled functions of a system on disk, under a name that the package gives to no other.

    Only for systems that the package's own sources define: a user's law may change while its name does not.
    """
    _NAMES[system] = name


@cache
def compiled_functions(system: AbstractSystem) -> Functions:
    """Compiled functions of arrays only: looking up a system at each call would cost more than small evaluations."""
    name = _NAMES.get(system)

    def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
        of_arrays = partial(function, system)
        return jax.jit(of_arrays) if name is None else Kept(of_arrays, f"{name} {function.__name__}")

    @cache
    def of_density(function: Callable[..., Any], density: Density) -> Callable[..., Any]:
        of_arrays = partial(function, system, density)
        is_own = name is not None and density.__module__.startswith(f"{__package__.partition('.')[0]}.")
        what = f"{name} {function.__name__} {density.__module__} {density.__qualname__}"
        return Kept(of_arrays, what) if is_own else jax.jit(of_arrays)

    return Functions(
        values=compiled(_values),
        linearised=compiled(_linearised),
        mass=compiled(_mass),
        stored=compiled(_stored),
        derivative=compiled(_first_derivative),
        second_derivative=compiled(_second_derivative),
        densities=lambda density, tile: of_density(_densities, density)(tile),
        density_slopes=lambda density, tile: of_density(_density_slopes, density)(tile),
    )
