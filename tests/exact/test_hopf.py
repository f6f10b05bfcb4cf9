"""Oscillations of the sphere set in where the pair of l = 2 crosses the imaginary axis: closed form in `closed_forms`."""

import numpy as np
import pytest

import shapespace as ss
from shapespace.study.engine import Engine
from shapespace.study.verification.closed_forms import rate_matrix


@pytest.mark.slow
def test_the_sphere_begins_to_oscillate_where_its_trace_vanishes():
    """At Pe = 40, k = 9, Gamma = 20: -(s/4)(1 + g) + Pe/2 - 6 - k = 0 with s = 4 (gamma + 26), g = 1/4, so gamma = -22."""
    case = ss.scenario("polar-swimmer", elements=20, peclet=40.0, friction=20.0)
    found = ss.branch(case, "tension", -23.0, start=-21.0, state="trivial")
    (hopf,) = [point for point in found.special_points if point.kind == "hopf"]
    assert abs(hopf.parameter + 22.0) <= hopf.parameter_error < 1e-5
    assert (hopf.n_unstable_before, hopf.n_unstable_after) == (1, 3)  # l = 1 grows on both sides
    matrix = rate_matrix(2, Engine.of(found.scenario_at(hopf)).values)
    frequency = np.sqrt(np.linalg.det(matrix))
    np.testing.assert_allclose(hopf.growth_rates[1:3], [[0.0, frequency], [0.0, -frequency]], atol=1e-6)
    assert not found.missed
