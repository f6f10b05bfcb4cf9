"""Factorisation of a linearised collocation system: local elimination, chain elimination, border.

Unknowns: node values Y_0..Y_N (n), per element k stages of slopes (n) and algebraic fields (n_a), scalars s (n_s).

    stage (e, j):   D_ej [slope_ej; alg_ej] + Fy_ej (Y_e + w_e sum_l a_jl slope_el) + Fs_ej s = f_ej        m = n + n_a rows
    continuity e:   Y_{e+1} - Y_e - w_e sum_l b_l slope_el = g_e                                            n rows
    end rows:       B0 Y_0 + B1 Y_N + Bs s = e                                                              n_b rows
    integral rows:  sum_ej w_e b_j (Id_ej [slope; alg] + Iy_ej y_ej + Is_ej s) - T s = i                    n_i rows

with n_b + n_i = n + n_s. Continuity rows may also contain scalars, and integral rows node values: borders of the system need
both. Each element is condensed to a relation of its end values (elimination.py), interior nodes are eliminated one after
another with row pivoting across neighbouring relations (stable for growing and decaying solutions alike), and a dense
system in (Y_0, Y_N, s) closes the border. The loops run in numba: LAPACK's overhead on blocks this small costs several times
the arithmetic (docs/decisions/0001-linear-algebra-in-numba.md).
"""

from typing import NamedTuple

import numpy as np

from shapespace.numerics.elimination import LocalFactors, eliminate_stages, solve_stages
from shapespace.numerics.plan import Plan, make_plan
from shapespace.numerics.small_lu import Array, IntArray, backward, compiled, copy, forward, lu_rectangular, read_only

NO_PIVOT = 1e-14
"""Pivots of the border smaller than this part of their column count as vanished."""


class Factors(NamedTuple):
    """Everything `solve` needs, as plain arrays.

    plan, local: elimination of the stages. chain (N-1, 2n + n_i, 3n + n_s), chain_pivot (N-1, n): LU of the rows that lose
    Y_e, columns Y_e | Y_{e+1} | Y_0 | s. local_integral (n_i, k m, N): integral rows over the stages, in pivot order.
    """

    widths: Array
    weights: Array
    plan: Plan
    local: LocalFactors
    chain: Array
    chain_pivot: IntArray
    local_integral: Array
    border_lu: Array
    border_pivot: IntArray
    border_scale: Array
    singular: bool


@compiled
def _integral_rows(
    widths: Array, matrix: Array, weights: Array, points: Array, position: IntArray, response: Array, pivoted: IntArray,
    dense: Array, local: Array, nodes: Array, scalars: Array,
) -> None:  # fmt: skip
    """Add integral rows over nodes (N + 1, n_i, n) and scalars (n_i, n_s) after condensation; `local` over the stages."""
    n_i, size, n_elements = local.shape
    n, n_s, k = nodes.shape[2], scalars.shape[1], points.shape[2]
    m = size // k
    for q in range(n_i):
        total = np.zeros((n + n_s, n_elements))
        for j in range(k):
            for c in range(m + n + n_s):
                source = points[m + q, c, j]
                if not source.any():
                    continue
                target = local[q, position[j * m + c]] if c < m else total[c - m]
                for e in range(n_elements):
                    target[e] += widths[e] * weights[j] * source[e]
                if m <= c < m + n:
                    for stage in range(k):
                        target = local[q, position[stage * m + c - m]]
                        for e in range(n_elements):
                            target[e] += widths[e] * weights[j] * source[e] * widths[e] * matrix[j, stage]
        for i in range(size):
            row = local[q, i]
            if not row.any():
                continue
            for c in range(n + n_s):
                target, source = total[c], response[i, c]
                for e in range(n_elements):
                    target[e] -= row[e] * source[e]
            for index in range(pivoted.shape[0]):
                e = pivoted[index]
                for c in range(n):
                    nodes[e + 1, q, c] -= row[e] * dense[index, i, size + n + c]
        for c in range(n):
            for e in range(n_elements):
                nodes[e, q, c] += total[c, e]
        for c in range(n_s):
            for e in range(n_elements):
                scalars[q, c] += total[n + c, e]


