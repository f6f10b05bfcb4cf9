"""The plan of a local elimination: which row eliminates which unknown in what order, and every operation that follows.

All elements share one pattern of non-zeros, so this is done once per pattern: rows are matched to unknowns by size (weighted
matching), pivots ordered by Markowitz' rule, and the operations listed.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapespace.numerics.matching import cheapest_matching
from shapespace.numerics.small_lu import Array, BoolArray, IntArray, compiled

ABSENT = -128
"""Marks entries that vanish on all elements."""


class Plan(NamedTuple):
    """How stages of one pattern are eliminated: every operation, written down once.

    position (k m,): place of each unknown (stage m + column) in the order of pivots, which rows and columns below follow;
    partner (m,): equation -> column within a stage, a permutation with so many inversions; structure (m, columns): non-zeros
    of a point's equations.
    slot (k m, k m + n + n_s): row of the work array that holds an entry, -1 where there is none: first the pivots, then the
    other factors, last the columns of (Y_e, s). lower, upper (., 3): row, column and slot of the factors, lower by columns
    from the pivots down, upper by rows from the last up. scaled (.,), operations (., 3): slots of a pivot's row, and of
    target, factor and source of target -= factor source; steps (k m + 1, 2): where each pivot's begin in them; operations
    beyond the last pivot substitute back.
    """

    position: IntArray
    partner: IntArray
    inversions: int
    structure: BoolArray
    slot: IntArray
    lower: IntArray
    upper: IntArray
    scaled: IntArray
    operations: IntArray
    steps: IntArray


def make_plan(widths: Array, matrix: Array, points: Array, n: int, n_equations: int) -> Plan:
    """The plan for stage blocks points (rows, columns, k, N), of which the first n_equations rows are equations."""
    rows, columns, k, _ = points.shape
    reach = 0.1 * float(widths.max() * matrix.diagonal().max())
    decades = _decades(points.reshape(rows, columns, -1), n_equations, n, reach)
    return _matched(decades.tobytes(), n_equations, n, columns, k)


@compiled
def _decades(points: Array, m: int, n: int, reach: float) -> NDArray[np.int8]:
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
    inversions = sum(np.count_nonzero(partner[:i] > partner[i]) for i in range(m))
    return Plan(np.argsort(order), partner, int(inversions), structure, *_operations(pattern))


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
