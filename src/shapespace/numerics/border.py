"""Borders of a collocation system: extra columns as scalars, extra rows as integral conditions."""

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.problem import Border


def with_border(
    border: Border, widths: Array, weights: Array, n: int, points: Array, ends: Array, targets: Array
) -> tuple[Array, ...]:
    """The blocks (points, ends, targets, jumps, nodes) of the bordered system, as `condensation.factorise` takes them.

    border.columns (m_b, size): flat as residuals (equations (N, k, m), continuity (N, n), ends, integrals); border.rows
    (m_b, size): flat as states (nodes (N + 1, n), slopes (N, k, n), algebraic (N, k, n_a), scalars).
    """
    n_rows, n_columns, k, elements = points.shape
    (n_i, n_s), extra = targets.shape, len(border.corner)
    m, stages = n_rows - n_i, k * elements

    def by_stage(part: Array, fields: int) -> Array:
        return part.reshape(extra, elements, k, fields).transpose(0, 3, 2, 1)

    columns, rows = border.columns, border.rows
    continuity, at_ends = stages * m, stages * m + elements * n
    integrals = at_ends + len(ends)
    slopes, algebraic = (elements + 1) * n, (elements + 1 + stages) * n
    scalars = algebraic + stages * (m - n)
    # Integral rows are sums over points with these weights.
    shares = weights[:, None] * widths
    wide = np.empty((n_rows + extra, n_columns + extra, k, elements))
    wide[:n_rows, :n_columns] = points
    wide[:m, n_columns:] = by_stage(columns[:, :continuity], m).swapaxes(0, 1)
    wide[m:n_rows, n_columns:] = 0.0
    wide[n_rows:, :n] = by_stage(rows[:, slopes:algebraic], n) / shares
    wide[n_rows:, n:m] = by_stage(rows[:, algebraic:scalars], m - n) / shares
    wide[n_rows:, m:] = 0.0
    jumps, nodes = np.zeros((elements, n, n_s + extra)), np.zeros((elements + 1, n_i + extra, n))
    jumps[..., n_s:] = columns[:, continuity:at_ends].reshape(extra, elements, n).transpose(1, 2, 0)
    nodes[:, n_i:] = rows[:, :slopes].reshape(extra, elements + 1, n).swapaxes(0, 1)
    wide_ends = np.concatenate([ends, columns[:, at_ends:integrals].T], axis=1)
    wide_targets = np.empty((n_i + extra, n_s + extra))
    wide_targets[:n_i, :n_s], wide_targets[:n_i, n_s:] = targets, -columns[:, integrals:].T
    wide_targets[n_i:, :n_s], wide_targets[n_i:, n_s:] = -rows[:, scalars:], -border.corner
    return wide, wide_ends, wide_targets, jumps, nodes