@compiled
def _eliminate_chain(relations: Array, integral: Array, chain: Array, pivot: IntArray) -> tuple[Array, bool]:
    """Eliminate Y_1..Y_{N-1}; returns the rows left over (Y_0, Y_N, s): n chain rows and the integral rows.

    The active n rows read A Y_0 + B Y_e + C s = r. Stacked with the relation of (Y_e, Y_{e+1}, s) and the integral rows they
    lose Y_e by LU with pivots from the 2n chain rows, in place in chain[e - 1], which is zero on entry.
    """
    n_elements, n, columns = relations.shape
    n_i, n_s = integral.shape[1], columns - 2 * n
    regular = True
    # What is left over lacks the first n columns: the first element's rows stand as if Y_0 were both Y_0 and gone.
    active = np.zeros((n + n_i, 3 * n + n_s))
    copy(active[:n, n : 2 * n], relations[0, :, n : 2 * n])
    copy(active[:n, 2 * n : 3 * n], relations[0, :, :n])
    copy(active[:n, 3 * n :], relations[0, :, 2 * n :])
    copy(active[n:, n : 2 * n], integral[1])
    copy(active[n:, 2 * n : 3 * n], integral[0])
    for e in range(1, n_elements):
        work = chain[e - 1]
        for part, source in ((work[:n], active[:n]), (work[2 * n :], active[n:])):
            copy(part[:, :n], source[:, n : 2 * n])
            copy(part[:, 2 * n :], source[:, 2 * n :])
        copy(work[n : 2 * n, : 2 * n], relations[e, :, : 2 * n])
        copy(work[n : 2 * n, 3 * n :], relations[e, :, 2 * n :])
        copy(work[2 * n :, n : 2 * n], integral[e + 1])
        regular = lu_rectangular(work, pivot[e - 1], 2 * n) and regular
        active = work[n:]
    border = np.empty((n + n_i, 2 * n + n_s))
    copy(border[:, :n], active[:, 2 * n : 3 * n])
    copy(border[:, n : 2 * n], active[:, n : 2 * n])
    copy(border[:, 2 * n :], active[:, 3 * n :])
    return border, regular


@compiled
def _condense(
    widths: Array, matrix: Array, weights: Array, points: Array, ends: Array, targets: Array, position: IntArray,
    response: Array, pivoted: IntArray, dense: Array, relations: Array, integral: Array,
) -> tuple[tuple[Array, IntArray, Array, Array, IntArray, Array], bool]:  # fmt: skip
    """Chain and border from the relations; the factors from `chain` to `border_scale`, and whether both are regular."""
    n_elements, n, size = relations.shape
    n_i = targets.shape[0]
    local, scalars = np.zeros((n_i, position.shape[0], n_elements)), -targets
    _integral_rows(widths, matrix, weights, points, position, response, pivoted, dense, local, integral, scalars)
    chain = np.zeros((n_elements - 1, 2 * n + n_i, size + n))
    chain_pivot = np.zeros((n_elements - 1, n), dtype=np.int64)
    border = np.zeros((size, size))
    active, regular = _eliminate_chain(relations, integral, chain, chain_pivot)
    copy(border[: n + n_i], active)
    copy(border[n + n_i :], ends)
    for q in range(n_i):
        for c in range(size - 2 * n):
            border[n + q, 2 * n + c] += scalars[q, c]
    scale, largest = np.empty(size), np.zeros(size)
    for i in range(size):
        top = 0.0
        for c in range(size):
            top = max(top, abs(border[i, c]))
        scale[i] = 1.0 / top if top > 0.0 else 1.0
        for c in range(size):
            border[i, c] *= scale[i]
            largest[c] = max(largest[c], abs(border[i, c]))
    pivot = np.zeros(size, dtype=np.int64)
    regular = lu_rectangular(border, pivot, size) and regular
    # NaN and infinity in any block reach the border, where no comparison with them holds.
    for i in range(size):
        regular = regular and abs(border[i, i]) > NO_PIVOT * largest[i]
    return (chain, chain_pivot, local, border, pivot, scale), regular


