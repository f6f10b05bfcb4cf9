"""Curvature and measures of surfaces known in closed form, and identities that any motion obeys."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from shapespace.base.arrays import Array, Traced
from shapespace.geometry.curve import (
    Geometry,
    area_element,
    azimuthal_curvature,
    meridional_curvature,
    tangent_slopes,
    total_curvature,
    volume_element,
)
from shapespace.geometry.motion import (
    Rates,
    axial_velocity,
    coordinate_flow,
    divergence,
    normal_velocity,
    strain_rate,
)
from shapespace.geometry.parameterization import eulerian_rates, lagrangian_rates

_X, _W = np.polynomial.legendre.leggauss(60)
NODES, WEIGHTS = (_X + 1) / 2, _W / 2
ANGLES = np.pi * NODES

positive = st.floats(0.2, 5.0)
signed = st.floats(-2.0, 2.0)
examples = settings(max_examples=25, deadline=None)


def spheroid(a: float, b: float) -> Geometry:
    """r = a sin(theta), z = b cos(theta) with theta = pi u; psi' by differentiating psi."""

    def angle(u: Traced) -> Traced:
        return jnp.arctan2(b * jnp.sin(jnp.pi * u), a * jnp.cos(jnp.pi * u))

    psi, dpsi = jax.vmap(jax.value_and_grad(angle))(jnp.asarray(NODES))
    h = np.pi * np.hypot(a * np.cos(ANGLES), b * np.sin(ANGLES))
    return Geometry(a * np.sin(ANGLES), psi, dpsi, h, 0 * ANGLES)


def random_motion(seed: int) -> tuple[Geometry, Rates, Rates]:
    """Unrelated shapes, v_n, v_u, v_phi and slopes of these, one per node; returned as material motion."""
    rng = np.random.default_rng(seed)
    n = len(NODES)
    g = Geometry(
        rng.uniform(0.4, 2, n), rng.uniform(-4, 4, n), rng.normal(size=n), rng.uniform(0.5, 2, n), rng.uniform(size=n)
    )
    v_n, dv_n, v_u, dv_u, v_phi, dv_phi = rng.normal(size=(6, n))
    unknown = np.full(n, np.nan)
    return g, lagrangian_rates(g, v_n, dv_n, v_u, dv_u, v_phi), Rates(*[unknown] * 4, dv_u, dv_phi)


@examples
@given(radius=positive)
def test_sphere(radius: float):
    """Both curvatures 1/R, area 4 pi R^2, volume 4 pi R^3/3."""
    u = NODES
    g = Geometry(radius * np.sin(np.pi * u), np.pi * u, np.pi + 0 * u, np.pi * radius + 0 * u, 0 * u)
    for curvature in (meridional_curvature(g), azimuthal_curvature(g), total_curvature(g) / 2):
        assert_allclose(curvature, 1 / radius, rtol=1e-12)
    assert_allclose(2 * np.pi * np.dot(WEIGHTS, area_element(g)), 4 * np.pi * radius**2, rtol=1e-12)
    assert_allclose(np.dot(WEIGHTS, volume_element(g)), 4 * np.pi / 3 * radius**3, rtol=1e-12)


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.6), (1.0, 0.4), (0.7, 1.0)])
def test_spheroid(a: float, b: float):
    """Curvatures a b/s^3 and b/(a s) with s^2 = a^2 cos^2 + b^2 sin^2, which differ; slopes of r and z; volume."""
    g = spheroid(a, b)
    s = np.sqrt((a * np.cos(ANGLES)) ** 2 + (b * np.sin(ANGLES)) ** 2)
    assert_allclose(meridional_curvature(g), a * b / s**3, rtol=1e-12)
    assert_allclose(azimuthal_curvature(g), b / (a * s), rtol=1e-12)
    assert_allclose(total_curvature(g), a * b / s**3 + b / (a * s), rtol=1e-12)
    dr, dz = tangent_slopes(g)
    assert_allclose(dr, np.pi * a * np.cos(ANGLES), atol=1e-12)
    assert_allclose(dz, -np.pi * b * np.sin(ANGLES), atol=1e-12)
    assert_allclose(np.dot(WEIGHTS, volume_element(g)), 4 * np.pi / 3 * a**2 * b, rtol=1e-12)


