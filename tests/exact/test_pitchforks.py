"""Pitchforks of resting states in closed form: the polarizing sphere and the buckling disc (exact results 2 and 6)."""

from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
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


@pytest.fixture(scope="module")
def oblong(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sphere through its first two instabilities: l = 1 at Pe = 22, l = 2 at 55."""
    path = tmp_path_factory.mktemp("oblong") / "sphere"
    case = scenario("polar-swimmer", elements=20)
    ss.branch(case, "peclet", 56.5, start=54.0, state="trivial", out=path)
    return path


def test_the_sphere_elongates_at_a_transcritical_point(oblong: Path):
    """l = 2, whose two signs differ: c0 z g = (1 + g) q (exact result 3 at rate zero), so Pe = 2 (6 + k)(1 + 1/g)."""
    values = scenario("polar-swimmer").values()
    g = 6.0 / (4.0 * values["shear_viscosity"] + values["friction"])
    exact = 2.0 * (6.0 + values["turnover_rate"]) * (1.0 + 1.0 / g)
    point = ss.open_branch(oblong)["transcritical-1"]
    assert abs(point.parameter - exact) <= point.parameter_error < 1e-7
    assert abs(point.parameter - exact) < 1e-8
    assert (point.n_unstable_before, point.n_unstable_after) == (1, 2)


def test_both_sides_of_a_transcritical_point(oblong: Path):
    """The other branch, at rest: flatter shapes beyond the point, longer ones before it, which then fold."""
    case = scenario("polar-swimmer", elements=20)
    flat, long = (
        ss.branch(case, "peclet", 55.5, origin=f"{oblong}:transcritical-1", side=side, stability=False)
        for side in (1, -1)
    )
    assert [point.label for point in flat.special_points] == ["end-1"]
    assert {point.kind for point in long.special_points} == {"fold", "end"}
    assert long["fold-1"].parameter < 55.0
    for branch, sign in ((flat, -1.0), (long, 1.0)):
        heights = [sign * (point.observables["height"] - 2.0) for point in branch.points[1:]]
        assert min(heights) > 0.0
        assert max(abs(point.observables["velocity"]) for point in branch.points) < 1e-7


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
