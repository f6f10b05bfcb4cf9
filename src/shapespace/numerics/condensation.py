"""Factorisation of a linearised collocation system: local elimination, chain elimination, border.

Unknowns: node values Y_0..Y_N (n), per element k stages of slopes (n) and algebraic fields (n_a), scalars s (n_s).

    stage (e, j):   D_ej [slope_ej; alg_ej] + Fy_ej (Y_e + w_e sum_l a_jl slope_el) + Fs_ej s = f_ej        m = n + n_a rows
    continuity e:   Y_{e+1} - Y_e - w_e sum_l b_l slope_el = g_e                                            n rows
    end rows:       B0 Y_0 + B1 Y_N + Bs s = e                                                              n_b rows
    integral rows:  sum_ej w_e b_j (Id_ej [slope; alg] + Iy_ej y_ej + Is_ej s) - T s = i                    n_i rows

with n_b + n_i = n + n_s. Each element is condensed by LU with scaled partial pivoting to Y_{e+1} = G_e Y_e + S_e s + ...,
interior nodes are eliminated two blocks at a time with row pivoting across the blocks (stable for growing and decaying
solutions alike), and a dense system in (Y_0, Y_N, s) closes the border. The loops run in numba: LAPACK's overhead on
blocks this small costs several times the arithmetic (docs/decisions/0001-linear-algebra-in-numba.md).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Factors(NamedTuple):
    """Everything `solve` needs; plain arrays, so that compiled loops can take it apart."""

    widths: Array
    matrix: Array
    weights: Array
    row_scale: Array
    local_lu: Array
    local_pivot: IntArray
    from_node: Array
    from_scalar: Array
    chain_lu: Array
    chain_pivot: IntArray
    chain_rows: Array
    integral_multiplier: Array
    integral_local: Array
    border_lu: Array
    border_pivot: IntArray
    border_scale: Array
    singular: bool


class Update(NamedTuple):
    """A solution or a right-hand side by parts: nodes/continuity, stages, scalars or border rows."""

    nodes: Array
    stages: Array
    border: Array


# Contraction to fused multiply-adds and reassociated sums, but NaN and infinity keep their meaning.
_compile = njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")


@_compile
def _lu_rectangular(a: Array, pivot: IntArray, n_pivot_rows: int) -> bool:
    """LU in place of the first len(pivot) columns of a (rows, cols), pivots from the first n_pivot_rows rows."""
    rows, cols = a.shape
    regular = True
    for j in range(pivot.shape[0]):
        best, p = abs(a[j, j]), j
        for i in range(j + 1, n_pivot_rows):
            if abs(a[i, j]) > best:
                best, p = abs(a[i, j]), i
        pivot[j] = p
        if not best > 1e-300:
            regular = False
            continue
        if p != j:
            for c in range(cols):
                a[j, c], a[p, c] = a[p, c], a[j, c]
        inverse = 1.0 / a[j, j]
        source = a[j, j + 1 :]
        for i in range(j + 1, rows):
            factor = a[i, j]
            if factor != 0.0:
                factor *= inverse
                a[i, j] = factor
                target = a[i, j + 1 :]
                for c in range(source.shape[0]):
                    target[c] -= factor * source[c]
    return regular


@_compile
def _back_substitute(a: Array, size: int) -> None:
    """Solve U X = B in place, where a (size or more rows) = [U | B] with U upper triangular of order `size`."""
    for i in range(size - 1, -1, -1):
        target = a[i, size:]
        for q in range(i + 1, size):
            factor = a[i, q]
            if factor != 0.0:
                source = a[q, size:]
                for c in range(target.shape[0]):
                    target[c] -= factor * source[c]
        inverse = 1.0 / a[i, i]
        for c in range(target.shape[0]):
            target[c] *= inverse


@_compile
def _forward(lu: Array, pivot: IntArray, x: Array) -> None:
    """Apply the row exchanges, then the inverse unit lower trapezoid of a (rows, columns) LU, to one column in place."""
    for j in range(pivot.shape[0]):
        p = pivot[j]
        if p != j:
            x[j], x[p] = x[p], x[j]
    columns = pivot.shape[0]
    for i in range(1, lu.shape[0]):
        row = lu[i]
        total = 0.0
        for j in range(min(i, columns)):
            total += row[j] * x[j]
        x[i] -= total


@_compile
def _backward(lu: Array, size: int, x: Array) -> None:
    """Solve U x = b in place for the leading upper triangle of order `size`."""
    for i in range(size - 1, -1, -1):
        row = lu[i]
        total = 0.0
        for j in range(i + 1, size):
            total += row[j] * x[j]
        x[i] = (x[i] - total) / row[i]


@_compile
def _condense(widths, matrix, points, n_i, scale, lu, pivot, from_node, from_scalar):  # type: ignore[no-untyped-def]
    """Eliminate the stages of every element; from_node, from_scalar hold d(stage)/dY_e and d(stage)/ds."""
    n_elements, k, n_rows, n_columns = points.shape
    m = n_rows - n_i
    n, n_s = from_node.shape[2], from_scalar.shape[2]
    size = k * m
    work = np.empty((size, size + n + n_s))
    regular = True
    for e in range(n_elements):
        for j in range(k):
            block = points[e, j]
            for row in range(m):
                largest = 0.0
                for c in range(m):
                    largest = max(largest, abs(block[row, c]))
                for c in range(n):
                    largest = max(largest, abs(widths[e] * block[row, m + c]))
                inverse = 1.0 / largest if largest > 0.0 else 1.0
                scale[e, j, row] = inverse
                i = j * m + row
                for stage in range(k):
                    a = widths[e] * matrix[j, stage] * inverse
                    for c in range(n):
                        work[i, stage * m + c] = a * block[row, m + c]
                    for c in range(n, m):
                        work[i, stage * m + c] = 0.0
                for c in range(m):
                    work[i, j * m + c] += inverse * block[row, c]
                for c in range(n):
                    work[i, size + c] = -inverse * block[row, m + c]
                for c in range(n_s):
                    work[i, size + n + c] = -inverse * block[row, m + n + c]
        regular = _lu_rectangular(work, pivot[e], size) and regular
        lu[e] = work[:, :size]
        if regular:
            _back_substitute(work, size)
        from_node[e] = work[:, size : size + n]
        from_scalar[e] = work[:, size + n :]
    return regular


@_compile
def _integral_rows(widths, matrix, weights, points, from_node, from_scalar, local, node_rows, scalar_rows):  # type: ignore[no-untyped-def]
    """Integral rows over nodes and scalars after condensation; `local` keeps their dependence on the stages."""
    n_elements, n_i, n = node_rows.shape
    k, n_s = points.shape[1], scalar_rows.shape[1]
    m = points.shape[2] - n_i
    for e in range(n_elements):
        for q in range(n_i):
            for j in range(k):
                for c in range(m):
                    local[e, q, j * m + c] = widths[e] * weights[j] * points[e, j, m + q, c]
            for j in range(k):
                a = widths[e] * weights[j]
                for c in range(n):
                    node_rows[e, q, c] += a * points[e, j, m + q, m + c]
                    for stage in range(k):
                        local[e, q, stage * m + c] += a * widths[e] * matrix[j, stage] * points[e, j, m + q, m + c]
                for c in range(n_s):
                    scalar_rows[q, c] += a * points[e, j, m + q, m + n + c]
            for i in range(k * m):
                for c in range(n):
                    node_rows[e, q, c] += local[e, q, i] * from_node[e, i, c]
                for c in range(n_s):
                    scalar_rows[q, c] += local[e, q, i] * from_scalar[e, i, c]


@_compile
def _transfer(widths, weights, from_node, from_scalar, m):  # type: ignore[no-untyped-def]
    """G_e (N, n, n) and S_e (N, n, n_s) of Y_{e+1} = G_e Y_e + S_e s."""
    n_elements, size, n = from_node.shape
    n_s = from_scalar.shape[2]
    node = np.zeros((n_elements, n, n))
    scalar = np.zeros((n_elements, n, n_s))
    for e in range(n_elements):
        for i in range(n):
            node[e, i, i] = 1.0
            for j in range(size // m):
                a = widths[e] * weights[j]
                for c in range(n):
                    node[e, i, c] += a * from_node[e, j * m + i, c]
                for c in range(n_s):
                    scalar[e, i, c] += a * from_scalar[e, j * m + i, c]
    return node, scalar


@_compile
def _eliminate_chain(node, scalar, integral, lu, pivot, rows_out, multiplier):  # type: ignore[no-untyped-def]
    """Eliminate Y_1..Y_{N-1}; returns the rows left over (Y_0, Y_N, s): n chain rows and the integral rows.

    The active n rows read A Y_0 + B Y_e + C s = r. Stacked with Y_{e+1} - G_e Y_e - S_e s = r_e and the integral rows they
    lose Y_e by LU with pivots from the 2n chain rows. Columns of the work array: Y_e | Y_0 | Y_{e+1} | s.
    """
    n_elements, n, _ = node.shape
    n_s = scalar.shape[2]
    n_i = integral.shape[1]
    active = np.zeros((n + n_i, 2 * n + n_s))  # columns: Y_0 | Y_e | s
    active[:n, :n] = -node[0]
    for i in range(n):
        active[i, n + i] = 1.0
    active[:n, 2 * n :] = -scalar[0]
    active[n:, :n] = integral[0]
    regular = True
    work = np.empty((2 * n + n_i, 3 * n + n_s))
    for e in range(1, n_elements):
        work[:] = 0.0
        work[:n, :n] = active[:n, n : 2 * n]
        work[:n, n : 2 * n] = active[:n, :n]
        work[:n, 3 * n :] = active[:n, 2 * n :]
        work[n : 2 * n, :n] = -node[e]
        for i in range(n):
            work[n + i, 2 * n + i] = 1.0
        work[n : 2 * n, 3 * n :] = -scalar[e]
        work[2 * n :, :n] = active[n:, n : 2 * n] + integral[e]
        work[2 * n :, n : 2 * n] = active[n:, :n]
        work[2 * n :, 3 * n :] = active[n:, 2 * n :]
        regular = _lu_rectangular(work, pivot[e - 1], 2 * n) and regular
        lu[e - 1] = work[: 2 * n, :n]
        rows_out[e - 1] = work[:n, n:]
        multiplier[e - 1] = work[2 * n :, :n]
        active[:, :n] = work[n:, n : 2 * n]
        active[:, n : 2 * n] = work[n:, 2 * n : 3 * n]
        active[:, 2 * n :] = work[n:, 3 * n :]
    return active, regular


def factorise(
    widths: Array, matrix: Array, weights: Array, points: Array, ends: Array, targets: Array, n: int
) -> Factors:
    """Factorise the bordered collocation system; `singular` is set where a pivot vanished or is not finite.

    points (N, k, m + n_i, m + n + n_s): rows equations then integrands, columns (slope, algebraic), field, scalar.
    ends (n_b, 2n + n_s): columns Y_0, Y_N, scalar. targets (n_i, n_s): d(target)/ds of the integral conditions.
    """
    n_elements, k, n_rows, n_columns = points.shape
    n_i, n_s = targets.shape
    m = n_rows - n_i
    if n_columns != m + n + n_s or ends.shape != (n + n_s - n_i, 2 * n + n_s):
        raise ValueError(f"blocks do not fit: points {points.shape}, ends {ends.shape}, targets {targets.shape}, n = {n}")
    size = k * m
    scale = np.empty((n_elements, k, m))
    local_lu = np.empty((n_elements, size, size))
    local_pivot = np.empty((n_elements, size), dtype=np.int64)
    from_node, from_scalar = np.empty((n_elements, size, n)), np.empty((n_elements, size, n_s))
    regular = _condense(widths, matrix, points, n_i, scale, local_lu, local_pivot, from_node, from_scalar)
    local = np.zeros((n_elements, n_i, size))
    integral, integral_scalar = np.zeros((n_elements, n_i, n)), -targets
    _integral_rows(widths, matrix, weights, points, from_node, from_scalar, local, integral, integral_scalar)
    node, scalar = _transfer(widths, weights, from_node, from_scalar, m)
    chain_lu = np.empty((n_elements - 1, 2 * n, n))
    chain_pivot = np.empty((n_elements - 1, n), dtype=np.int64)
    chain_rows = np.empty((n_elements - 1, n, 2 * n + n_s))
    multiplier = np.empty((n_elements - 1, n_i, n))
    active, chain_regular = _eliminate_chain(node, scalar, integral, chain_lu, chain_pivot, chain_rows, multiplier)
    dense = np.zeros((2 * n + n_s, 2 * n + n_s))
    dense[: n + n_i] = active
    dense[n : n + n_i, 2 * n :] += integral_scalar
    dense[n + n_i :] = ends
    largest = np.abs(dense).max(axis=1)
    border_scale = 1.0 / np.where(largest > 0.0, largest, 1.0)
    dense *= border_scale[:, None]
    border_pivot = np.empty(len(dense), dtype=np.int64)
    border_regular = _lu_rectangular(dense, border_pivot, len(dense))
    singular = not (regular and chain_regular and border_regular and np.isfinite(dense).all())
    return Factors(
        widths, matrix, weights, scale, local_lu, local_pivot, from_node, from_scalar, chain_lu, chain_pivot, chain_rows,
        multiplier, local, dense, border_pivot, border_scale, singular,
    )  # fmt: skip


@_compile
def _solve(factors, continuity, stages, end_rows, integral_rows):  # type: ignore[no-untyped-def]
    """One right-hand side through the factors; stages (N, k, m) is overwritten by the stage solution."""
    widths, weights = factors.widths, factors.weights
    n_elements, k, m = stages.shape
    n = continuity.shape[1]
    n_i = integral_rows.shape[0]
    particular = np.empty((n_elements, k * m))
    defect = continuity.copy()
    for e in range(n_elements):
        for j in range(k):
            for row in range(m):
                particular[e, j * m + row] = stages[e, j, row] * factors.row_scale[e, j, row]
        _forward(factors.local_lu[e], factors.local_pivot[e], particular[e])
        _backward(factors.local_lu[e], k * m, particular[e])
        for j in range(k):
            for i in range(n):
                defect[e, i] += widths[e] * weights[j] * particular[e, j * m + i]
    integral = integral_rows.copy()
    for e in range(n_elements):
        for q in range(n_i):
            integral[q] -= np.dot(factors.integral_local[e, q], particular[e])
    active = defect[0].copy()
    eliminated = np.empty((n_elements - 1, n))
    work = np.empty(2 * n)
    for e in range(1, n_elements):
        work[:n] = active
        work[n:] = defect[e]
        _forward(factors.chain_lu[e - 1], factors.chain_pivot[e - 1], work)
        eliminated[e - 1] = work[:n]
        for q in range(n_i):
            integral[q] -= np.dot(factors.integral_multiplier[e - 1, q], work[:n])
        active = work[n:].copy()
    dense = np.empty(factors.border_lu.shape[0])
    dense[:n] = active
    dense[n : n + n_i] = integral
    dense[n + n_i :] = end_rows
    dense *= factors.border_scale
    _forward(factors.border_lu, factors.border_pivot, dense)
    _backward(factors.border_lu, dense.shape[0], dense)
    nodes = np.empty((n_elements + 1, n))
    nodes[0], nodes[n_elements], scalars = dense[:n], dense[n : 2 * n], dense[2 * n :].copy()
    coupled = np.empty(factors.chain_rows.shape[2])
    for e in range(n_elements - 1, 0, -1):
        coupled[:n], coupled[n : 2 * n], coupled[2 * n :] = nodes[0], nodes[e + 1], scalars
        for i in range(n):
            nodes[e, i] = eliminated[e - 1, i] - np.dot(factors.chain_rows[e - 1, i], coupled)
        _backward(factors.chain_lu[e - 1], n, nodes[e])
    for e in range(n_elements):
        for i in range(k * m):
            value = particular[e, i]
            for c in range(n):
                value += factors.from_node[e, i, c] * nodes[e, c]
            for c in range(scalars.shape[0]):
                value += factors.from_scalar[e, i, c] * scalars[c]
            stages[e, i // m, i % m] = value
    return nodes, scalars


def solve(factors: Factors, rhs: Update, n_integral: int) -> Update:
    """Solve for one right-hand side: rhs.nodes (N, n) continuity, rhs.stages (N, k, m), rhs.border = (end rows, integral rows).

    Returns nodes (N + 1, n), stages (N, k, m) over (slope, algebraic), border = scalars (n_s,).
    """
    stages = rhs.stages.copy()
    n_end = len(rhs.border) - n_integral
    nodes, scalars = _solve(factors, rhs.nodes, stages, rhs.border[:n_end], rhs.border[n_end:])
    return Update(nodes, stages, scalars)
