"""Does a surface of revolution touch or pass through itself? Seen on its outline (r, z), a curve from end to end."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shapespace.base.arrays import Array

AXIS_TOLERANCE = 1e-9
"""Radii at the poles are zero only to round-off."""
NEAR = 0.75
"""Pieces whose middles lie within this many times the sum of their lengths may cross, though their chords do not."""
PARTS, LEVELS = 4, 4
"""Near pieces are cut into so many parts, so many times."""

Outline = Callable[[Array], tuple[Array, Array]]
"""(r, z) of u (m,)."""
Indices = NDArray[np.intp]


def crosses_itself(outline: Outline, u: Array) -> bool:
    """Whether an outline crosses itself or the axis; ends may lie on the axis.

    u (m,): rising parameters that resolve the outline. Pieces of it that come near each other are looked at
    more closely, so that what counts are the curves and not their chords: a crossing is missed only where it is shallower
    than about 1/100,000 of the distance of the samples, and touching counts as not crossing.
    """
    r, _ = outline(u)
    if r.min() < -AXIS_TOLERANCE * np.abs(r).max():
        return True
    first, second = np.triu_indices(len(u) - 1, k=2)
    for level in range(LEVELS + 1):
        points = np.stack(outline(u), axis=1)
        middles, lengths = 0.5 * (points[1:] + points[:-1]), np.linalg.norm(np.diff(points, axis=0), axis=1)
        apart = np.linalg.norm(middles[first] - middles[second], axis=1)
        near = apart <= NEAR * (lengths[first] + lengths[second])
        first, second = first[near], second[near]
        if not len(first):
            return False
        if level < LEVELS:
            u, first, second = _refined(u, first, second)
    return bool(_cross(points[first], points[first + 1], points[second], points[second + 1]).any())


def _refined(u: Array, first: Indices, second: Indices) -> tuple[Array, Indices, Indices]:
    """The pieces that take part, cut into parts: their ends u, and the pairs of all parts of a pair."""
    taking = np.unique(np.concatenate([first, second]))
    cuts = [np.linspace(u[i], u[i + 1], PARTS + 1) for i in taking]
    finer = np.unique(np.concatenate(cuts))
    starts = np.searchsorted(finer, u[taking])
    parts = np.arange(PARTS)
    a = starts[np.searchsorted(taking, first)][:, None, None] + parts[:, None]
    b = starts[np.searchsorted(taking, second)][:, None, None] + parts
    a, b = np.broadcast_arrays(a, b)
    return finer, a.ravel(), b.ravel()


def _cross(a: Array, b: Array, c: Array, d: Array) -> NDArray[np.bool_]:
    """Whether segments a-b and c-d (n, 2) cross: the ends of each lie on different sides of the other."""
    return (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)


def _side(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of the triangles a, b, c (n, 2)."""
    return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
