"""Local elimination: the stages of all elements at once, by one sparse elimination whose inner loops run over elements.

All elements share one pattern of non-zeros, so rows are matched to unknowns and pivots ordered once per pattern (weighted
matching, then Markowitz' rule), and each scalar operation of the elimination becomes a vector operation over elements.
Pivots chosen in advance can be poor on single elements; where multipliers grow beyond GROWTH_LIMIT the element is
eliminated again on its own with partial pivoting.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# Contraction to fused multiply-adds and reassociated sums are allowed, but NaN and infinity keep their meaning.
compiled = njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")

GROWTH_LIMIT = 1e7
"""Multipliers this large cost about seven digits; elements beyond it are redone with partial pivoting."""


class Plan(NamedTuple):
    """position: of each unknown (stage m + column) in the pivot order, (k m,); partner: row -> column within a stage, (m,)."""

    position: IntArray
    partner: IntArray


class LocalFactors(NamedTuple):
    """Eliminated stages. work (k m, k m + n + n_s, N): upper triangle and multipliers, then d(stage)/d(Y_e, s).

    pattern (k m, k m + n + n_s): non-zeros; scale (k m, N): row scaling; redone (M,): elements eliminated with pivoting,
    their LU (M, k m, k m) and row exchanges (M, k m).
    """

    work: Array
    pattern: BoolArray
    scale: Array
    redone: IntArray
    dense_lu: Array
    dense_pivot: IntArray


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
def lu_rectangular(a, pivot, n_pivot_rows):  # type: ignore[no-untyped-def]
    """LU in place of the first len(pivot) columns of a (rows, cols), pivots from the first n_pivot_rows rows.

    Four columns at a time: one pass over the rest of a row then does four updates. False where a pivot vanishes.
    """
    rows, cols = a.shape
    size = pivot.shape[0]
    for start in range(0, size, 4):
        stop = min(start + 4, size)
        for j in range(start, stop):
            best, p = abs(a[j, j]), j
            for i in range(j + 1, n_pivot_rows):
                if abs(a[i, j]) > best:
                    best, p = abs(a[i, j]), i
            pivot[j] = p
            if not best > 1e-300:
                return False
            if p != j:
                for c in range(cols):
                    a[j, c], a[p, c] = a[p, c], a[j, c]
            inverse = 1.0 / a[j, j]
            for i in range(j + 1, rows):
                factor = a[i, j] * inverse
                a[i, j] = factor
                for c in range(j + 1, stop):
                    a[i, c] -= factor * a[j, c]
        for i in range(start + 1, stop):
            for j in range(start, i):
                factor = a[i, j]
                for c in range(stop, cols):
                    a[i, c] -= factor * a[j, c]
        if stop - start == 4:
            for i in range(stop, rows):
                f0, f1, f2, f3 = a[i, start], a[i, start + 1], a[i, start + 2], a[i, start + 3]
                for c in range(stop, cols):
                    a[i, c] -= f0 * a[start, c] + f1 * a[start + 1, c] + f2 * a[start + 2, c] + f3 * a[start + 3, c]
        else:
            for i in range(stop, rows):
                for j in range(start, stop):
                    factor = a[i, j]
                    for c in range(stop, cols):
                        a[i, c] -= factor * a[j, c]
    return True


@compiled
def forward(lu, pivot, x):  # type: ignore[no-untyped-def]
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


@compiled
def backward(lu, size, x):  # type: ignore[no-untyped-def]
    """Solve U x = b in place for the leading upper triangle of order `size`."""
    for i in range(size - 1, -1, -1):
        row = lu[i]
        total = 0.0
        for j in range(i + 1, size):
            total += row[j] * x[j]
        x[i] = (x[i] - total) / row[i]


@compiled
def redo(work, filled, redone, dense_lu, dense_pivot):  # type: ignore[no-untyped-def]
    """Eliminate single elements with partial pivoting; filled (size, columns, M) holds their equations as filled in."""
    size, columns, _ = work.shape
    regular = True
    for index in range(redone.shape[0]):
        e = redone[index]
        lu = filled[:, :size, index].copy()
        regular = lu_rectangular(lu, dense_pivot[index], size) and regular
        dense_lu[index] = lu
        if regular:
            for c in range(size, columns):
                column = filled[:, c, index].copy()
                forward(lu, dense_pivot[index], column)
                backward(lu, size, column)
                for i in range(size):
                    work[i, c, e] = column[i]
    return regular


def eliminate_stages(
    widths: Array, matrix: Array, points: Array, n: int, m: int, plan: Plan
) -> tuple[LocalFactors, bool]:
    """Eliminate the stages of all elements; False where one of them is singular. points (rows, columns, k, N)."""
    _, columns, k, n_elements = points.shape
    size = k * m
    work = np.zeros((size, size + columns - m, n_elements))
    pattern = np.zeros(work.shape[:2], dtype=np.bool_)
    scale, growth = np.empty((size, n_elements)), np.zeros(n_elements)
    fill(widths, matrix, points, n, plan.position, plan.partner, work, pattern, scale)
    eliminate(work, pattern, growth)
    redone = np.flatnonzero(~(growth <= GROWTH_LIMIT))
    dense_lu = np.empty((len(redone), size, size))
    dense_pivot = np.empty((len(redone), size), dtype=np.int64)
    regular = True
    if len(redone):
        filled = np.zeros_like(work)
        fill(widths, matrix, points, n, plan.position, plan.partner, filled, np.zeros_like(pattern), scale)
        pattern[:, size:] = True
        regular = redo(work, np.ascontiguousarray(filled[:, :, redone]), redone, dense_lu, dense_pivot)
    return LocalFactors(work, pattern, scale, redone, dense_lu, dense_pivot), regular


@compiled
def solve_stages(work, pattern, scale, redone, dense_lu, dense_pivot, position, partner, rhs):  # type: ignore[no-untyped-def]
    """The stage solution (k m, N) in pivot order for right-hand sides rhs (N k m,) at fixed nodes and scalars."""
    size, n_elements = scale.shape
    m = partner.shape[0]
    x = np.empty((size, n_elements))
    for j in range(size // m):
        for row in range(m):
            i = position[j * m + partner[row]]
            for e in range(n_elements):
                x[i, e] = rhs[e * size + j * m + row] * scale[i, e]
    start = np.empty((redone.shape[0], size))
    for index in range(redone.shape[0]):
        for i in range(size):
            start[index, i] = x[i, redone[index]]
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
    for index in range(redone.shape[0]):
        forward(dense_lu[index], dense_pivot[index], start[index])
        backward(dense_lu[index], size, start[index])
        for i in range(size):
            x[i, redone[index]] = start[index, i]
    return x
