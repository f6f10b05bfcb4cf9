"""Local elimination: the stages of all elements at once, by one sparse elimination whose inner loops run over elements.

All elements share one pattern of non-zeros, so every operation is planned once (`plan`) and becomes a vector operation over
elements.
What is left of an element is a relation of its end values and the scalars, n rows over (Y_e, Y_{e+1}, s).

Pivots from the stage equations alone assume that Y_e determines the stages. Beside a pole it does not: collocation follows
solutions like r, r^2, ... exactly, and they start from zero on the axis. The first and the last element, and those whose
multipliers exceed GROWTH_LIMIT, are therefore eliminated each on its own, with pivots from its continuity rows as well, so that
Y_e and Y_{e+1} determine the stages together. The border of a flat disc then has a condition number of 1e2 instead of 1e16.
"""

from typing import NamedTuple

import numpy as np

from shapespace.numerics.plan import Plan
from shapespace.numerics.small_lu import (
    Array,
    BoolArray,
    IntArray,
    backward,
    compiled,
    copy,
    forward,
    lu_rectangular,
    put,
)

GROWTH_LIMIT = 1e4
"""Multipliers this large would cost about four digits."""


class LocalFactors(NamedTuple):
    """Eliminated stages.

    work (slots, N): lower triangle, inverse pivots, unit upper triangle; response (k m, n + n_s, N): -d(stage)/d(Y_e, s);
    scale (k m, N): row scaling. pivoted (M,): elements eliminated with their continuity rows; dense (M, k m + n,
    k m + 2n + n_s): their LU, and -d(stage)/d(Y_e, Y_{e+1}, s) beside it; exchanges (M, k m): of rows; relation_scale (M, n):
    scaling of the rows left over.
    """

    work: Array
    response: Array
    scale: Array
    pivoted: IntArray
    dense: Array
    exchanges: IntArray
    relation_scale: Array


@compiled
def _fill(
    widths: Array, matrix: Array, points: Array, n: int, position: IntArray, partner: IntArray, structure: BoolArray,
    slot: IntArray, work: Array,
) -> Array:  # fmt: skip
    """Write the scaled stage equations of all elements into their slots; returns the scaling of the rows."""
    _, columns, k, n_elements = points.shape
    m, size = partner.shape[0], position.shape[0]
    scale, scaled = np.zeros((size, n_elements)), np.empty(n_elements)
    for j in range(k):
        for row in range(m):
            i = position[j * m + partner[row]]
            s = scale[i]
            for c in range(m + n):
                if structure[row, c]:
                    source = points[row, c, j]
                    for e in range(n_elements):
                        s[e] = max(s[e], abs(source[e]) if c < m else abs(widths[e] * matrix[j, j] * source[e]))
            for e in range(n_elements):
                s[e] = 1.0 / s[e] if s[e] > 0.0 else 1.0
            for c in range(columns):
                if not structure[row, c]:
                    continue
                source = points[row, c, j]
                target = work[slot[i, position[j * m + c] if c < m else size + c - m]]
                for e in range(n_elements):
                    scaled[e] = s[e] * source[e]
                    target[e] += scaled[e]
                if m <= c < m + n:
                    for e in range(n_elements):
                        scaled[e] *= widths[e]
                    for stage in range(k):
                        target, a = work[slot[i, position[stage * m + c - m]]], matrix[j, stage]
                        for e in range(n_elements):
                            target[e] += a * scaled[e]
    return scale


@compiled
def _update(work: Array, operations: IntArray, first: int, last: int) -> None:
    for o in range(first, last):
        target, factor, source = work[operations[o, 0]], work[operations[o, 1]], work[operations[o, 2]]
        for e in range(work.shape[1]):
            target[e] -= factor[e] * source[e]