def test_catenoid_is_minimal_and_its_outline_curves_inward():
    """r = cosh(z), downwards: curvatures -1/r^2 along the meridian and 1/r^2 around, so 2H = 0."""
    z = np.linspace(1.5, -1.5, 31)
    r, h = np.cosh(z), 3 * np.cosh(z)
    g = Geometry(r, np.arctan2(3.0, -3 * np.sinh(z)), -3 / r, h, 0 * z)
    assert_allclose(tangent_slopes(g)[0], -3 * np.sinh(z), atol=1e-12)
    assert_allclose(meridional_curvature(g), -1 / r**2, rtol=1e-12)
    assert_allclose(azimuthal_curvature(g), 1 / r**2, rtol=1e-12)
    assert_allclose(total_curvature(g), 0.0, atol=1e-14)


def test_velocity_has_the_same_components_in_both_frames():
    """Lagrangian points move at v: v_n and v . e_z from their rates, and no flow past the mesh."""
    g, rates, _ = random_motion(0)
    sin, cos = np.sin(g.psi), np.cos(g.psi)
    v_n = normal_velocity(g, rates)
    assert_allclose(v_n * sin + rates.meridional_velocity * cos, rates.r, atol=1e-14)
    assert_allclose(axial_velocity(g, rates), rates.z, atol=1e-14)
    assert_allclose(coordinate_flow(g, rates), 0.0, atol=1e-14)


def test_eulerian_points_move_along_the_normal():
    g, rates, _ = random_motion(1)
    v_n = normal_velocity(g, rates)
    found = eulerian_rates(g, v_n, 0 * v_n, rates.meridional_velocity, rates.azimuthal_velocity)
    assert_allclose(normal_velocity(g, found), v_n, atol=1e-14)
    assert_allclose(coordinate_flow(g, found), rates.meridional_velocity, atol=1e-14)
    assert_allclose(found.r * np.cos(g.psi) - found.z * np.sin(g.psi), 0.0, atol=1e-14)


def test_strain_rate_is_the_stretching_of_material_lines():
    """S_uu = (dh/dt)/h and S_phiphi = (dr/dt)/r at fixed material points, hence div v = d(ln r h)/dt."""
    g, rates, gradients = random_motion(2)
    s = strain_rate(g, rates, gradients)
    assert_allclose(s.uu, rates.h / g.h, atol=1e-13)
    assert_allclose(s.phiphi, rates.r / g.r, atol=1e-13)
    assert_allclose(divergence(g, rates, gradients), rates.h / g.h + rates.r / g.r, atol=1e-13)


@examples
@given(turn=signed, twist=signed)
def test_shear_in_the_surface(turn: float, twist: float):
    """v_phi = r (turn + twist s) with arc length s: S_uphi = r twist/2, whatever the rigid rotation."""
    g, rates, gradients = random_motion(3)
    arc = np.linspace(0.0, 1.0, len(NODES))
    slope = g.h * np.cos(g.psi) * (turn + twist * arc) + g.r * twist * g.h
    moved = rates._replace(azimuthal_velocity=g.r * (turn + twist * arc))
    found = strain_rate(g, moved, gradients._replace(azimuthal_velocity=slope))
    assert_allclose(found.uphi, g.r * twist / 2, atol=1e-13)


def area_along(share: Array, g: Geometry, w: Rates, dw: Rates, dflow: Array) -> tuple[Array, Array]:
    """d(r h)/dt + (r h q)' and r h div v for material motion plus a mesh that slides by `share` along e_u."""
    sin, cos = np.sin(g.psi), np.cos(g.psi)
    moved = w._replace(r=w.r + share * cos, z=w.z - share * sin, h=w.h + dflow)
    local = moved.r * g.h + g.r * moved.h
    flow = coordinate_flow(g, moved)
    return local + g.h * cos * flow - g.r * dflow, area_element(g) * divergence(g, moved, dw)


def test_area_balance_on_any_mesh():
    """d(r h)/dt + (r h q^u)' = r h div v with h q^u = -slide, whatever the mesh does (dtg)."""
    g, rates, gradients = random_motion(4)
    slide, dslide = np.random.default_rng(9).normal(size=(2, len(NODES)))
    found, expected = area_along(slide, g, rates, gradients, dslide)
    assert_allclose(found, expected, atol=1e-12)
