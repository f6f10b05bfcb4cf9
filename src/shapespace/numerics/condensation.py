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

from shapespace.numerics.elimination import LocalFactors, Plan, eliminate_stages, make_plan, solve_stages
from shapespace.numerics.small_lu import Array, IntArray, backward, compiled, forward, lu_rectangular

NO_PIVOT = 1e-14
"""Pivots of the border smaller than this part of their column count as vanished."""


class Factors(NamedTuple):
    """Everything `solve` needs, as plain arrays.

    plan: pivot order of the stages; local: their factors. chain_lu (N-1, 2n, n), chain_pivot (N-1, n), chain_rows
    (N-1, n, 2n + n_s) over (Y_0, Y_{e+1}, s), chain_integral (N-1, n_i, n): multipliers of the integral rows.
    local_integral (n_i, k m, N): integral rows over the stages, in pivot order.
    """

    widths: Array
    weights: Array
    plan: Plan
    local: LocalFactors
    chain_lu: Array
    chain_pivot: IntArray
    chain_rows: Array
    chain_integral: Array
    local_integral: Array
    border_lu: Array
    border_pivot: IntArray
    border_scale: Array
    singular: bool


@compiled
def _integral_rows(  # type: ignore[no-untyped-def]
    widths, matrix, weights, points, position, work, pivoted, right, local, nodes, scalars
):
    """Add integral rows over nodes (N + 1, n_i, n) and scalars (n_i, n_s) after condensation; `local` over the stages."""
    n_i, size, n_elements = local.shape
    n, n_s, k = nodes.shape[2], scalars.shape[1], points.shape[2]
    m = size // k
    for q in range(n_i):
        for j in range(k):
            for c in range(m):
                for e in range(n_elements):
                    local[q, position[j * m + c], e] += widths[e] * weights[j] * points[m + q, c, j, e]
            for c in range(n):
                for e in range(n_elements):
                    a = widths[e] * weights[j] * points[m + q, m + c, j, e]
                    nodes[e, q, c] += a
                    for stage in range(k):
                        local[q, position[stage * m + c], e] += a * widths[e] * matrix[j, stage]
            for c in range(n_s):
                for e in range(n_elements):
                    scalars[q, c] += widths[e] * weights[j] * points[m + q, m + n + c, j, e]
        for i in range(size):
            for c in range(n):
                for e in range(n_elements):
                    nodes[e, q, c] += local[q, i, e] * work[i, size + c, e]
            for c in range(n_s):
                for e in range(n_elements):
                    scalars[q, c] += local[q, i, e] * work[i, size + n + c, e]
            for index in range(pivoted.shape[0]):
                e = pivoted[index]
                for c in range(n):
                    nodes[e + 1, q, c] += local[q, i, e] * right[index, i, c]