@compiled
def _eliminate(work: Array, lower: IntArray, scaled: IntArray, operations: IntArray, steps: IntArray) -> Array:
    """LU in place without exchanges and back-substitution of the columns beyond; returns the largest multipliers (N,)."""
    n_elements = work.shape[1]
    size = steps.shape[0] - 1
    for j in range(size):
        pivot = work[j]
        for e in range(n_elements):
            pivot[e] = 1.0 / pivot[e]
        for q in range(steps[j, 0], steps[j + 1, 0]):
            target = work[scaled[q]]
            for e in range(n_elements):
                target[e] *= pivot[e]
        _update(work, operations, steps[j, 1], steps[j + 1, 1])
    _update(work, operations, steps[size, 1], operations.shape[0])
    growth = np.zeros(n_elements)
    for q in range(lower.shape[0]):
        factor, pivot, diagonal = work[lower[q, 2]], work[lower[q, 1]], lower[q, 0] == lower[q, 1]
        for e in range(n_elements):
            growth[e] = max(growth[e], abs(1e-3 * pivot[e]) if diagonal else abs(factor[e] * pivot[e]))
    return growth


@compiled
def _relations(widths: Array, weights: Array, position: IntArray, response: Array, jumps: Array, m: int) -> Array:
    """[-G_e | I | J_e - S_e] (N, n, 2n + n_s) of Y_{e+1} - G_e Y_e + (J_e - S_e) s = ..., J_e the jumps."""
    size, columns, n_elements = response.shape
    n = jumps.shape[1]
    out, total = np.zeros((n_elements, n, n + columns)), np.empty(n_elements)
    for i in range(n):
        for c in range(columns):
            total[:] = 0.0
            for j in range(size // m):
                source = response[position[j * m + i], c]
                for e in range(n_elements):
                    total[e] += weights[j] * source[e]
            for e in range(n_elements):
                out[e, i, c if c < n else n + c] = widths[e] * total[e]
        for e in range(n_elements):
            out[e, i, i] -= 1.0
            out[e, i, n + i] = 1.0
            for c in range(columns - n):
                out[e, i, 2 * n + c] += jumps[e, i, c]
    return out


@compiled
def _eliminate_pivoted(
    widths: Array, weights: Array, position: IntArray, slot: IntArray, filled: Array, jumps: Array, m: int,
    response: Array, pivoted: IntArray, dense: Array, exchanges: IntArray, relations: Array, scale: Array,
) -> bool:  # fmt: skip
    """Eliminate single elements with pivots from stage and continuity rows; filled (slots, M): their stage equations.

    Writes their relations and `response`; False where one of them is singular.
    """
    n = jumps.shape[1]
    size, columns = slot.shape
    regular = True
    for index in range(pivoted.shape[0]):
        e, a = pivoted[index], dense[index]
        for i in range(size):
            for c in range(columns):
                if slot[i, c] >= 0:
                    a[i, c if c < size + n else c + n] = filled[slot[i, c], index]
        for i in range(n):
            for j in range(size // m):
                a[size + i, position[j * m + i]] = -widths[e] * weights[j]
            a[size + i, size + i] = -1.0
            a[size + i, size + n + i] = 1.0
        copy(a[size:, size + 2 * n :], jumps[e])
        if not lu_rectangular(a, exchanges[index], size + n):
            regular = False
            continue
        for i in range(n):
            row, largest = a[size + i, size:], 0.0
            for c in range(row.shape[0]):
                largest = max(largest, abs(row[c]))
            scale[index, i] = 1.0 / largest if largest > 0.0 else 1.0
            for c in range(row.shape[0]):
                relations[e, i, c] = scale[index, i] * row[c]
        for i in range(size - 1, -1, -1):
            row, inverse = a[i], 1.0 / a[i, i]
            for j in range(i + 1, size):
                factor, below = row[j], a[j]
                for c in range(size, row.shape[0]):
                    row[c] -= factor * below[c]
            for c in range(size, row.shape[0]):
                row[c] *= inverse
        copy(response[:, :n, e], a[:size, size : size + n])
        copy(response[:, n:, e], a[:size, size + 2 * n :])
    return regular


@compiled
def _eliminate_all(
    widths: Array, weights: Array, matrix: Array, points: Array, jumps: Array, m: int, position: IntArray,
    partner: IntArray, structure: BoolArray, slot: IntArray, lower: IntArray, scaled: IntArray, operations: IntArray,
    steps: IntArray,
) -> tuple[tuple[Array, Array, Array, IntArray, Array, IntArray, Array], Array, bool]:  # fmt: skip
    """The fields of LocalFactors, the relations, and whether all elements are regular."""
    n_elements, n, n_s = jumps.shape
    size = position.shape[0]
    work = np.zeros((slot[-1, -1] + 1, n_elements))
    scale = _fill(widths, matrix, points, n, position, partner, structure, slot, work)
    pivoted = np.arange(0, n_elements, max(n_elements - 1, 1))  # where poles lie
    filled = work[:, pivoted]
    growth = _eliminate(work, lower, scaled, operations, steps)
    response = work[slot[0, size] :].reshape(size, n + n_s, n_elements)
    relations = _relations(widths, weights, position, response, jumps, m)
    growth[0], growth[-1] = np.inf, np.inf
    poor = np.flatnonzero(~(growth <= GROWTH_LIMIT))
    if poor.shape[0] > pivoted.shape[0]:
        pivoted, again = poor, np.zeros_like(work)
        _fill(widths, matrix, points, n, position, partner, structure, slot, again)
        filled = again[:, pivoted]
    count = pivoted.shape[0]
    dense, relation_scale = np.zeros((count, size + n, size + 2 * n + n_s)), np.ones((count, n))
    exchanges = np.zeros((count, size), dtype=np.int64)
    regular = _eliminate_pivoted(
        widths, weights, position, slot, filled, jumps, m, response, pivoted, dense, exchanges, relations,
        relation_scale,
    )  # fmt: skip
    return (work, response, scale, pivoted, dense, exchanges, relation_scale), relations, regular


def eliminate_stages(
    widths: Array, weights: Array, matrix: Array, points: Array, jumps: Array, m: int, plan: Plan
) -> tuple[LocalFactors, Array, bool]:
    """Factors, relations (N, n, 2n + n_s) of all elements, and whether all are regular.

    points (rows, columns, k, N), of which the first m rows are equations; jumps (N, n, n_s): scalars in continuity rows.
    """
    factors, relations, regular = _eliminate_all(
        widths, weights, matrix, points, jumps, m, plan.position, plan.partner, plan.structure, plan.slot, plan.lower,
        plan.scaled, plan.operations, plan.steps,
    )  # fmt: skip
    return LocalFactors(*factors), relations, regular


@compiled
def substitute(work: Array, entries: IntArray, x: Array) -> None:
    """One triangle of the LU: for each entry (i, j, slot) x_i -= work_slot x_j, or x_i *= work_slot on the diagonal."""
    for q in range(entries.shape[0]):
        target, source, factor = x[entries[q, 0]], x[entries[q, 1]], work[entries[q, 2]]
        if entries[q, 0] == entries[q, 1]:
            for e in range(x.shape[1]):
                target[e] *= factor[e]
        else:
            for e in range(x.shape[1]):
                target[e] -= factor[e] * source[e]


@compiled
def solve_stages(
    work: Array, scale: Array, pivoted: IntArray, dense: Array, exchanges: IntArray, relation_scale: Array,
    position: IntArray, partner: IntArray, lower: IntArray, upper: IntArray, widths: Array, weights: Array,
    equations: Array, continuity: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Stages (k m, N) for given nodes of zero, in pivot order, and the right-hand sides (N, n) of the relations."""
    size, n_elements = scale.shape
    m, n = partner.shape[0], relation_scale.shape[1]
    x = np.empty((size, n_elements))
    for j in range(size // m):
        for row in range(m):
            i = position[j * m + partner[row]]
            for e in range(n_elements):
                x[i, e] = equations[e * size + j * m + row] * scale[i, e]
    start = np.empty((pivoted.shape[0], size + n))
    for index, e in enumerate(pivoted):
        put(start[index, :size], x[:, e])
        put(start[index, size:], continuity[e * n : (e + 1) * n])
    substitute(work, lower, x)
    substitute(work, upper, x)
    defect = continuity.copy().reshape(n_elements, n)
    for j in range(size // m):
        for i in range(n):
            source = x[position[j * m + i]]
            for e in range(n_elements):
                defect[e, i] += widths[e] * weights[j] * source[e]
    for index, e in enumerate(pivoted):
        forward(dense[index], exchanges[index], start[index])
        for i in range(n):
            defect[e, i] = relation_scale[index, i] * start[index, size + i]
        backward(dense[index], size, start[index, :size])
        put(x[:, e], start[index, :size])
    return x, defect
