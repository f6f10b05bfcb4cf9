"""Leaning spheroids against closed forms: area, volume, arc length, curvatures."""

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.special import ellipeinc

from shapespace.geometry.spheroid import Spheroid


@pytest.mark.parametrize(("equatorial", "polar"), [(0.3, 1.7), (1.4, 0.2), (1.0, 1.0001)])
def test_area_and_arc_length_of_a_spheroid(equatorial: float, polar: float):
    """2 pi a^2 (1 + c/(a e) arcsin e) for a long one, 2 pi a^2 (1 + c^2/(e a^2) artanh e) for a flat one; elliptic integrals."""
    shape, low, high = Spheroid(equatorial, polar), min(equatorial, polar), max(equatorial, polar)
    e = np.sqrt(1.0 - (low / high) ** 2)
    part = (
        polar / (equatorial * e) * np.arcsin(e) if polar > equatorial else (polar / equatorial) ** 2 * np.arctanh(e) / e
    )
    assert shape.area == pytest.approx(2.0 * np.pi * equatorial**2 * (1.0 + part), rel=1e-12)
    # From the equator the arc length is c E(angle | 1 - a^2/c^2).
    t, m = np.linspace(0.0, np.pi, 41), 1.0 - (equatorial / polar) ** 2
    arc = polar * (ellipeinc(0.5 * np.pi, m) + ellipeinc(t - 0.5 * np.pi, m))
    assert shape.length == pytest.approx(arc[-1], rel=1e-12)
    np.testing.assert_allclose(shape.parameter(arc / arc[-1]), t, atol=1e-10)


@pytest.mark.parametrize("oblate", [False, True])
@pytest.mark.parametrize("leaning", [0.0, -0.4])
@pytest.mark.parametrize("reduced", [0.97, 0.6, 0.2])
def test_area_and_volume_are_as_asked(reduced: float, leaning: float, oblate: bool):
    """By quadrature of 2 pi r ds and pi r^2 dz; the outline's tangent and curvatures are its derivatives over arc length."""
    shape = Spheroid.of(3.0, reduced * np.sqrt(3.0) ** 3 / (6.0 * np.sqrt(np.pi)), oblate, leaning)
    x, w = legendre.leggauss(600)
    t, w = 0.5 * np.pi * (x + 1.0), 0.5 * np.pi * w
    (r, _), (dr, dz) = shape.outline(t), shape.slope(t)
    assert 2.0 * np.pi * (w @ (r * np.hypot(dr, dz))) == pytest.approx(3.0, rel=1e-11)
    assert shape.reduced_volume == pytest.approx(reduced, rel=1e-12)
    assert -np.pi * (w @ (r**2 * dz)) == pytest.approx(shape.volume, rel=1e-12)
    assert (shape.polar < shape.equatorial) == oblate
    step = 1e-6
    sides = [(shape.outline(t + d), shape.tangent_angle(t + d)) for d in (step, -step)]
    np.testing.assert_allclose((sides[0][0][0] - sides[1][0][0]) / (2.0 * step), dr, atol=1e-8)
    meridional, azimuthal = shape.curvatures(t)
    turning = (sides[0][1] - sides[1][1]) / (2.0 * step)
    np.testing.assert_allclose(meridional * shape.speed(t), turning, rtol=1e-6)
    np.testing.assert_allclose(azimuthal, np.sin(shape.tangent_angle(t)) / r, rtol=1e-9)
    poles = shape.curvatures(np.array([0.0, np.pi]))
    np.testing.assert_allclose(poles[0], poles[1], rtol=1e-9)


def test_no_shape_holds_more_than_a_sphere():
    with pytest.raises(ValueError, match="no spheroid has the reduced volume"):
        Spheroid.of(4.0 * np.pi, 4.2)
