"""Borders of a collocation system: extra columns as scalars, extra rows as integral conditions."""

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.problem import Border


def with_border(
    border: Border, widths: Array, weights: Array, n: int, points: Array, ends: Array, targets: Array
) -> list[Array]:
    """The blocks (points, ends, targets, jumps, nodes) of the bordered system, as `condensation.factorise` takes them.

    border.columns (m_b, size): flat as residuals (equations (N, k, m), continuity (N, n), ends, integrals); border.rows
    (m_b, size): flat as states (nodes (N + 1, n), slopes (N, k, n), algebraic (N, k, n_a), scalars).
    """
    n_rows, n_columns, k, elements = points.shape
    (n_i, n_s), extra = targets.shape, len(border.corner)
    m = n_rows - n_i
    equations, continuity, at_ends, integrals = np.split(
        border.columns, np.cumsum([elements * k * m, elements * n, len(ends)]), axis=1
    )
    nodes, slopes, algebraic, scalars = np.split(
        border.rows, np.cumsum([(elements + 1) * n, elements * k * n, elements * k * (m - n)]), axis=1
    )
    # Integral rows are sums over points with these weights.
    shares = widths[:, None] * weights
    wide = np.zeros((n_rows + extra, n_columns + extra, k, elements))
    wide[:n_rows, :n_columns] = points
    wide[:m, n_columns:] = equations.reshape(extra, elements, k, m).transpose(3, 0, 2, 1)
    wide[n_rows:, :n] = (slopes.reshape(extra, elements, k, n) / shares[..., None]).transpose(0, 3, 2, 1)
    wide[n_rows:, n:m] = (algebraic.reshape(extra, elements, k, m - n) / shares[..., None]).transpose(0, 3, 2, 1)
    jumps = np.zeros((elements, n, n_s + extra))
    jumps[..., n_s:] = continuity.reshape(extra, elements, n).transpose(1, 2, 0)
    node_rows = np.zeros((elements + 1, n_i + extra, n))
    node_rows[:, n_i:] = nodes.reshape(extra, elements + 1, n).transpose(1, 0, 2)
    corner = np.block([[targets, -integrals.T], [-scalars, -border.corner]])
    return [wide, np.concatenate([ends, at_ends.T], axis=1), corner, jumps, node_rows]
