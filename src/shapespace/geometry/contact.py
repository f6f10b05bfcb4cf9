"""Does a surface of revolution touch or pass through itself? Seen on its outline (r, z), a polyline from end to end."""

import numpy as np

from shapespace.base.arrays import Array


def self_crossing(r: Array, z: Array) -> tuple[int, int] | None:
    """Segments (i, j), i < j, of the outline that cross, or (i, i) for one that crosses the axis; None for a simple outline.

    r, z: outline points (m,); ends may lie on the axis. Of several crossings the first in i, then in j.
    """
    through_axis = np.flatnonzero(np.minimum(r[:-1], r[1:]) < -AXIS_TOLERANCE * np.abs(r).max())
    points = np.stack([r, z], axis=1)
    first, second = np.triu_indices(len(r) - 1, k=2)
    a, b, c, d = points[first], points[first + 1], points[second], points[second + 1]
    # Two segments cross where the ends of each lie on different sides of the other.
    crossing = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    pairs = [(int(i), int(i)) for i in through_axis[:1]]
    hits = np.flatnonzero(crossing)
    pairs += [(int(first[k]), int(second[k])) for k in hits[:1]]
    return min(pairs) if pairs else None


AXIS_TOLERANCE = 1e-9
"""Radii at the poles are zero only to round-off."""


def _side(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of the triangles a, b, c (n, 2)."""
    return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
