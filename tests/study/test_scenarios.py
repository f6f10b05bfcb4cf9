"""The scenarios do what the paper describes (Figs. 2, 4, 6), and the numbers reported of them are converged."""

import numpy as np
import pytest

from shapespace.base.outcome import Outcome
from shapespace.study.run import Run, run
from shapespace.study.scenario import scenario


@pytest.fixture(scope="module")
def division() -> Run:
    """Guided division as shipped."""
    return run(scenario("guided-division"))


def over_time(result: Run, name: str) -> np.ndarray:
    """An observable at all frames that have it."""
    return np.array([frame.observables[name] for frame in result.frames if name in frame.observables])


def test_guided_division_ingresses_to_a_finite_stationary_neck(division: Run) -> None:
    """Fig. 6: the surface ingresses monotonically until t = 0.2 and keeps a neck with |C_uu| R0 of a few hundred."""
    assert division.outcome is Outcome.STATIONARY
    times = np.array([frame.time for frame in division.frames])
    neck = over_time(division, "equator_radius")
    ingressing = neck[times < 0.2]
    assert (np.diff(ingressing) < 0.0).all()
    assert ingressing[-1] < 0.005
    assert 200.0 < division.observables["max_meridional_curvature"] < 400.0
    assert 0.003 < division.observables["neck_radius"] < 0.005
    settled = neck[times > 0.5]
    assert len(settled) > 1
    assert np.ptp(settled) < 1e-4 * settled[-1], f"neck still moves by {np.ptp(settled):.1e}"


def test_guided_division_is_symmetric_to_round_off(division: Run) -> None:
    last = division.frames[-1]
    assert abs(last.observables["velocity"]) < 1e-10
    assert abs(last.observables["polarity"]) < 1e-9
    mirrored = last.nodes[::-1]
    assert np.abs(last.nodes[:, 0] - mirrored[:, 0]).max() < 1e-11
    assert np.abs(last.nodes[:, 1] + mirrored[:, 1]).max() < 1e-11


@pytest.mark.slow
def test_neck_radius_is_converged_in_mesh_degree_and_time(division: Run) -> None:
    """To 1e-4 of itself against runs with other meshes, degrees, and time tolerances; the table is in the message."""
    reference = run(scenario("guided-division", mesh_tolerance=1e-8, degree=5)).observables["neck_radius"]
    changes: list[dict[str, float]] = [
        {"mesh_tolerance": 1e-4},
        {"mesh_tolerance": 1e-5},
        {"mesh_tolerance": 1e-6},
        {"degree": 3},
        {"degree": 5},
        {"time_tolerance": 1e-3},
        {"stationary_rate": 1e-7},
    ]
    table = {str(change): run(scenario("guided-division", **change)).observables["neck_radius"] for change in changes}
    table["as shipped"] = division.observables["neck_radius"]
    errors = {name: abs(value / reference - 1.0) for name, value in table.items()}
    assert max(errors.values()) < 1e-4, f"neck radius {reference:.12f}, relative differences {errors}"
    assert errors["as shipped"] < 1e-6, errors


def test_membrane_rises_to_a_stationary_protrusion_without_neck() -> None:
    """Fig. 2: from the flat disc at C0 R_b = 9."""
    result = run(scenario("membrane-protrusion", until=4.0))
    assert result.outcome is Outcome.STATIONARY
    assert "neck_radius" not in result.observables
    heights = over_time(result, "height")
    assert (np.diff(heights) > 0.0).all() or np.diff(heights).min() > -1e-6
    assert 0.3 < result.observables["height"] < 0.5
    assert result.observables["dissipation"] < 1e-6


def test_fixed_steps_of_the_paper_reach_the_same_protrusion() -> None:
    """dt = 4e-4 from the flat disc, the paper's scheme, follows the adaptive run to first order in the step."""
    paper = run(scenario("membrane-protrusion", dt=4e-4, until=0.02))
    adaptive = run(scenario("membrane-protrusion", until=0.02))
    assert paper.outcome is adaptive.outcome is Outcome.REACHED_END
    difference = abs(paper.observables["height"] / adaptive.observables["height"] - 1.0)
    assert difference < 0.05, f"heights differ by {difference:.1%}"


def test_perturbed_sphere_polarises_and_swims() -> None:
    """Fig. 5's parameters: beyond Pe* = 22 the sphere turns into a stationary swimmer of constant shape and speed."""
    result = run(scenario("polar-swimmer"))
    assert result.outcome is Outcome.STATIONARY
    assert abs(result.observables["velocity"]) > 1.0
    assert abs(result.observables["polarity"]) > 0.1
    lengths = over_time(result, "length")[-3:]
    assert np.ptp(lengths) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("peclet", [60.0, 450.0])
def test_ring_slips_to_a_pole_and_the_surface_swims(peclet: float) -> None:
    """Fig. 4: the ring ingresses in the middle, slips to a pole, and the surface swims on at constant shape."""
    result = run(scenario("ring-slipping", peclet=peclet, mesh_tolerance=1e-4, until=50.0))
    assert result.outcome is Outcome.STATIONARY
    ring = over_time(result, "ring_position")
    assert abs(ring[0] - 0.5) < 1e-3
    assert over_time(result, "equator_radius").min() < 0.9
    assert min(ring[-1], 1.0 - ring[-1]) < 1e-6, f"ring ends at u = {ring[-1]:.4f}"
    assert abs(result.observables["velocity"]) > 1.0
    assert np.ptp(over_time(result, "length")[-3:]) < 1e-5
