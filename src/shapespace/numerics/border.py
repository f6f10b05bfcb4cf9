"""Borders of a collocation system: extra columns as scalars, extra rows as integral conditions."""

import numpy as np

from shapespace.numerics.small_lu import compiled


@compiled
def with_border(columns, rows, corner, widths, weights, n, points, ends, targets):  # type: ignore[no-untyped-def]
    """The blocks (points, ends, targets, jumps, nodes) of the bordered system, as `condensation.factorise` takes them.

    columns (m_b, size): flat as residuals (equations (N, k, m), continuity (N, n), ends, integrals); rows (m_b, size): flat
    as states (nodes (N + 1, n), slopes (N, k, n), algebraic (N, k, n_a), scalars); corner (m_b, m_b).
    """
    n_rows, n_columns, k, elements = points.shape
    (n_i, n_s), (n_b, end_columns), extra = targets.shape, ends.shape, corner.shape[0]
    m = n_rows - n_i
    slopes, algebraic, scalars = (elements + 1) * n, (elements + 1 + elements * k) * n, elements * (k * m + n) + n
    continuity, at_ends, integrals = elements * k * m, elements * (k * m + n), elements * (k * m + n) + n_b
    wide = np.zeros((n_rows + extra, n_columns + extra, k, elements))
    wide[:n_rows, :n_columns] = points
    jumps, nodes = np.zeros((elements, n, n_s + extra)), np.zeros((elements + 1, n_i + extra, n))
    wide_ends, wide_targets = np.empty((n_b, end_columns + extra)), np.empty((n_i + extra, n_s + extra))
    wide_ends[:, :end_columns], wide_targets[:n_i, :n_s] = ends, targets
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
        wide_ends[:, end_columns + b] = column[at_ends:integrals]
        wide_targets[:n_i, n_s + b] = -column[integrals:]
        wide_targets[n_i + b, :n_s] = -row[scalars:]
        wide_targets[n_i + b, n_s:] = -corner[b]
    return wide, wide_ends, wide_targets, jumps, nodes
