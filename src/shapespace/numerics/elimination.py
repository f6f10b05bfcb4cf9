"""Local elimination: the stages of all elements at once, by one sparse elimination whose inner loops run over elements.

All elements share one pattern of non-zeros, so rows are matched to unknowns and pivots ordered once per pattern (weighted
matching, then Markowitz' rule), and each scalar operation of the elimination becomes a vector operation over elements.
What is left of an element is a relation of its end values and the scalars, n rows over (Y_e, Y_{e+1}, s).

Pivots from the stage equations alone assume that Y_e determines the stages. Beside a pole it does not: collocation follows
solutions like r, r^2, ... exactly, and they start from zero on the axis. The first and the last element, and those whose
multipliers exceed GROWTH_LIMIT, are therefore eliminated each on its own, with pivots from its continuity rows as well, so that
Y_e and Y_{e+1} determine the stages together. The border of a flat disc then has a condition number of 1e2 instead of 1e16.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from shapespace.numerics.small_lu import Array, BoolArray, IntArray, backward, compiled, forward, lu_rectangular

GROWTH_LIMIT = 1e4
"""Multipliers this large would cost about four digits."""


class Plan(NamedTuple):
    """position: of each unknown (stage m + column) in the pivot order, (k m,); partner: row -> column within a stage, (m,)."""

    position: IntArray
    partner: IntArray


class LocalFactors(NamedTuple):
    """Eliminated stages. work (k m, k m + n + n_s, N): upper triangle and multipliers, then d(stage)/d(Y_e, s).

    pattern (k m, k m + n + n_s): non-zeros; scale (k m, N): row scaling. pivoted (M,): elements eliminated with their
    continuity rows, whose LU is lu (M, k m + n, k m) with row exchanges (M, k m); right (M, k m, n): d(stage)/dY_{e+1};
    relation_scale (M, n): scaling of the rows left over.
    """

    work: Array
    pattern: BoolArray
    scale: Array
    pivoted: IntArray
    lu: Array
    exchanges: IntArray
    right: Array
    relation_scale: Array


def make_plan(widths: Array, matrix: Array, points: Array, n: int, n_equations: int) -> Plan:
    """The pivot plan for stage blocks points (rows, columns, k, N), of which the first n_equations rows are equations."""
    strength = _strengths(points, n_equations)
    m, structure = n_equations, strength > 0.0
    own = strength[:, :m].copy()
    own[:, :n] += 0.1 * widths.max() * matrix.diagonal().max() * strength[:, m : m + n]
    # Decades only, so that round-off and slow drift keep the plan.
    cost = np.full((m, m), 1e3)
    cost[own > 0.0] = -np.round(0.5 * np.log10(own[own > 0.0]))
    return _plan(cost.tobytes(), structure.tobytes(), m, n, points.shape[1], matrix.shape[0])


@compiled
def _strengths(points, m):  # type: ignore[no-untyped-def]
    """Largest magnitude over all stages of each entry of the equations' blocks, (m, columns)."""
    _, columns, k, n_elements = points.shape
    out = np.zeros((m, columns))
    for row in range(m):
        for c in range(columns):
            largest = 0.0
            for j in range(k):
                for e in range(n_elements):
                    largest = max(largest, abs(points[row, c, j, e]))
            out[row, c] = largest
    return out


@lru_cache(maxsize=256)
def _plan(cost_bytes: bytes, structure_bytes: bytes, m: int, n: int, columns: int, k: int) -> Plan:
    """Match rows to unknowns, then order pivots by Markowitz' rule on the pattern of all stages."""
    cost = np.frombuffer(cost_bytes).reshape(m, m)
    structure = np.frombuffer(structure_bytes, dtype=bool).reshape(m, columns)
    _, partner = linear_sum_assignment(cost)
    size, extra = k * m, columns - m
    pattern = np.zeros((size, size), dtype=bool)
    weight = np.zeros(size)
    for j in range(k):
        for row in range(m):
            i = j * m + partner[row]
            pattern[i, j * m : (j + 1) * m] |= structure[row, :m]
            for stage in range(k):
                pattern[i, stage * m : stage * m + n] |= structure[row, m : m + n]
            weight[i] = structure[row, m : m + extra].sum()
    position = np.empty(size, dtype=np.int64)
    active = np.arange(size)
    for step in range(size):
        block = pattern[np.ix_(active, active)]
        cost = (block.sum(axis=0) - 1) * (block.sum(axis=1) - 1 + weight[active])
        best = int(np.argmin(cost))
        pivot, position[active[best]] = active[best], step
        below = active[block[:, best]]
        across = active[block[best]]
        pattern[np.ix_(below, across)] = True
        weight[below] = np.maximum(weight[below], weight[pivot])
        active = np.delete(active, best)
    return Plan(position, np.asarray(partner, dtype=np.int64))


@compiled
def _any(values):  # type: ignore[no-untyped-def]
    for value in values:  # noqa: SIM110  (numba compiles loops, not generators)
        if value != 0.0:
            return True
    return False


