"""Local elimination: the stages of all elements at once, by one sparse elimination whose inner loops run over elements.

All elements share one pattern of non-zeros, so rows are matched to unknowns and pivots ordered once per pattern (weighted
matching, then Markowitz' rule), the operations are listed once, and each becomes a vector operation over elements.
What is left of an element is a relation of its end values and the scalars, n rows over (Y_e, Y_{e+1}, s).

Pivots from the stage equations alone assume that Y_e determines the stages. Beside a pole it does not: collocation follows
solutions like r, r^2, ... exactly, and they start from zero on the axis. The first and the last element, and those whose
multipliers exceed GROWTH_LIMIT, are therefore eliminated each on its own, with pivots from its continuity rows as well, so that
Y_e and Y_{e+1} determine the stages together. The border of a flat disc then has a condition number of 1e2 instead of 1e16.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from shapespace.numerics.matching import cheapest_matching
from shapespace.numerics.small_lu import Array, BoolArray, IntArray, backward, compiled, copy, forward, lu_rectangular

GROWTH_LIMIT = 1e4
"""Multipliers this large would cost about four digits."""

ABSENT = -128
"""Marks entries that vanish on all elements."""


class Plan(NamedTuple):
    """How stages of one pattern are eliminated: every operation, written down once.

    position (k m,): place of each unknown (stage m + column) in the order of pivots, which rows and columns below follow;
    partner (m,): equation -> column within a stage; structure (m, columns): non-zeros of a point's equations.
    slot (k m, k m + n + n_s): row of the work array that holds an entry, -1 where there is none: first the pivots, then the
    other factors, last the columns of (Y_e, s). lower, upper (., 3): row, column and slot of the factors, lower by columns
    from the pivots down, upper by rows from the last up. scaled (.,), operations (., 3): slots of a pivot's row, and of
    target, factor and source of target -= factor source; steps (k m + 1, 2): where each pivot's begin in them; operations
    beyond the last pivot substitute back.
    """

    position: IntArray
    partner: IntArray
    structure: BoolArray
    slot: IntArray
    lower: IntArray
    upper: IntArray
    scaled: IntArray
    operations: IntArray
    steps: IntArray


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


def make_plan(widths: Array, matrix: Array, points: Array, n: int, n_equations: int) -> Plan:
    """The plan for stage blocks points (rows, columns, k, N), of which the first n_equations rows are equations."""
    rows, columns, k, _ = points.shape
    reach = 0.1 * float(widths.max() * matrix.diagonal().max())
    decades = _decades(points.reshape(rows, columns, -1), n_equations, n, reach)
    return _matched(decades.tobytes(), n_equations, n, columns, k)


@compiled
def _decades(points, m, n, reach):  # type: ignore[no-untyped-def]  # numba finds the types
    """Half the decimal logarithm of the mean size of each entry of the equations' blocks, fields times reach; (m, columns).

    Whole numbers, so that round-off and slow drift keep the plan.
    """
    _, columns, n_points = points.shape
    out = np.full((m, columns), ABSENT, dtype=np.int8)
    for row in range(m):
        for c in range(columns):
            source, total = points[row, c], 0.0
            for e in range(n_points):
                total += abs(source[e])
            if total != 0.0:
                decade = np.log10(total / n_points * (reach if m <= c < m + n else 1.0))
                out[row, c] = np.int8(np.round(0.5 * decade)) if abs(decade) < 200.0 else np.int8(0)
    return out


@lru_cache(maxsize=256)
def _matched(decades: bytes, m: int, n: int, columns: int, k: int) -> Plan:
    """The plan that matches rows to unknowns by size."""
    entries = np.frombuffer(decades, dtype=np.int8).reshape(m, columns)
    own = entries[:, :m].copy()
    own[:, :n] = np.maximum(own[:, :n], entries[:, m : m + n])
    # An absent entry is the last resort, so that a singular pattern has a plan as well.
    partner = cheapest_matching(np.where(own == ABSENT, 1e3, -own.astype(float)))
    return _plan((entries != ABSENT).tobytes(), tuple(partner.tolist()), n, k)


@lru_cache(maxsize=64)
def _plan(non_zeros: bytes, partners: tuple[int, ...], n: int, k: int) -> Plan:
    """Order the pivots and list the operations: some ms, but sizes change more often than the matching."""
    m, size, partner = len(partners), k * len(partners), np.array(partners)
    structure = np.frombuffer(non_zeros, dtype=bool).reshape(m, -1)
    stages = np.zeros((k, m, size + structure.shape[1] - m), dtype=bool)
    for j in range(k):
        stages[j, partner, j * m : (j + 1) * m] = structure[:, :m]
        for stage in range(k):
            stages[j, partner, stage * m : stage * m + n] |= structure[:, m : m + n]
        stages[j, partner, size:] = structure[:, m:]
    pattern = stages.reshape(size, -1)
    order = _pivot_order(pattern.copy())
    pattern = pattern[order][:, np.concatenate([order, np.arange(size, pattern.shape[1])])]
    return Plan(np.argsort(order), partner, structure, *_operations(pattern))


def _pivot_order(pattern: BoolArray) -> IntArray:
    """Diagonal pivots of (size, size + columns beyond) in an order that fills little, by Markowitz' rule; fills the pattern."""
    size = len(pattern)
    weight, active, order = pattern[:, size:].sum(axis=1), np.arange(size), np.empty(size, dtype=np.int64)
    for step in range(size):
        block = pattern[np.ix_(active, active)]
        cost = (block.sum(axis=0) - 1) * (block.sum(axis=1) - 1 + weight[active])
        best = int(np.argmin(cost))
        order[step] = active[best]
        below, across = active[block[:, best]], active[block[best]]
        pattern[np.ix_(below, across)] = True
        weight[below] = np.maximum(weight[below], weight[order[step]])
        active = np.delete(active, best)
    return order


