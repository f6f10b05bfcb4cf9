"""Between packed vectors of a collocation problem and rows of its Gauss points, which point functions take by tiles.

Rows run stage by stage, over all elements in each (row j N + e), as the elimination wants them; packed vectors and stored
quantities run element by element.
"""

import numpy as np

from shapespace.numerics.small_lu import Array, compiled


@compiled
def lay_out(x, widths, matrix, n, n_a, padded):  # type: ignore[no-untyped-def]
    """Rows (padded, 2n + n_a + n_s) of (slope, algebraic, field, scalars); the ends (2n + n_s,).

    x packs nodes, slopes, algebraic fields and scalars. Rows beyond the last point repeat it. Linear in x.
    """
    elements, k = widths.shape[0], matrix.shape[0]
    slopes = (elements + 1) * n
    algebraic = slopes + elements * k * n
    scalars = algebraic + elements * k * n_a
    n_s = x.shape[0] - scalars
    rows = np.empty((padded, 2 * n + n_a + n_s))
    for j in range(k):
        for e in range(elements):
            row, first = rows[j * elements + e], slopes + e * k * n
            own = first + j * n
            for c in range(n):
                row[c] = x[own + c]
                value = 0.0
                for l in range(k):
                    value += matrix[j, l] * x[first + l * n + c]
                row[n + n_a + c] = x[e * n + c] + widths[e] * value
            for c in range(n_a):
                row[n + c] = x[algebraic + (e * k + j) * n_a + c]
            for c in range(n_s):
                row[2 * n + n_a + c] = x[scalars + c]
    for point in range(elements * k, padded):
        rows[point] = rows[elements * k - 1]
    ends = np.empty(2 * n + n_s)
    ends[:n] = x[:n]
    ends[n : 2 * n] = x[elements * n : slopes]
    ends[2 * n :] = x[scalars:]
    return rows, ends


@compiled
def continuity(x, widths, weights, n):  # type: ignore[no-untyped-def]
    """Y_{e+1} - Y_e - w_e sum_l b_l slope_el, flat (N n,)."""
    elements, k = widths.shape[0], weights.shape[0]
    slopes = (elements + 1) * n
    out = np.empty(elements * n)
    for e in range(elements):
        for c in range(n):
            total = 0.0
            for l in range(k):
                total += weights[l] * x[slopes + (e * k + l) * n + c]
            out[e * n + c] = x[(e + 1) * n + c] - x[e * n + c] - widths[e] * total
    return out


def by_stage(values: Array, k: int, padded: int) -> Array:
    """Rows (k N, q), element by element, as rows (padded, q), stage by stage, the last one repeated."""
    points, q = values.shape
    out = np.empty((padded, q))
    out[:points].reshape(k, points // k, q)[:] = values.reshape(points // k, k, q).transpose(1, 0, 2)
    out[points:] = out[points - 1]
    return out


def by_element(rows: Array, k: int) -> Array:
    """Rows (k N, q), stage by stage, as rows (k N, q), element by element."""
    points, q = rows.shape
    return np.asarray(rows.reshape(k, points // k, q).transpose(1, 0, 2).reshape(points, q))