@compiled
def fill(widths, matrix, points, n, position, partner, work, pattern, scale):  # type: ignore[no-untyped-def]
    """Write the scaled stage equations of all elements into work, rows and columns in pivot order."""
    _, columns, k, n_elements = points.shape
    size = work.shape[0]
    m = size // k
    for j in range(k):
        for row in range(m):
            i = position[j * m + partner[row]]
            s = scale[i]
            s[:] = 0.0
            for c in range(m):
                source = points[row, c, j]
                for e in range(n_elements):
                    s[e] = max(s[e], abs(source[e]))
            for c in range(n):
                source = points[row, m + c, j]
                for e in range(n_elements):
                    s[e] = max(s[e], abs(widths[e] * matrix[j, j] * source[e]))
            for e in range(n_elements):
                s[e] = 1.0 / s[e] if s[e] > 0.0 else 1.0
            for c in range(columns):
                source = points[row, c, j]
                if not _any(source):
                    continue
                if c < m:
                    at = position[j * m + c]
                    pattern[i, at] = True
                    target = work[i, at]
                    for e in range(n_elements):
                        target[e] += s[e] * source[e]
                    continue
                at = size + c - m
                pattern[i, at] = True
                target = work[i, at]
                for e in range(n_elements):
                    target[e] = -s[e] * source[e]
                if c < m + n:
                    for stage in range(k):
                        at = position[stage * m + c - m]
                        pattern[i, at] = True
                        target = work[i, at]
                        a = matrix[j, stage]
                        for e in range(n_elements):
                            target[e] += a * widths[e] * s[e] * source[e]


@compiled
def eliminate(work, pattern, growth):  # type: ignore[no-untyped-def]
    """LU in place without exchanges and back-substitution of the columns beyond; growth (N,): largest multiplier."""
    size, columns, n_elements = work.shape
    inverse = np.empty(n_elements)
    at = np.empty(columns, dtype=np.int64)
    for j in range(size):
        pivot = work[j, j]
        for e in range(n_elements):
            inverse[e] = 1.0 / pivot[e]
            growth[e] = max(growth[e], abs(inverse[e]) * 1e-3)
        count = 0
        for c in range(j + 1, columns):
            if pattern[j, c]:
                at[count] = c
                count += 1
        for i in range(j + 1, size):
            if pattern[i, j]:
                factor = work[i, j]
                for e in range(n_elements):
                    factor[e] *= inverse[e]
                    growth[e] = max(growth[e], abs(factor[e]))
                for q in range(count):
                    pattern[i, at[q]] = True
                    target, source = work[i, at[q]], work[j, at[q]]
                    for e in range(n_elements):
                        target[e] -= factor[e] * source[e]
    for i in range(size - 1, -1, -1):
        for q in range(i + 1, size):
            if pattern[i, q]:
                factor = work[i, q]
                for c in range(size, columns):
                    if pattern[q, c]:
                        pattern[i, c] = True
                        target, source = work[i, c], work[q, c]
                        for e in range(n_elements):
                            target[e] -= factor[e] * source[e]
        pivot = work[i, i]
        for c in range(size, columns):
            if pattern[i, c]:
                target = work[i, c]
                for e in range(n_elements):
                    target[e] /= pivot[e]


