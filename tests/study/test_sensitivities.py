"""Derivatives of observables and outlines by the adjoint: against closed forms and differences of solved states."""

import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.shell import Shell, one_complaint

from shapespace.analysis.stationary import solve_stationary
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.numerics.collocation import CollocationLinearisation
from shapespace.numerics.newton import Newton
from shapespace.study.engine import Engine
from shapespace.study.rows import blank_row, place_moves
from shapespace.study.scenario import scenario
from shapespace.study.steady import Steady, observables_at, steady

PLACES = np.array([0.0, 0.11, 0.5, 0.83, 1.0])
STEPS = {1.0: 8.0, -1.0: -8.0, 2.0: -1.0, -2.0: 1.0}
"""Weights/12 of a difference that misses by the fourth power of the step."""


def differences(state: Steady, key: str) -> tuple[dict[str, float], Array]:
    """Derivatives of all observables and of the outline by a key, from states solved beside it on the same mesh."""
    value = float(state.scenario.values()[key])
    step = 1e-4 * max(abs(value), 0.1)
    slopes, outline = dict.fromkeys(state.observables, 0.0), np.zeros((len(PLACES), 2))
    for steps, weight in STEPS.items():
        beside = state.scenario.with_overrides({key: value + steps * step})
        engine = replace(Engine.of(beside), problem=state.problem.base)
        found = solve_stationary(engine.problem, state.found.x, engine.p, Newton(1e-11), max_moves=0)
        assert found.outcome.is_success
        factor = weight / (12.0 * step)
        for name, seen in observables_at(beside, engine.problem, found.x).items():
            slopes[name] += factor * seen
        outline += factor * replace(state, scenario=beside, found=found).outline(PLACES)
    return slopes, outline


def check(state: Steady, keys: list[str]) -> None:
    """Every derivative to 1e-6 of itself, or to what round-off leaves of a difference."""
    assert state.outcome.is_success
    found, outline = state.sensitivity((), keys), state.outline_sensitivity(PLACES, keys)
    assert {*state.observables} - {*found} == {"discretisation_error", "boundary_residual"}
    for i, key in enumerate(keys):
        slopes, moved = differences(state, key)
        value = max(abs(float(state.scenario.values()[key])), 0.1)
        for name, row in found.items():
            size = abs(state.observables["dissipation" if name == "energy_residual" else name])
            bound = 1e-6 * abs(slopes[name]) + 1e-8 * (1.0 + size) / value
            if name == "ring_position":
                if abs(state.observables[name] - 0.5) < 1e-3:
                    continue  # a mirror image of the place is as good, and round-off chooses between them
                # Where a maximum is, is known to the root of the round-off only.
                bound = 1e-3 * abs(slopes[name]) + 1e-3 / value
            assert abs(row[key] - slopes[name]) < bound, (name, key, row[key], slopes[name])
        np.testing.assert_allclose(outline[..., i], moved, rtol=1e-6, atol=1e-7 / value)


def test_the_resting_sphere_in_closed_form():
    """p = 2 gamma/R + Pe D eta_b/R^3 with f(c0) = 1/2; volume and area are those of the sphere."""
    case = scenario("polar-swimmer", elements=20, peclet=10.0, tension=1.5, sphere_radius=1.3, diffusivity=0.7)
    v, radius = case.parameters, 1.3
    state = steady(case, state="trivial")
    found = state.sensitivity(["pressure", "volume", "area", "velocity"], ["tension", "sphere_radius", "peclet"])
    drive = v.diffusivity * v.bulk_viscosity / radius**3
    exact = {
        "pressure": [2.0 / radius, -2.0 * v.tension / radius**2 - 30.0 * drive / radius, drive],
        "volume": [0.0, 4.0 * np.pi * radius**2, 0.0],
        "area": [0.0, 8.0 * np.pi * radius, 0.0],
        "velocity": [0.0, 0.0, 0.0],
    }
    for name, slopes in exact.items():
        assert [*found[name].values()] == pytest.approx(slopes, rel=1e-8, abs=1e-8), name
    angle = np.pi * PLACES
    outline = state.outline_sensitivity(PLACES, ["sphere_radius"])[..., 0]
    np.testing.assert_allclose(outline[:, 0], np.sin(angle), atol=1e-8)
    np.testing.assert_allclose(outline[:, 1] - outline[2, 1], np.cos(angle), atol=1e-8)


def test_a_divided_surface_against_differences():
    """With a neck and a ring, and a key that changes the units."""
    start = scenario("guided-division", elements=20, mesh_tolerance=1e-3, ring_amplitude=1.5)
    check(steady(start), ["ring_amplitude", "bending_rigidity", "peclet"])


def test_how_the_largest_concentration_moves():
    """c = 1 - (u - 0.3)^2 + a u is largest at u = 0.3 + a/2; of c = 1 + a u the place stays at the end."""
    problem = Engine.of(scenario("guided-division", elements=20)).problem
    blank, column = blank_row(problem), problem.system.fields.index("c")
    u, stages = problem.mesh, blank.stage_points
    along = deepcopy(blank)
    along.nodes[:, column], along.slopes[..., column] = u, 1.0
    blank.nodes[:, column], blank.slopes[..., column] = 1.0 - (u - 0.3) ** 2, -2.0 * (stages - 0.3)
    x, a = problem.pack(blank), problem.pack(along)
    assert place_moves(problem, x, blank, "c", 0.3) @ a == pytest.approx(0.5)
    assert not place_moves(problem, a, along, "c", 1.0).any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("polar-swimmer", ["peclet", "turnover_rate", "sphere_radius", "inverse_hydrodynamic_length"]),
        ("membrane-protrusion", ["pulling_force", "boundary_tension", "base_radius"]),
        ("vesicle", ["reduced_volume", "area_radius", "bending_rigidity"]),
    ],
)
def test_other_states_against_differences(name: str, keys: list[str]):
    check(steady(scenario(name, elements=40)), keys)


def test_what_has_no_derivative_is_refused(monkeypatch: pytest.MonkeyPatch):
    state = steady(scenario("polar-swimmer", elements=20, peclet=10.0), state="trivial")
    for names, keys, part in (
        (
            ["velocty"],
            ["peclet"],
            "velocty: is no observable of this state with a derivative; the nearest one is velocity",
        ),
        (["boundary_residual"], ["peclet"], "boundary_residual: is no observable"),
        ([], ["elements"], "elements: is not a parameter"),
    ):
        with pytest.raises(InputError, match=part):
            state.sensitivity(names, keys)
    with pytest.raises(InputError, match="no stationary state here"):
        steady(scenario("polar-swimmer", elements=20, peclet=10.0)).sensitivity([], ["peclet"])
    monkeypatch.setattr(CollocationLinearisation, "is_singular", True)
    with pytest.raises(InputError, match="fold or branch point"):
        replace(state).sensitivity([], ["peclet"])


def test_the_command_prints_derivatives(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    shell = Shell(capsys)
    command = ("steady", "polar-swimmer", "--state", "trivial", "-s", "elements=20", "peclet=10", "tension=1.5")
    record = json.loads(shell(*command, "--sensitivity", "tension, peclet", "--json").out)
    assert record["sensitivities"]["pressure"] == pytest.approx({"tension": 2.0, "peclet": 1.0})
    assert "by tension" in shell(*command, "--sensitivity", "tension").out
    out = tmp_path / "state"
    assert "tensoin: is not a parameter" in one_complaint(shell(*command, "--sensitivity", "tensoin", "--out", out))
    assert not out.exists()