def factorise(
    widths: Array,
    matrix: Array,
    weights: Array,
    points: Array,
    ends: Array,
    targets: Array,
    n: int,
    jumps: Array | None = None,
    nodes: Array | None = None,
) -> Factors:
    """Factorise the bordered collocation system; `singular` is set where no unique solution exists to working accuracy.

    points (m + n_i, m + n + n_s, k, N): rows equations then integrands, columns (slope, algebraic), field, scalar.
    ends (n_b, 2n + n_s): columns Y_0, Y_N, scalar. targets (n_i, n_s): d(target)/ds of the integral conditions.
    jumps (N, n, n_s): scalars in the continuity rows; nodes (N + 1, n_i, n): node values in the integral rows.
    """
    n_rows, n_columns, _, n_elements = points.shape
    n_i, n_s = targets.shape
    m = n_rows - n_i
    if n_columns != m + n + n_s or ends.shape != (n + n_s - n_i, 2 * n + n_s):
        raise ValueError(
            f"blocks do not fit: points {points.shape}, ends {ends.shape}, targets {targets.shape}, n = {n}."
        )
    points, ends, targets = read_only(points), read_only(ends), read_only(targets)
    jumps = np.zeros((n_elements, n, n_s)) if jumps is None else jumps
    integral = np.zeros((n_elements + 1, n_i, n)) if nodes is None else nodes.copy()
    plan = make_plan(widths, matrix, points, n, m)
    local, relations, regular = eliminate_stages(widths, weights, matrix, points, jumps, m, plan)
    (chain, chain_pivot, local_integral, border_lu, border_pivot, border_scale), closed = _condense(
        widths, matrix, weights, points, ends, targets, plan.position, local.response, local.pivoted, local.dense, relations,
        integral,
    )  # fmt: skip
    return Factors(
        widths, weights, plan, local, chain, chain_pivot, local_integral, border_lu, border_pivot, border_scale,
        singular=not (regular and closed),
    )  # fmt: skip


