"""Between flat vectors of a collocation problem and tiles, flat vectors of a fixed number of points that compiled functions take.

Points run stage by stage, over all elements in each (point j N + e), as the elimination wants them; states, residuals and
stored quantities run element by element. A tile of T points packs

    slopes (n, T), algebraic (n_a, T), fields (n, T), history (n_q, T), u (T,), scalars (n_s,),
    y(0) (n,), y(1) (n,), history at both ends (2, n_q), coefficient, parameters (n_p,)

and what comes back packs rows (m + n_i, T) of equations and integrands, end conditions (n_b,), targets (n_i,). One flat vector
each, because handing an array to a compiled function costs as much as evaluating it at ten points.
"""

from typing import Any

import numpy as np

from shapespace.numerics.small_lu import Array, BoolArray, compiled, put


@compiled
def lay_out(
    x: Array, p: Array, coefficient: float, history: Array, mesh: Array, matrix: Array, stages: Array, n: int, n_a: int,
    n_q: int, points_per_tile: int,
) -> Array:  # fmt: skip
    """Tiles (n_tiles, size) of x and all else that they hold; history (N k + 2, n_q), flat, or (1,) for zero. Linear in x.

    stages (k,): the Gauss points on [0, 1]; matrix (k, k): integrals of their basis. Points beyond the last repeat it.
    """
    elements, k, size = mesh.shape[0] - 1, matrix.shape[0], points_per_tile
    slopes = (elements + 1) * n
    algebraic = slopes + elements * k * n
    scalars = algebraic + elements * k * n_a
    n_s, n_p = x.shape[0] - scalars, p.shape[0]
    n_points, moves = elements * k, history.shape[0] > 1
    n_tiles = (n_points + size - 1) // size
    columns = 2 * n + n_a + n_q + 1
    first_ends = columns * size
    out = np.zeros((n_tiles, first_ends + n_s + 2 * n + 2 * n_q + 1 + n_p))
    # Column by column, each over all points and then cut into tiles: what is written lies side by side.
    column = np.empty(n_tiles * size)
    for c in range(columns):
        if 2 * n + n_a <= c < columns - 1 and not moves:
            continue
        for j in range(k):
            own = column[j * elements : (j + 1) * elements]
            if c < n:
                for e in range(elements):
                    own[e] = x[slopes + (e * k + j) * n + c]
            elif c < n + n_a:
                for e in range(elements):
                    own[e] = x[algebraic + (e * k + j) * n_a + c - n]
            elif c < 2 * n + n_a:
                field = c - n - n_a
                for e in range(elements):
                    own[e] = 0.0
                for l in range(k):
                    share, first = matrix[j, l], slopes + l * n + field
                    for e in range(elements):
                        own[e] += share * x[first + e * k * n]
                for e in range(elements):
                    own[e] = x[e * n + field] + (mesh[e + 1] - mesh[e]) * own[e]
            elif c < columns - 1:
                for e in range(elements):
                    own[e] = history[(e * k + j) * n_q + c - 2 * n - n_a]
            else:
                for e in range(elements):
                    own[e] = mesh[e] + (mesh[e + 1] - mesh[e]) * stages[j]
        for point in range(n_points, n_tiles * size):
            column[point] = column[n_points - 1]
        for index in range(n_tiles):
            put(out[index, c * size :], column[index * size : (index + 1) * size])
    for index in range(n_tiles):
        ends = out[index, first_ends:]
        put(ends, x[scalars:])
        put(ends[n_s:], x[:n])
        put(ends[n_s + n :], x[elements * n : slopes])
        if moves:
            put(ends[n_s + 2 * n :], history[n_points * n_q :])
        ends[n_s + 2 * n + 2 * n_q] = coefficient
        put(ends[n_s + 2 * n + 2 * n_q + 1 :], p)
    return out


