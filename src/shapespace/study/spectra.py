"""Spectra of stationary states, with what the surface's conservation laws tell of neutral modes."""

import numpy as np

from shapespace.analysis.stability import Spectral, Spectrum, solve_spectrum
from shapespace.base.arrays import Array
from shapespace.numerics.state import State
from shapespace.study.keyed import HeldProblem, KeyedProblem

AMOUNT = "regulator-amount"
"""Without turnover the amount of the regulator is free: states with a little more of it are states as well."""


def spectrum_at(
    problem: KeyedProblem | HeldProblem,
    x: Array,
    p: Array,
    *,
    count: int = 6,
    near: Spectrum | None = None,
    state_error: float = 0.0,
) -> Spectrum:
    """Leading growth rates and modes, dimensionless, with the neutral ones of conservation laws by name."""
    conserved = _conserved(problem, x, p) if isinstance(problem, KeyedProblem) else {}
    return solve_spectrum(problem, x, p, Spectral(count=count, state_error=state_error), near=near, conserved=conserved)


def _conserved(problem: KeyedProblem, x: Array, p: Array) -> dict[str, Array]:
    """Gradients (n,) of quantities that no motion changes: without turnover the amount, int c r h du."""
    base = problem.base
    fields, parameters = base.system.fields, base.system.parameters
    if "c" not in fields or problem.powers.value(p)[parameters.index("turnover_rate")] != 0.0:
        return {}
    state = base.unpack(x)
    values, rule = state.stage_values(), state.rule
    weights = state.widths[:, None] * rule.weights
    h = base.system.scalars.index("h")
    gradient = State(
        state.mesh,
        np.zeros_like(state.nodes),
        np.zeros_like(state.slopes),
        np.zeros_like(state.algebraic),
        np.zeros_like(state.scalars),
    )
    for one, other in (("c", "r"), ("r", "c")):
        share = weights * values[..., fields.index(other)] * state.scalars[h]
        gradient.nodes[:-1, fields.index(one)] += share.sum(axis=1)
        gradient.slopes[..., fields.index(one)] += state.widths[:, None] * (share @ rule.matrix)
    gradient.scalars[h] = (weights * values[..., fields.index("c")] * values[..., fields.index("r")]).sum()
    return {AMOUNT: base.pack(gradient)}
