"""Places between neighbours of a branch: on the branch, at a change, and where oscillations set in."""

from itertools import pairwise

import jax.numpy as jnp
import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.passage import first_change, growing_pairs, locate_hopf, point_between
from shapespace.analysis.stability import Spectral, Spectrum, solve_spectrum
from shapespace.base.arrays import Traced


def brusselator(x: Traced, p: Traced) -> Traced:
    """At rest at (1, p), with a Hopf point of frequency 1 at p = 2."""
    reaction = x[0] ** 2 * x[1]
    return jnp.stack([1.0 - (p[0] + 1.0) * x[0] + reaction, p[0] * x[0] - reaction])


def neighbours(value: float) -> tuple[Point, Point]:
    """Points on both sides of a value."""
    problem = AlgebraicProblem(brusselator, 2)
    first = start_point(problem, np.array([1.0, 1.5]), np.array([1.5]), 0)
    assert isinstance(first, Point)
    points = [first, *Continuation([first], (), Arclength(first=0.1, max_points=40))]
    return next(pair for pair in pairwise(points) if pair[0].parameter < value < pair[1].parameter)


def spectrum(point: Point) -> Spectrum:
    assert isinstance(point.problem, AlgebraicProblem)
    return solve_spectrum(point.problem, point.x, point.p, Spectral(count=2))


def test_points_between_are_on_the_branch():
    before, after = neighbours(2.0)
    for share in (0.2, 0.9):
        place = point_between(before, after, share)
        assert place is not None
        np.testing.assert_allclose(place.x, [1.0, place.parameter], atol=1e-12)
        assert before.parameter < place.parameter < after.parameter


def test_a_change_is_found_between_two_close_places():
    before, after = neighbours(1.95)
    low, high = first_change(before, after, lambda place: place.parameter > 1.95)
    assert low.parameter <= 1.95 < high.parameter
    assert high.parameter - low.parameter < 1e-5


def test_the_hopf_point_of_the_brusselator():
    before, after = neighbours(2.0)
    spectra = (spectrum(before), spectrum(after))
    assert [growing_pairs(one) for one in spectra] == [0, 1]
    hopf = locate_hopf(before, after, spectra, spectrum)
    assert hopf is not None
    assert hopf.frequency == pytest.approx(1.0, abs=1e-8)
    assert abs(hopf.point.parameter - 2.0) < 1e-8
    assert abs(hopf.point.parameter - 2.0) <= hopf.parameter_error + 1e-12
