"""Is a function smooth? Steps and kinks, which Newton's method and the error estimates do not survive, are found by bisection."""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced

GRID = 64
"""Points along each way between two sample points."""
HALVINGS = 40
SHARP = 1e-6
"""A change of value or slope over 2^-HALVINGS of the way, relative to the largest, that no smooth law makes."""


def rough_place(function: Callable[..., Traced], arguments: Mapping[str, Array]) -> dict[str, float] | None:
    """Where a function of arguments (m,) steps or has a kink on the straight ways between them; None where it is smooth.

    Along each way value and slope are sampled; the interval of the largest change is halved again and again. Of a smooth
    function the change shrinks with the interval, at a step or kink it stays.
    """
    start = {name: jnp.asarray(values[:-1]) for name, values in arguments.items()}
    step = {name: jnp.asarray(np.diff(values)) for name, values in arguments.items()}

    def along(part: Traced) -> Traced:
        return function(**{name: start[name] + part * step[name] for name in start}) + 0.0 * part

    @jax.jit
    def both(t: Traced) -> Traced:
        return jnp.stack(jax.jvp(along, (t,), (jnp.ones_like(t),)))

    def at(t: Array) -> Array:
        """Value and slope (2, m - 1) at parts t (m - 1,) of the ways."""
        return np.asarray(both(t))

    ways = len(next(iter(step.values())))
    samples = np.stack([at(np.full(ways, t)) for t in np.linspace(0.0, 1.0, GRID + 1)])
    size = np.abs(samples).max(axis=(0, 2))[:, None]
    if not np.isfinite(samples).all() or size.max() == 0.0:
        return None
    size = np.maximum(size, 1e-300)
    first = (np.abs(np.diff(samples, axis=0)) / size).max(axis=1).argmax(axis=0)
    left, right = first / GRID, (first + 1) / GRID
    for _ in range(HALVINGS):
        middle = 0.5 * (left + right)
        low, here, high = at(left), at(middle), at(right)
        is_left = (np.abs(here - low) / size).max(axis=0) >= (np.abs(high - here) / size).max(axis=0)
        left, right = np.where(is_left, left, middle), np.where(is_left, middle, right)
    changes = (np.abs(at(right) - at(left)) / size).max(axis=0)
    worst = int(changes.argmax())
    if not changes[worst] > SHARP:
        return None
    return {name: float(start[name][worst] + left[worst] * step[name][worst]) for name in start}