def determinant_sign(factors: Factors) -> float:
    """Sign of the determinant of the whole matrix, up to a factor that depends on N, k and the numbers of rows only."""
    f, plan, local = factors, factors.plan, factors.local
    if f.singular:
        return 0.0
    sign = (-1.0) ** (plan.inversions * (len(plan.position) // len(plan.partner) * len(f.widths)) % 2)
    sign *= _signs_of_stages(local.work[: len(plan.position)], local.pivoted)
    for lu, exchanges in (
        (local.dense, local.exchanges),
        (f.chain, f.chain_pivot),
        (f.border_lu[None], f.border_pivot[None]),
    ):
        sign *= _signs_of_pivots(lu, exchanges)
    return float(sign)


@compiled
def _signs_of_stages(pivots: Array, others: IntArray) -> float:
    """Product of the signs of pivots (k m, N), but for those of other elements (M,)."""
    sign = 1.0
    for i in range(pivots.shape[0]):
        for value in pivots[i]:
            if value < 0.0:
                sign = -sign
        for e in others:
            if pivots[i, e] < 0.0:
                sign = -sign
    return sign


@compiled
def _signs_of_pivots(lu: Array, exchanges: IntArray) -> float:
    """Product of the signs of determinants from their LU (M, rows, columns) and exchanges (M, pivots)."""
    sign = 1.0
    for index in range(exchanges.shape[0]):
        for j in range(exchanges.shape[1]):
            sign *= np.sign(lu[index, j, j])
            if exchanges[index, j] != j:
                sign = -sign
    return sign


@compiled
def _solve_chain(
    chain: Array, pivot: IntArray, defect: Array, integral: Array, ends: Array, border_lu: Array,
    border_pivot: IntArray, border_scale: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Node values (N + 1, n) and scalars (n_s,) from the condensed right-hand side."""
    n_elements, n = defect.shape
    nodes = np.empty((n_elements + 1, n))
    work = np.concatenate((defect[0], defect[0], integral))
    for e in range(1, n_elements):
        for i in range(n):
            work[i], work[n + i] = work[n + i], defect[e, i]
        forward(chain[e - 1], pivot[e - 1], work)
        for i in range(n):
            nodes[e, i] = work[i]
    dense = np.concatenate((work[n:], ends)) * border_scale
    forward(border_lu, border_pivot, dense)
    backward(border_lu, dense.shape[0], dense)
    for i in range(n):
        nodes[0, i], nodes[n_elements, i] = dense[i], dense[n + i]
    # As the columns of the chain: Y_e | Y_{e+1} | Y_0 | s.
    row = np.concatenate((dense[:n], dense[:n], dense[:n], dense[2 * n :]))
    for e in range(n_elements - 1, 0, -1):
        for i in range(n):
            row[i], row[n + i] = nodes[e, i], nodes[e + 1, i]
        backward(chain[e - 1], n, row)
        for i in range(n):
            nodes[e, i] = row[i]
    return nodes, dense[2 * n :]


@compiled
def _add_coupling(response: Array, pivoted: IntArray, dense: Array, x: Array, nodes: Array, scalars: Array) -> None:
    """Turn the particular stage solution x (k m, N), in pivot order, into the stages that go with nodes and scalars."""
    size, n_elements = x.shape
    n = nodes.shape[1]
    left = nodes[:n_elements].T.copy()
    for i in range(size):
        target = x[i]
        for c in range(n):
            factor, source = response[i, c], left[c]
            for e in range(n_elements):
                target[e] -= factor[e] * source[e]
        for c in range(scalars.shape[0]):
            factor, scalar = response[i, n + c], scalars[c]
            for e in range(n_elements):
                target[e] -= factor[e] * scalar
        for index in range(pivoted.shape[0]):
            e = pivoted[index]
            for c in range(n):
                target[e] -= dense[index, i, size + n + c] * nodes[e + 1, c]


@compiled
def _solve(
    widths: Array, weights: Array, position: IntArray, partner: IntArray, lower: IntArray, upper: IntArray, work: Array,
    response: Array, scale: Array, pivoted: IntArray, dense: Array, exchanges: IntArray, relation_scale: Array,
    chain: Array, chain_pivot: IntArray, local_integral: Array, border_lu: Array, border_pivot: IntArray,
    border_scale: Array, residual: Array,
) -> Array:  # fmt: skip
    """The whole solve: residual (equations (N, k, m), continuity (N, n), ends, integrals), all flat, to x, flat."""
    size, n_elements = scale.shape
    m, n, n_i = partner.shape[0], relation_scale.shape[1], local_integral.shape[0]
    k = size // m
    n_stage, n_chain = n_elements * size, n_elements * n
    x, defect = solve_stages(
        work, scale, pivoted, dense, exchanges, relation_scale, position, partner, lower, upper, widths, weights,
        residual[:n_stage], residual[n_stage : n_stage + n_chain],
    )  # fmt: skip
    border = residual[n_stage + n_chain :]
    n_end = border.shape[0] - n_i
    integral = border[n_end:].copy()
    for q in range(n_i):
        for i in range(size):
            for e in range(n_elements):
                integral[q] -= local_integral[q, i, e] * x[i, e]
    nodes, scalars = _solve_chain(
        chain, chain_pivot, defect, integral, border[:n_end], border_lu, border_pivot, border_scale
    )
    _add_coupling(response, pivoted, dense, x, nodes, scalars)
    out = np.empty(nodes.size + n_elements * size + scalars.shape[0])
    for i in range(nodes.size):
        out[i] = nodes.flat[i]
    slopes, algebraic = nodes.size, nodes.size + n_elements * k * n
    for j in range(k):
        for c in range(m):
            source = x[position[j * m + c]]
            for e in range(n_elements):
                point = e * k + j
                if c < n:
                    out[slopes + point * n + c] = source[e]
                else:
                    out[algebraic + point * (m - n) + c - n] = source[e]
    for i in range(scalars.shape[0]):
        out[nodes.size + n_elements * size + i] = scalars[i]
    return out


def solve(factors: Factors, residual: Array) -> Array:
    """The increment x (nodes, slopes, algebraic, scalars) for a residual (equations, continuity, ends, integrals), flat."""
    f, plan = factors, factors.plan
    return np.asarray(
        _solve(
            f.widths, f.weights, plan.position, plan.partner, plan.lower, plan.upper, *f.local, f.chain, f.chain_pivot,
            f.local_integral, f.border_lu, f.border_pivot, f.border_scale, np.ascontiguousarray(residual),
        )
    )  # fmt: skip