@compiled
def assembled(
    values: Array, x: Array, mesh: Array, weights: Array, n: int, m: int, n_i: int, points_per_tile: int
) -> Array:
    """The flat residual from what came back (n_tiles, size): equations, continuity of x, end conditions, integral conditions."""
    elements, k, size = mesh.shape[0] - 1, weights.shape[0], points_per_tile
    slopes, equations = (elements + 1) * n, elements * k * m
    border = values[0, (m + n_i) * size :]
    n_b = border.shape[0] - n_i
    out = np.empty(equations + elements * n + border.shape[0])
    integrals = out[equations + elements * n + n_b :]
    for q in range(n_i):
        integrals[q] = -border[n_b + q]
    for j in range(k):
        for e in range(elements):
            point = j * elements + e
            tile, column = values[point // size], point % size
            for c in range(m):
                out[(e * k + j) * m + c] = tile[c * size + column]
            for q in range(n_i):
                integrals[q] += weights[j] * (mesh[e + 1] - mesh[e]) * tile[(m + q) * size + column]
    for e in range(elements):
        for c in range(n):
            total = 0.0
            for l in range(k):
                total += weights[l] * x[slopes + (e * k + l) * n + c]
            out[equations + e * n + c] = x[(e + 1) * n + c] - x[e * n + c] - (mesh[e + 1] - mesh[e]) * total
    put(out[equations + elements * n :], border[:n_b])
    return out


@compiled
def product(
    x: Array, points: Array, structure: BoolArray, ends: Array, targets: Array, mesh: Array, matrix: Array,
    weights: Array, jumps: float,
) -> Array:  # fmt: skip
    """A collocation matrix with blocks as in `condensation.factorise` times x, flat as the residual.

    structure (m + n_i, m + n + n_s): which entries of `points` are not zero throughout. jumps: factor of the continuity rows.
    """
    n_rows, columns, k, elements = points.shape
    n_i, (n_b, end_columns) = targets.shape[0], ends.shape
    m, n_s = n_rows - n_i, targets.shape[1]
    n, n_a = (end_columns - n_s) // 2, m - (end_columns - n_s) // 2
    slopes, continuity = (elements + 1) * n, elements * k * m
    algebraic = slopes + elements * k * n
    scalars = algebraic + elements * k * n_a
    out = np.zeros(continuity + elements * n + n_b + n_i)
    integrals = continuity + elements * n + n_b
    values = np.empty(elements)
    for c in range(columns):
        for j in range(k):
            is_known = False
            for row in range(n_rows):
                if not structure[row, c]:
                    continue
                if not is_known:
                    is_known = True
                    for e in range(elements):
                        if c < n:
                            values[e] = x[slopes + (e * k + j) * n + c]
                        elif c < m:
                            values[e] = x[algebraic + (e * k + j) * n_a + c - n]
                        elif c < m + n:
                            rise = 0.0
                            for l in range(k):
                                rise += matrix[j, l] * x[slopes + (e * k + l) * n + c - m]
                            values[e] = x[e * n + c - m] + (mesh[e + 1] - mesh[e]) * rise
                        else:
                            values[e] = x[scalars + c - m - n]
                block = points[row, c, j]
                if row < m:
                    for e in range(elements):
                        out[(e * k + j) * m + row] += block[e] * values[e]
                else:
                    for e in range(elements):
                        out[integrals + row - m] += weights[j] * (mesh[e + 1] - mesh[e]) * block[e] * values[e]
    if jumps != 0.0:
        for e in range(elements):
            for c in range(n):
                rise = 0.0
                for l in range(k):
                    rise += weights[l] * x[slopes + (e * k + l) * n + c]
                rise = x[(e + 1) * n + c] - x[e * n + c] - (mesh[e + 1] - mesh[e]) * rise
                out[continuity + e * n + c] = jumps * rise
    for i in range(n_b):
        for c in range(n):
            out[continuity + elements * n + i] += ends[i, c] * x[c] + ends[i, n + c] * x[elements * n + c]
        for c in range(n_s):
            out[continuity + elements * n + i] += ends[i, 2 * n + c] * x[scalars + c]
    for q in range(n_i):
        for c in range(n_s):
            out[integrals + q] -= targets[q, c] * x[scalars + c]
    return out


def by_element(rows: Array, k: int) -> Array:
    """Rows (q, k N), stage by stage, as rows (k N, q), element by element."""
    q, points = rows.shape
    return np.asarray(rows.reshape(q, k, points // k).transpose(2, 1, 0).reshape(points, q))


def joined(parts: list[Any], points: int) -> Array:
    """Results (..., T) of all tiles, one after another, without the points beyond the last."""
    whole = np.asarray(parts[0]) if len(parts) == 1 else np.concatenate(parts, axis=-1)
    return whole[..., :points]