@compiled
def _relations(widths, weights, position, work, jumps, m):  # type: ignore[no-untyped-def]
    """[-G_e | I | J_e - S_e] (N, n, 2n + n_s) of Y_{e+1} - G_e Y_e + (J_e - S_e) s = ..., J_e the jumps."""
    size, _, n_elements = work.shape
    n, n_s = jumps.shape[1:]
    total = np.zeros((n, n + n_s, n_elements))
    for i in range(n):
        for j in range(size // m):
            row = position[j * m + i]
            for c in range(n + n_s):
                target, source = total[i, c], work[row, size + c]
                for e in range(n_elements):
                    target[e] -= weights[j] * source[e]
    out = np.zeros((n_elements, n, 2 * n + n_s))
    for e in range(n_elements):
        for i in range(n):
            for c in range(n):
                out[e, i, c] = widths[e] * total[i, c, e]
            out[e, i, i] -= 1.0
            out[e, i, n + i] = 1.0
            for c in range(n_s):
                out[e, i, 2 * n + c] = widths[e] * total[i, n + c, e] + jumps[e, i, c]
    return out


@compiled
def _eliminate_pivoted(widths, weights, position, filled, jumps, m, work, pivoted, lu, exchanges, right, relations, scale):  # type: ignore[no-untyped-def]  # fmt: skip
    """Eliminate single elements with pivots from stage and continuity rows; filled (k m, columns, M): stage equations.

    Writes their relations, and d(stage)/d(Y_e, s) over that of `work`; False where one of them is singular.
    """
    n, n_s = jumps.shape[1:]
    size = filled.shape[0]
    regular = True
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        a = np.zeros((size + n, size + 2 * n + n_s))
        a[:size, :size] = filled[:, :size, index]
        a[:size, size : size + n] = -filled[:, size : size + n, index]
        a[:size, size + 2 * n :] = -filled[:, size + n :, index]
        for i in range(n):
            for j in range(size // m):
                a[size + i, position[j * m + i]] = -widths[e] * weights[j]
            a[size + i, size + i] = -1.0
            a[size + i, size + n + i] = 1.0
            a[size + i, size + 2 * n :] = jumps[e, i]
        if not lu_rectangular(a, exchanges[index], size + n):
            regular = False
            continue
        lu[index] = a[:, :size]
        for i in range(n):
            largest = np.abs(a[size + i, size:]).max()
            scale[index, i] = 1.0 / largest if largest > 0.0 else 1.0
            relations[e, i] = scale[index, i] * a[size + i, size:]
        for i in range(size - 1, -1, -1):
            row, inverse = a[i], 1.0 / a[i, i]
            for j in range(i + 1, size):
                factor, below = row[j], a[j]
                for c in range(size, row.shape[0]):
                    row[c] -= factor * below[c]
            for c in range(size, row.shape[0]):
                row[c] *= inverse
        work[:, size : size + n, e] = -a[:size, size : size + n]
        right[index] = -a[:size, size + n : size + 2 * n]
        work[:, size + n :, e] = -a[:size, size + 2 * n :]
    return regular


def eliminate_stages(
    widths: Array, weights: Array, matrix: Array, points: Array, jumps: Array, m: int, plan: Plan
) -> tuple[LocalFactors, Array, bool]:
    """Factors, relations (N, n, 2n + n_s) of all elements, and whether all are regular.

    points (rows, columns, k, N), of which the first m rows are equations; jumps (N, n, n_s): scalars in continuity rows.
    """
    _, columns, k, n_elements = points.shape
    n, size = jumps.shape[1], k * m
    work = np.zeros((size, size + columns - m, n_elements))
    pattern = np.zeros(work.shape[:2], dtype=np.bool_)
    scale, growth = np.empty((size, n_elements)), np.zeros(n_elements)
    fill(widths, matrix, points, n, plan.position, plan.partner, work, pattern, scale)
    eliminate(work, pattern, growth)
    relations = _relations(widths, weights, plan.position, work, jumps, m)
    growth[[0, -1]] = np.inf  # where poles lie
    pivoted = np.flatnonzero(~(growth <= GROWTH_LIMIT))
    count = len(pivoted)
    lu, exchanges = np.zeros((count, size + n, size)), np.zeros((count, size), dtype=np.int64)
    right, relation_scale = np.zeros((count, size, n)), np.ones((count, n))
    regular = True
    if count:
        filled = np.zeros((*work.shape[:2], count))
        some, some_widths = np.ascontiguousarray(points[..., pivoted]), widths[pivoted]
        fill(
            some_widths,
            matrix,
            some,
            n,
            plan.position,
            plan.partner,
            filled,
            np.zeros_like(pattern),
            np.empty((size, count)),
        )
        pattern[:, size:] = True
        regular = _eliminate_pivoted(
            widths, weights, plan.position, filled, jumps, m, work, pivoted, lu, exchanges, right, relations, relation_scale
        )  # fmt: skip
    factors = LocalFactors(work, pattern, scale, pivoted, lu, exchanges, right, relation_scale)
    return factors, relations, regular


@compiled
def solve_stages(  # type: ignore[no-untyped-def]
    work, pattern, scale, pivoted, lu, exchanges, right, relation_scale, position, partner, widths, weights, equations,
    continuity,
):  # fmt: skip
    """Stages (k m, N), in pivot order, at vanishing end values and scalars, and right-hand sides of the relations (N, n)."""
    size, n_elements = scale.shape
    m, n = partner.shape[0], right.shape[2]
    x = np.empty((size, n_elements))
    for j in range(size // m):
        for row in range(m):
            i = position[j * m + partner[row]]
            for e in range(n_elements):
                x[i, e] = equations[e * size + j * m + row] * scale[i, e]
    start = np.empty((pivoted.shape[0], size + n))
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        for i in range(size):
            start[index, i] = x[i, e]
        for i in range(n):
            start[index, size + i] = continuity[e * n + i]
    for i in range(size):
        target = x[i]
        for j in range(i):
            if pattern[i, j]:
                factor, source = work[i, j], x[j]
                for e in range(n_elements):
                    target[e] -= factor[e] * source[e]
    for i in range(size - 1, -1, -1):
        target = x[i]
        for j in range(i + 1, size):
            if pattern[i, j]:
                factor, source = work[i, j], x[j]
                for e in range(n_elements):
                    target[e] -= factor[e] * source[e]
        pivot = work[i, i]
        for e in range(n_elements):
            target[e] /= pivot[e]
    defect = continuity.copy().reshape(n_elements, n)
    for j in range(size // m):
        for i in range(n):
            source = x[position[j * m + i]]
            for e in range(n_elements):
                defect[e, i] += widths[e] * weights[j] * source[e]
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        forward(lu[index], exchanges[index], start[index])
        for i in range(n):
            defect[e, i] = relation_scale[index, i] * start[index, size + i]
        backward(lu[index], size, start[index])
        for i in range(size):
            x[i, e] = start[index, i]
    return x, defect
