"""Solves with the transpose of a factorised collocation system by the same factors: condensation.solve, backwards.

Every step of `solve` is linear, so the transposed solve takes the transposes of its steps in reverse order: reordered unknowns,
coupling of the stages to nodes and scalars, chain and border, integral rows, stages. Names are those of condensation.py.
"""

import numpy as np

from shapespace.numerics.condensation import Factors
from shapespace.numerics.elimination import substitute
from shapespace.numerics.small_lu import Array, IntArray, backward_transposed, compiled, forward_transposed, put


@compiled
def _gather(x: Array, position: IntArray, k: int, n: int, n_elements: int) -> tuple[Array, Array, Array]:
    """Nodes (N + 1, n), stages (k m, N) in pivot order and scalars of a flat x, as copies."""
    size = position.shape[0]
    m, first = size // k, (n_elements + 1) * n
    algebraic = first + n_elements * k * n
    stages = np.empty((size, n_elements))
    for j in range(k):
        for c in range(m):
            target = stages[position[j * m + c]]
            for e in range(n_elements):
                point = e * k + j
                target[e] = x[first + point * n + c] if c < n else x[algebraic + point * (m - n) + c - n]
    return x[:first].copy().reshape(n_elements + 1, n), stages, x[first + n_elements * size :].copy()


@compiled
def _couple(response: Array, pivoted: IntArray, dense: Array, stages: Array, nodes: Array, scalars: Array) -> None:
    """Nodes and scalars take what the stages that go with them owe to them."""
    size, n_elements = stages.shape
    n = nodes.shape[1]
    for i in range(size):
        source = stages[i]
        for c in range(n):
            factor = response[i, c]
            for e in range(n_elements):
                nodes[e, c] -= factor[e] * source[e]
        for c in range(scalars.shape[0]):
            factor = response[i, n + c]
            for e in range(n_elements):
                scalars[c] -= factor[e] * source[e]
        for index in range(pivoted.shape[0]):
            e = pivoted[index]
            for c in range(n):
                nodes[e + 1, c] -= dense[index, i, size + n + c] * source[e]


@compiled
def _solve_chain(
    chain: Array, chain_pivot: IntArray, nodes: Array, scalars: Array, n_i: int, border_lu: Array,
    border_pivot: IntArray, border_scale: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Multipliers of the relations (N, n), the integral rows (n_i,) and the end rows (n_b,)."""
    n_elements, n, n_s = nodes.shape[0] - 1, nodes.shape[1], scalars.shape[0]
    known = np.empty((n_elements, n))
    for e in range(1, n_elements):
        # As the columns of the chain: Y_e | Y_{e+1} | Y_0 | s.
        row = np.zeros(3 * n + n_s)
        put(row, nodes[e])
        backward_transposed(chain[e - 1], n, row)
        put(known[e], row[:n])
        for i in range(n):
            nodes[e + 1, i] += row[n + i]
            nodes[0, i] += row[2 * n + i]
        for i in range(n_s):
            scalars[i] += row[3 * n + i]
    dense = np.concatenate((nodes[0], nodes[n_elements], scalars))
    backward_transposed(border_lu, dense.shape[0], dense)
    forward_transposed(border_lu, border_pivot, dense)
    dense *= border_scale
    work, relations = np.concatenate((nodes[0], dense[: n + n_i])), np.empty((n_elements, n))
    for e in range(n_elements - 1, 0, -1):
        put(work, known[e])
        forward_transposed(chain[e - 1], chain_pivot[e - 1], work)
        put(relations[e], work[n : 2 * n])
        put(work[n:], work[:n])
    put(relations[0], work[n : 2 * n])
    return relations, work[2 * n :].copy(), dense[n + n_i :]


@compiled
def _solve_stages(
    work: Array, scale: Array, pivoted: IntArray, dense: Array, exchanges: IntArray, relation_scale: Array,
    position: IntArray, partner: IntArray, lower: IntArray, upper: IntArray, widths: Array, weights: Array,
    stages: Array, relations: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Multipliers of the equations, flat, and of the continuity rows (N, n); stages and relations are used up.

    lower and upper: of the transposed factors.
    """
    size, n_elements = stages.shape
    m, n = partner.shape[0], relations.shape[1]
    start = np.empty((pivoted.shape[0], size + n))
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        for i in range(size):
            start[index, i], stages[i, e] = stages[i, e], 0.0
        backward_transposed(dense[index], size, start[index, :size])
        for i in range(n):
            start[index, size + i], relations[e, i] = relation_scale[index, i] * relations[e, i], 0.0
        forward_transposed(dense[index], exchanges[index], start[index])
    for j in range(size // m):
        for i in range(n):
            target = stages[position[j * m + i]]
            for e in range(n_elements):
                target[e] += widths[e] * weights[j] * relations[e, i]
    substitute(work, upper, stages)
    substitute(work, lower, stages)
    for index in range(pivoted.shape[0]):
        e = pivoted[index]
        put(stages[:, e], start[index, :size])
        put(relations[e], start[index, size:])
    equations = np.empty(n_elements * size)
    for j in range(size // m):
        for row in range(m):
            i = position[j * m + partner[row]]
            for e in range(n_elements):
                equations[e * size + j * m + row] = stages[i, e] * scale[i, e]
    return equations, relations


def _transposed(entries: IntArray) -> IntArray:
    """The entries of a triangle for `substitute` with its transpose."""
    return np.ascontiguousarray(entries[::-1, [1, 0, 2]])


def solve_transposed(factors: Factors, x: Array) -> Array:
    """The multipliers y of the rows (equations, continuity, ends, integrals), flat, with J^T y = x, flat as states."""
    f, plan = factors, factors.plan
    n_elements, n, n_i = len(f.widths), f.chain_pivot.shape[1], len(f.local_integral)
    x = np.ascontiguousarray(x)
    nodes, stages, scalars = _gather(x, plan.position, len(f.weights), n, n_elements)
    _couple(f.local.response, f.local.pivoted, f.local.dense, stages, nodes, scalars)
    relations, integrals, ends = _solve_chain(
        f.chain, f.chain_pivot, nodes, scalars, n_i, f.border_lu, f.border_pivot, f.border_scale
    )
    stages -= np.tensordot(integrals, f.local_integral, axes=1)
    local = f.local
    equations, continuity = _solve_stages(
        local.work, local.scale, local.pivoted, local.dense, local.exchanges, local.relation_scale, plan.position,
        plan.partner, _transposed(plan.lower), _transposed(plan.upper), f.widths, f.weights, stages, relations,
    )  # fmt: skip
    return np.concatenate([equations, continuity.ravel(), ends, integrals])