@compiled
def _eliminate_chain(relations, integral, lu, pivot, rows, multiplier):  # type: ignore[no-untyped-def]
    """Eliminate Y_1..Y_{N-1}; returns the rows left over (Y_0, Y_N, s): n chain rows and the integral rows.

    The active n rows read A Y_0 + B Y_e + C s = r. Stacked with the relation of (Y_e, Y_{e+1}, s) and the integral rows they
    lose Y_e by LU with pivots from the 2n chain rows. Columns of the work array: Y_e | Y_0 | Y_{e+1} | s.
    """
    n_elements, n, columns = relations.shape
    n_s = columns - 2 * n
    n_i = integral.shape[1]
    width = 3 * n + n_s
    regular = True
    work = np.zeros((2 * n + n_i, width))
    # The first element's rows stand where the rows left over from a step would: Y_0 in the second, Y_1 in the third block.
    for i in range(n):
        for c in range(n):
            work[n + i, n + c] = relations[0, i, c]
            work[n + i, 2 * n + c] = relations[0, i, n + c]
        for c in range(n_s):
            work[n + i, 3 * n + c] = relations[0, i, 2 * n + c]
    for q in range(n_i):
        for c in range(n):
            work[2 * n + q, n + c] = integral[0, q, c]
            work[2 * n + q, 2 * n + c] = integral[1, q, c]
    for e in range(1, n_elements):
        for i in range(n + n_i):
            row = i if i < n else i + n
            for c in range(n):
                work[row, c] = work[n + i, 2 * n + c]
                work[row, n + c] = work[n + i, n + c]
                work[row, 2 * n + c] = 0.0
            for c in range(3 * n, width):
                work[row, c] = work[n + i, c]
        for i in range(n):
            for c in range(n):
                work[n + i, c] = relations[e, i, c]
                work[n + i, n + c] = 0.0
                work[n + i, 2 * n + c] = relations[e, i, n + c]
            for c in range(n_s):
                work[n + i, 3 * n + c] = relations[e, i, 2 * n + c]
        for q in range(n_i):
            for c in range(n):
                work[2 * n + q, 2 * n + c] += integral[e + 1, q, c]
        regular = lu_rectangular(work, pivot[e - 1], 2 * n) and regular
        for i in range(2 * n + n_i):
            for c in range(n):
                if i < 2 * n:
                    lu[e - 1, i, c] = work[i, c]
                else:
                    multiplier[e - 1, i - 2 * n, c] = work[i, c]
        for i in range(n):
            for c in range(n, width):
                rows[e - 1, i, c - n] = work[i, c]
    active = work[n:, n:].copy()
    return active, regular


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
    n_rows, n_columns, k, n_elements = points.shape
    n_i, n_s = targets.shape
    m = n_rows - n_i
    if n_columns != m + n + n_s or ends.shape != (n + n_s - n_i, 2 * n + n_s):
        raise ValueError(
            f"blocks do not fit: points {points.shape}, ends {ends.shape}, targets {targets.shape}, n = {n}."
        )
    finite = bool(np.isfinite(points).all() and np.isfinite(ends).all())
    if not finite:
        points, ends = np.nan_to_num(points, posinf=0.0, neginf=0.0), np.nan_to_num(ends, posinf=0.0, neginf=0.0)
    jumps = np.zeros((n_elements, n, n_s)) if jumps is None else jumps
    integral = np.zeros((n_elements + 1, n_i, n)) if nodes is None else nodes.copy()
    plan = make_plan(widths, matrix, points, n, m)
    local, relations, regular = eliminate_stages(widths, weights, matrix, points, jumps, m, plan)
    local_integral, integral_scalar = np.zeros((n_i, k * m, n_elements)), -targets
    _integral_rows(
        widths, matrix, weights, points, plan.position, local.work, local.pivoted, local.right, local_integral, integral,
        integral_scalar,
    )  # fmt: skip
    chain = (
        np.empty((n_elements - 1, 2 * n, n)),
        np.empty((n_elements - 1, n), dtype=np.int64),
        np.empty((n_elements - 1, n, 2 * n + n_s)),
        np.empty((n_elements - 1, n_i, n)),
    )
    dense = np.zeros((2 * n + n_s, 2 * n + n_s))
    dense[: n + n_i], chain_regular = _eliminate_chain(relations, integral, *chain)
    dense[n : n + n_i, 2 * n :] += integral_scalar
    dense[n + n_i :] = ends
    largest = np.abs(dense).max(axis=1)
    border_scale = 1.0 / np.where(largest > 0.0, largest, 1.0)
    dense *= border_scale[:, None]
    columns = np.abs(dense).max(axis=0)
    border_pivot = np.empty(len(dense), dtype=np.int64)
    border_regular = lu_rectangular(dense, border_pivot, len(dense))
    pivots = np.abs(np.diagonal(dense))
    distinct = border_regular and bool((pivots > NO_PIVOT * columns).all())
    singular = not (regular and chain_regular and distinct and finite)
    return Factors(widths, weights, plan, local, *chain, local_integral, dense, border_pivot, border_scale, singular)


def determinant_sign(factors: Factors) -> float:
    """Sign of the determinant of the whole matrix, up to a factor that depends on N, k and the numbers of rows only."""
    f, k = factors, factors.local.work.shape[0] // len(factors.plan.partner)
    size, elements = f.local.work.shape[0], f.local.work.shape[2]
    alone = np.setdiff1d(np.arange(elements), f.local.pivoted)
    signs = [
        np.sign(np.diagonal(f.local.work[:, :size])[alone]),
        np.sign(np.diagonal(f.local.lu[:, :size], axis1=1, axis2=2)),
        np.sign(np.diagonal(f.chain_lu, axis1=1, axis2=2)),
        np.sign(np.diagonal(f.border_lu)),
    ]
    exchanges = [f.local.exchanges, f.chain_pivot, f.border_pivot]
    odd = sum(int((e != np.arange(e.shape[-1])).sum()) for e in exchanges)
    matching = np.linalg.det(np.eye(len(f.plan.partner))[f.plan.partner]) ** (k * elements)
    return float(np.prod([part.prod() for part in signs]) * (-1.0) ** odd * np.round(matching))


