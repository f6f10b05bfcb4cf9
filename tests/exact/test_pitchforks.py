"""Pitchforks of resting states in closed form: the polarizing sphere and the buckling disc (exact results 2 and 6)."""

import numpy as np
import pytest

from shapespace.analysis.bifurcation import Kind, SingularPoint, locate_branch_point
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.newton import Newton, solve_root
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.verification.closed_forms import buckling_tension, polar_onset


def resting(case: Scenario, key: str) -> tuple[KeyedProblem, Array, Array, Array]:
    """(problem, x, p, tangent) of the reference state, followed in one key."""
    problem, engine = KeyedProblem.of(case, (key,)), Engine.of(case)
    p = np.array([float(case.values()[key])])
    x = problem.base.pack(engine.initial_state())
    rest = REST
    root = solve_root(problem, x, p, rest, Newton(1e-11))
    assert root.outcome is Outcome.CONVERGED
    _, linearisation = problem.linearise(root.x, p, rest)
    along = -linearisation.solve(problem.derivative(root.x, p, np.zeros_like(x), np.ones(1)))
    tangent = np.append(along, 1.0)
    length = np.sqrt(problem.weights(root.x) @ along**2 + 1.0 / max(abs(p[0]), 1.0) ** 2)
    return problem, root.x, p, tangent / length


@pytest.mark.parametrize(("saturation", "turnover", "start"), [(1.0, 9.0, 21.0), (10.0, 45.0, 2390.0)])
def test_the_sphere_polarizes_at_its_peclet_number(saturation: float, turnover: float, start: float):
    """Pe* = (2 + k R^2/D)/(c0 f'(c0)), a pitchfork: 22 for c_s = c0, k = 9; 2397.235 for c_s = 10 c0, k = 45."""
    exact = polar_onset(saturation, turnover)
    case = scenario(
        "polar-swimmer",
        seed_amplitude=0.0,
        elements=20,
        peclet=start,
        saturation_concentration=saturation,
        turnover_rate=turnover,
    )
    point = locate_branch_point(*_arguments(resting(case, "peclet")))
    assert isinstance(point, SingularPoint)
    assert point.kind is Kind.PITCHFORK
    error = abs(point.parameter - exact) / exact
    assert error < 1e-9, f"relative error {error:.1e}"
    assert abs(point.parameter - exact) <= point.parameter_error


def test_the_clamped_disc_buckles_at_its_tension():
    """gamma = -j_{1,1}^2 kappa/R_b^2 = -14.681970642, a pitchfork."""
    case = scenario("membrane-protrusion", spontaneous_curvature=0.0, boundary_tension=-14.0, elements=20)
    point = locate_branch_point(*_arguments(resting(case, "boundary_tension")))
    assert isinstance(point, SingularPoint)
    assert point.kind is Kind.PITCHFORK
    assert abs(point.parameter - buckling_tension()) < 1e-8
    assert abs(point.parameter - buckling_tension()) <= point.parameter_error


def _arguments(state: tuple[KeyedProblem, Array, Array, Array]) -> tuple[KeyedProblem, int, Array, Array, Array]:
    problem, x, p, tangent = state
    return problem, 0, x, p, tangent
