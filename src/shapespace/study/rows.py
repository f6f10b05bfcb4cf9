"""Values of fields at single places, with their derivatives by the state, as linear forms of it."""

import numpy as np

from shapespace.base.arrays import Array
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.state import State

Linear = tuple[float, Array]
"""A value and its gradient (n,) by x."""


def blank_row(base: CollocationProblem) -> State:
    """A gradient to fill in: zero, laid out as a state."""
    return base.unpack(
        np.zeros((base.elements + 1) * base.n + base.elements * base.degree * base.n_rows + len(base.system.scalars))
    )


def value_at(base: CollocationProblem, x: Array, field: str, u: float) -> Linear:
    """A differential field at u."""
    state, gradient, column = base.unpack(x), blank_row(base), base.system.fields.index(field)
    if u == 1.0:
        gradient.nodes[-1, column] = 1.0
        return float(state.nodes[-1, column]), base.pack(gradient)
    element, share = state.place(u)
    gradient.nodes[element, column] = 1.0
    gradient.slopes[element, :, column] = state.widths[element] * state.rule.basis_integral(np.array([share]))[0]
    row = base.pack(gradient)
    return float(row @ x), row


def slope_at(base: CollocationProblem, x: Array, field: str, u: float) -> Linear:
    """The derivative of a differential field at u."""
    state, gradient = base.unpack(x), blank_row(base)
    element, share = state.place(u)
    gradient.slopes[element, :, base.system.fields.index(field)] = state.rule.basis(np.array([share]))[0]
    row = base.pack(gradient)
    return float(row @ x), row


def algebraic_at(problem: CollocationProblem, state: State, name: str, u: float) -> Array:
    """The gradient of an algebraic field at u."""
    gradient, (element, share) = blank_row(problem), state.place(u)
    column = problem.system.algebraic.index(name)
    gradient.algebraic[element, :, column] = state.rule.basis(np.array([share]))[0]
    return problem.pack(gradient)


def place_moves(problem: CollocationProblem, x: Array, state: State, name: str, u: float) -> Array:
    """The gradient of where a field has its largest value, du = -dy'(u)/y''(u); it stays at an end, and of an even field."""
    (element, share), rule = state.place(u), state.rule
    values = state.slopes[element, :, problem.system.fields.index(name)]
    slopes = np.polynomial.Polynomial.fit(rule.points, values, rule.degree - 1, domain=[0.0, 1.0])
    bend = float(slopes.deriv()(share)) / state.widths[element]
    row = slope_at(problem, x, name, u)[1]
    return -row / bend if 0.0 < u < 1.0 and bend < 0.0 else np.zeros_like(row)
