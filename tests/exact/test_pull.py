"""A small pull on a clamped disc under tension, in closed form (exact result 8)."""

import numpy as np
import pytest

import shapespace as ss
from shapespace.study.engine import state_of
from shapespace.study.verification.closed_forms import point_response


def test_the_pull_response_tends_to_that_of_a_point_force():
    """The pulled patch spreads the force over a disc of radius sqrt(2 a): the response misses by O(a ln a)."""
    exact = point_response(12.5)
    assert exact == pytest.approx(0.0114124761, rel=1e-8)
    misses, areas = [], (8e-4, 8e-5)
    for area in areas:
        case = ss.scenario(
            "membrane-protrusion", spontaneous_curvature=0.0, boundary_tension=12.5, elements=80,
            pulled_area=area, pulled_sharpness=2.0 / area, pulling_force=0.01,
        )  # fmt: skip
        steady = ss.steady(case)
        assert steady.outcome.is_success
        misses.append(1.0 - steady.observables["height"] / steady.observables["pulling_force"] / exact)
    assert 0.0 < misses[1] < 3e-3, misses
    order = np.log(misses[0] / misses[1]) / np.log(areas[0] / areas[1])
    assert 0.75 < order < 1.0, f"misses {misses}: a ln a has the slope 1 - 1/ln(1/a), 0.88 here"


def test_a_long_tether_is_a_cylinder_at_its_plateau_force():
    """Force 2 pi sqrt(2 kappa gamma), radius sqrt(kappa/2 gamma) (exact result 7), with the height prescribed."""
    case = ss.scenario("membrane-protrusion", spontaneous_curvature=0.0, boundary_tension=12.5)
    held = ss.branch(case, "height", 4.0, start=0.5, free="pulling_force", stability=False)
    assert held.outcome is not None
    assert held.outcome.is_success
    # What the ends add to the force dies away as exp(-height/radius), to the radius with half that exponent's rate.
    assert held["end-1"].freed == pytest.approx(2.0 * np.pi * 5.0, rel=1e-6)
    state = state_of(held["end-1"].frame)
    u = np.linspace(0.0, 1.0, 400)
    r, z = state.values(u)[:, :2].T
    middle = np.abs(z - 2.0) < 0.3
    assert middle.sum() > 10
    assert r[middle] == pytest.approx(0.2, rel=5e-3)
