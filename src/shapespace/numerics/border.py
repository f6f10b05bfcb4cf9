"""Borders of a collocation system: extra columns as scalars, extra rows as integral conditions."""

import numpy as np

from shapespace.base.problem import Border
from shapespace.numerics.small_lu import Array, compiled, copy, put, read_only


def with_border(
    border: Border, widths: Array, weights: Array, n: int, points: Array, ends: Array, targets: Array
) -> tuple[Array, ...]:
    """The blocks (points, ends, targets, jumps, nodes) of the bordered system, as `condensation.factorise` takes them.

    border.columns (m_b, size): flat as residuals (equations (N, k, m), continuity (N, n), ends, integrals); border.rows
    (m_b, size): flat as states (nodes (N + 1, n), slopes (N, k, n), algebraic (N, k, n_a), scalars).
    """
    columns, rows, corner = (
        read_only(np.ascontiguousarray(part)) for part in (border.columns, border.rows, border.corner)
    )
    blocks = (read_only(part) for part in (points, ends, targets))
    return _bordered(columns, rows, corner, widths, weights, n, *blocks)


@compiled
def _bordered(
    columns: Array, rows: Array, corner: Array, widths: Array, weights: Array, n: int, points: Array, ends: Array,
    targets: Array,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    n_rows, n_columns, k, elements = points.shape
    (n_i, n_s), (n_b, end_columns), extra = targets.shape, ends.shape, corner.shape[0]
    m = n_rows - n_i
    slopes, algebraic, scalars = (elements + 1) * n, (elements + 1 + elements * k) * n, elements * (k * m + n) + n
    continuity, at_ends, integrals = elements * k * m, elements * (k * m + n), elements * (k * m + n) + n_b
    wide = np.zeros((n_rows + extra, n_columns + extra, k, elements))
    for c in range(n_rows):
        for d in range(n_columns):
            copy(wide[c, d], points[c, d])
    jumps, nodes = np.zeros((elements, n, n_s + extra)), np.zeros((elements + 1, n_i + extra, n))
    wide_ends, wide_targets = np.empty((n_b, end_columns + extra)), np.empty((n_i + extra, n_s + extra))
    copy(wide_ends[:, :end_columns], ends)
    copy(wide_targets[:n_i, :n_s], targets)
    for b in range(extra):
        column, row = columns[b], rows[b]
        for j in range(k):
            for e in range(elements):
                # Integral rows are sums over points with these weights.
                point, share = e * k + j, widths[e] * weights[j]
                for c in range(m):
                    wide[c, n_columns + b, j, e] = column[point * m + c]
                for c in range(n):
                    wide[n_rows + b, c, j, e] = row[slopes + point * n + c] / share
                for c in range(m - n):
                    wide[n_rows + b, n + c, j, e] = row[algebraic + point * (m - n) + c] / share
        for e in range(elements):
            for c in range(n):
                jumps[e, c, n_s + b] = column[continuity + e * n + c]
        for e in range(elements + 1):
            for c in range(n):
                nodes[e, n_i + b, c] = row[e * n + c]
        put(wide_ends[:, end_columns + b], column[at_ends:integrals])
        put(wide_targets[:n_i, n_s + b], -column[integrals:])
        put(wide_targets[n_i + b], -row[scalars:])
        put(wide_targets[n_i + b, n_s:], -corner[b])
    return wide, wide_ends, wide_targets, jumps, nodes