def _operations(pattern: BoolArray) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Slots and operations of a Plan for a pattern (size, columns) in pivot order; fills the pattern."""
    size, columns = pattern.shape
    below, across = [], []
    for j in range(size):
        below.append(j + 1 + np.flatnonzero(pattern[j + 1 :, j]))
        across.append(j + 1 + np.flatnonzero(pattern[j, j + 1 :]))
        pattern[np.ix_(below[j], across[j])] = True
    slot = np.full((size, columns), -1)
    slot[np.diag_indices(size)] = np.arange(size)
    others = pattern[:, :size] & ~np.eye(size, dtype=bool)
    slot[:, :size][others] = size + np.arange(others.sum())
    slot[:, size:] = size + others.sum() + np.arange(size * (columns - size)).reshape(size, -1)

    def updates(rows: IntArray, pivots: IntArray, columns: IntArray) -> IntArray:
        i, q, c = (index.ravel() for index in np.meshgrid(rows, pivots, columns, indexing="ij"))
        return np.stack([slot[i, c], slot[i, q], slot[q, c]], axis=1)

    operations = [updates(below[j], np.array([j]), across[j]) for j in range(size)]
    steps = np.zeros((size + 1, 2), dtype=np.int64)
    steps[1:] = np.cumsum([[len(across[j]), len(operations[j])] for j in range(size)], axis=0)
    backwards = [(np.array([i]), across[i][across[i] < size]) for i in range(size - 1, -1, -1)]
    operations += [updates(row, later, np.arange(size, columns)) for row, later in backwards]
    lower = np.array([(i, j, slot[i, j]) for j in range(size) for i in (j, *below[j])])
    upper = np.array([(i, q, slot[i, q]) for (i,), later in backwards for q in later], dtype=np.int64).reshape(-1, 3)
    scaled = np.concatenate([slot[j, across[j]] for j in range(size)])
    return slot, lower, upper, scaled, np.concatenate(operations), steps


@compiled
def _fill(widths, matrix, points, n, position, partner, structure, slot, work):  # type: ignore[no-untyped-def]  # numba finds the types
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
def _update(work, operations, first, last):  # type: ignore[no-untyped-def]  # numba finds the types
    for o in range(first, last):
        target, factor, source = work[operations[o, 0]], work[operations[o, 1]], work[operations[o, 2]]
        for e in range(work.shape[1]):
            target[e] -= factor[e] * source[e]


@compiled
def _eliminate(work, lower, scaled, operations, steps):  # type: ignore[no-untyped-def]  # numba finds the types
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
def _relations(widths, weights, position, response, jumps, m):  # type: ignore[no-untyped-def]  # numba finds the types
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
def _eliminate_pivoted(  # type: ignore[no-untyped-def]  # numba finds the types
    widths, weights, position, slot, filled, jumps, m, response, pivoted, dense, exchanges, relations, scale
):
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
def _eliminate_all(  # type: ignore[no-untyped-def]  # numba finds the types
    widths, weights, matrix, points, jumps, m, position, partner, structure, slot, lower, scaled, operations, steps
):  # fmt: skip
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
def solve_stages(  # type: ignore[no-untyped-def]  # numba finds the types
    work, scale, pivoted, dense, exchanges, relation_scale, position, partner, lower, upper, widths, weights, equations,
    continuity,
):  # fmt: skip
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
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        for i in range(size):
            start[index, i] = x[i, e]
        for i in range(n):
            start[index, size + i] = continuity[e * n + i]
    for q in range(lower.shape[0]):
        target, factor, source = x[lower[q, 0]], work[lower[q, 2]], x[lower[q, 1]]
        if lower[q, 0] == lower[q, 1]:
            for e in range(n_elements):
                target[e] *= factor[e]
        else:
            for e in range(n_elements):
                target[e] -= factor[e] * source[e]
    for q in range(upper.shape[0]):
        target, factor, source = x[upper[q, 0]], work[upper[q, 2]], x[upper[q, 1]]
        for e in range(n_elements):
            target[e] -= factor[e] * source[e]
    defect = continuity.copy().reshape(n_elements, n)
    for j in range(size // m):
        for i in range(n):
            source = x[position[j * m + i]]
            for e in range(n_elements):
                defect[e, i] += widths[e] * weights[j] * source[e]
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        forward(dense[index], exchanges[index], start[index])
        for i in range(n):
            defect[e, i] = relation_scale[index, i] * start[index, size + i]
        backward(dense[index], size, start[index, :size])
        for i in range(size):
            x[i, e] = start[index, i]
    return x, defect