@compiled
def _solve_chain(lu, pivot, rows, multiplier, defect, integral, ends, border_lu, border_pivot, border_scale):  # type: ignore[no-untyped-def]
    """Node values (N + 1, n) and scalars (n_s,) from the condensed right-hand side; `integral` is overwritten."""
    n_elements, n = defect.shape
    n_i = integral.shape[0]
    eliminated = np.empty((n_elements - 1, n))
    work = np.empty(2 * n)
    for i in range(n):
        work[n + i] = defect[0, i]
    for e in range(1, n_elements):
        for i in range(n):
            work[i] = work[n + i]
            work[n + i] = defect[e, i]
        forward(lu[e - 1], pivot[e - 1], work)
        for i in range(n):
            eliminated[e - 1, i] = work[i]
            for q in range(n_i):
                integral[q] -= multiplier[e - 1, q, i] * work[i]
    dense = np.empty(border_lu.shape[0])
    for i in range(n):
        dense[i] = work[n + i]
    for i in range(n_i):
        dense[n + i] = integral[i]
    for i in range(ends.shape[0]):
        dense[n + n_i + i] = ends[i]
    for i in range(dense.shape[0]):
        dense[i] *= border_scale[i]
    forward(border_lu, border_pivot, dense)
    backward(border_lu, dense.shape[0], dense)
    nodes = np.empty((n_elements + 1, n))
    for i in range(n):
        nodes[0, i] = dense[i]
        nodes[n_elements, i] = dense[n + i]
    scalars = dense[2 * n :]
    for e in range(n_elements - 1, 0, -1):
        for i in range(n):
            total = eliminated[e - 1, i]
            for c in range(n):
                total -= rows[e - 1, i, c] * nodes[0, c] + rows[e - 1, i, n + c] * nodes[e + 1, c]
            for c in range(scalars.shape[0]):
                total -= rows[e - 1, i, 2 * n + c] * scalars[c]
            nodes[e, i] = total
        backward(lu[e - 1], n, nodes[e])
    return nodes, scalars


@compiled
def _add_coupling(work, pattern, pivoted, right, x, nodes, scalars):  # type: ignore[no-untyped-def]
    """Turn the particular stage solution x (k m, N), in pivot order, into the stages that go with nodes and scalars."""
    size, n_elements = x.shape
    n = nodes.shape[1]
    left = np.empty((n, n_elements))
    for c in range(n):
        for e in range(n_elements):
            left[c, e] = nodes[e, c]
    for i in range(size):
        target = x[i]
        for c in range(n):
            if pattern[i, size + c]:
                factor, source = work[i, size + c], left[c]
                for e in range(n_elements):
                    target[e] += factor[e] * source[e]
        for c in range(scalars.shape[0]):
            if pattern[i, size + n + c]:
                factor = work[i, size + n + c]
                for e in range(n_elements):
                    target[e] += factor[e] * scalars[c]
        for index in range(pivoted.shape[0]):
            e = pivoted[index]
            for c in range(n):
                target[e] += right[index, i, c] * nodes[e + 1, c]


@compiled
def _solve(  # type: ignore[no-untyped-def]
    widths, weights, position, partner, work, pattern, scale, pivoted, pivoted_lu, exchanges, right, relation_scale,
    chain_lu, chain_pivot, chain_rows, chain_integral, local_integral, border_lu, border_pivot, border_scale, residual,
):  # fmt: skip
    """The whole solve: residual (equations (N, k, m), continuity (N, n), ends, integrals), all flat, to x, flat."""
    size, n_elements = scale.shape
    m, n, n_i = partner.shape[0], chain_lu.shape[2], local_integral.shape[0]
    k = size // m
    n_stage, n_chain = n_elements * size, n_elements * n
    x, defect = solve_stages(
        work, pattern, scale, pivoted, pivoted_lu, exchanges, right, relation_scale, position, partner, widths, weights,
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
        chain_lu, chain_pivot, chain_rows, chain_integral, defect, integral, border[:n_end], border_lu, border_pivot,
        border_scale,
    )  # fmt: skip
    _add_coupling(work, pattern, pivoted, right, x, nodes, scalars)
    out = np.empty(nodes.size + n_elements * size + scalars.shape[0])
    out[: nodes.size] = nodes.ravel()
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
    out[out.shape[0] - scalars.shape[0] :] = scalars
    return out


def solve(factors: Factors, residual: Array) -> Array:
    """The increment x (nodes, slopes, algebraic, scalars) for a residual (equations, continuity, ends, integrals), flat."""
    f = factors
    return np.asarray(
        _solve(
            f.widths, f.weights, *f.plan, *f.local, f.chain_lu, f.chain_pivot, f.chain_rows, f.chain_integral,
            f.local_integral, f.border_lu, f.border_pivot, f.border_scale, np.ascontiguousarray(residual),
        )
    )  # fmt: skip
