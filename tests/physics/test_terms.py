"""Every term meets a closed form, its derivative, the signs and symmetries that its physics demands."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from shapespace.base.arrays import Array, Traced
from shapespace.geometry.curve import Geometry, area_element
from shapespace.geometry.motion import Rates, axial_velocity, coordinate_flow, strain_rate
from shapespace.geometry.parameterization import lagrangian_rates
from shapespace.physics.activity import ActiveMoment, ActiveTension
from shapespace.physics.bending import HelfrichBending, InducedBending
from shapespace.physics.chirality import ChiralTorque
from shapespace.physics.coat import BendingContrast, LineTension
from shapespace.physics.force import AxialForce, Pressure
from shapespace.physics.friction import NormalFriction, TangentialFriction
from shapespace.physics.patch import SmoothPatch, Uniform, patch_integral
from shapespace.physics.species import Ring, Species
from shapespace.physics.tension import FixedArea, Incompressibility, IsotropicTension
from shapespace.physics.term import AbstractEnergy, AbstractTerm, Ledger, Site, energy_power
from shapespace.physics.viscosity import BendingViscosity, BulkViscosity, ShearViscosity
from shapespace.variational.rayleighian import booked_power, density

_X, _W = np.polynomial.legendre.leggauss(60)
NODES, WEIGHTS = (_X + 1) / 2, _W / 2
ANGLES = np.pi * NODES
ZERO = np.zeros_like(NODES)
AT_REST = Rates(*[ZERO] * 6)

PATCH = SmoothPatch(1.7, 0.6, 2.0)
BENDING = {"uniform": HelfrichBending(1.3, Uniform(0.8)), "coated": HelfrichBending(1.3, PATCH)}
ENERGIES: dict[str, AbstractEnergy] = {
    **BENDING,
    "tension": IsotropicTension(0.9),
    "edge": LineTension(PATCH),
    "contrast": BendingContrast(PATCH, Uniform(0.8)),
}
VISCOUS: dict[str, AbstractTerm] = {
    "shear": ShearViscosity(0.7),
    "bulk": BulkViscosity(1.1),
    "bending viscosity": BendingViscosity(0.5),
}
DISSIPATIVE = {**VISCOUS, "friction": TangentialFriction(0.6, 0.0), "normal friction": NormalFriction(0.8)}
LINEAR: dict[str, AbstractTerm] = {
    **ENERGIES,
    "activity": ActiveTension(5.0, 0.4),
    "moment": ActiveMoment(1.7, 1.2),
    "induced": InducedBending(1.3, 0.8, 0.6, 0.9, 1.1),
    "torque": ChiralTorque(1.4, 1.2),
    "incompressibility": Incompressibility(-0.3),
    "area": FixedArea(-0.7),
    "force": AxialForce(PATCH),
    "pressure": Pressure(2.0),
}

positive = st.floats(0.3, 3.0)
signed = st.floats(-3.0, 3.0)
examples = settings(max_examples=20, deadline=None)


def sphere(radius: float) -> Geometry:
    """A sphere at the nodes, u from the upper pole to the lower one."""
    one = np.ones_like(NODES)
    area = radius**2 * (1 - np.cos(ANGLES))
    return Geometry(radius * np.sin(ANGLES), ANGLES, np.pi * one, np.pi * radius * one, area)


def total(power: Traced) -> float:
    """Integral over the surface of a density per du and per 2 pi."""
    return float(2 * np.pi * np.dot(WEIGHTS, power))


def growing(radius: float, speed: float, concentration: float = 0.0) -> Site:
    """A sphere whose radius grows at `speed`, without tangential flow."""
    rates = AT_REST._replace(r=speed * np.sin(ANGLES), z=speed * np.cos(ANGLES), h=np.pi * speed + ZERO)
    return Site(sphere(radius), rates, AT_REST, concentration + ZERO)


def flowing(radius: float, speed: float) -> Site:
    """A resting sphere with the flow v_u = speed sin(theta) from pole to pole."""
    rates = AT_REST._replace(meridional_velocity=speed * np.sin(ANGLES))
    return Site(sphere(radius), rates, AT_REST._replace(meridional_velocity=np.pi * speed * np.cos(ANGLES)), ZERO)


def twisting(radius: float, speed: float) -> Site:
    """A resting sphere whose halves turn against each other: v_phi = speed sin(theta) cos(theta)."""
    rates = AT_REST._replace(azimuthal_velocity=speed * np.sin(ANGLES) * np.cos(ANGLES))
    return Site(sphere(radius), rates, AT_REST._replace(azimuthal_velocity=np.pi * speed * np.cos(2 * ANGLES)), ZERO)


def random_shape(rng: np.random.Generator) -> Geometry:
    """Unrelated shapes, one per node."""
    n = len(NODES)
    psi, dpsi = rng.uniform(-np.pi, np.pi, n), rng.normal(size=n)
    return Geometry(rng.uniform(0.4, 2.0, n), psi, dpsi, rng.uniform(0.5, 1.5, n), rng.uniform(0.0, 1.2, n))


def random_site(seed: int) -> Site:
    """Unrelated shapes and motions, one per node."""
    rng = np.random.default_rng(seed)
    rates, gradients = (Rates(*rng.normal(size=(6, len(NODES)))) for _ in range(2))
    return Site(random_shape(rng), rates, gradients, rng.uniform(0.2, 3.0, len(NODES)))


# Closed forms.


@examples
@given(radius=positive, rigidity=positive, curvature=signed, speed=signed)
def test_bending_energy_of_a_sphere(radius: float, rigidity: float, curvature: float, speed: float):
    """8 pi kappa (1 - C0 R/2)^2, and its rate as the sphere grows."""
    bending, site = HelfrichBending(rigidity, Uniform(curvature)), growing(radius, speed)
    energy = bending.density(site.geometry) * area_element(site.geometry)
    excess = 1 - curvature * radius / 2
    assert_allclose(total(energy), 8 * np.pi * rigidity * excess**2, rtol=1e-12, atol=1e-12)
    assert_allclose(total(bending.power(site)), -8 * np.pi * rigidity * curvature * excess * speed, atol=1e-10)


@examples
@given(radius=positive, tension=signed, speed=signed)
def test_tensions_on_a_growing_sphere(radius: float, tension: float, speed: float):
    """Tension times 8 pi R dR/dt; the active one is half its amplitude at the saturation concentration, (stresssc)."""
    expected = tension * 8 * np.pi * radius * speed
    terms = (IsotropicTension(tension), Incompressibility(tension), FixedArea(tension), ActiveTension(2 * tension, 1.4))
    for term in terms:
        assert_allclose(total(term.power(growing(radius, speed, 1.4))), expected, rtol=1e-12, atol=1e-12)
    assert_allclose(total(IsotropicTension(tension).density(sphere(radius)) * area_element(sphere(radius))),
                    tension * 4 * np.pi * radius**2, rtol=1e-12, atol=1e-12)  # fmt: skip
    assert abs(total(IsotropicTension(tension).power(flowing(radius, speed)))) < 1e-10


@examples
@given(radius=positive, pressure=signed, tension=signed, curvature=signed)
def test_pressure_that_balances_a_sphere(radius: float, pressure: float, tension: float, curvature: float):
    """-p dV/dt, hence p = 2 gamma/R + kappa C0 (C0 R - 2)/R^2 makes the power of any growth vanish (exact result 1)."""
    site = growing(radius, 1.0)
    assert_allclose(total(Pressure(pressure).power(site)), -pressure * 4 * np.pi * radius**2, rtol=1e-12, atol=1e-12)
    balance = 2 * tension / radius + 1.3 * curvature * (curvature * radius - 2) / radius**2
    terms = (HelfrichBending(1.3, Uniform(curvature)), IsotropicTension(tension), Pressure(balance))
    assert abs(total(density(terms, site))) < 1e-10


@examples
@given(radius=positive, viscosity=positive, speed=signed)
def test_dissipation_on_a_sphere(radius: float, viscosity: float, speed: float):
    """Half the dissipation of growth, of a flow from pole to pole (div v = 2 V cos(theta)/R, no shear), of a twist."""
    shear, bulk, slip = ShearViscosity(viscosity), BulkViscosity(viscosity), TangentialFriction(viscosity, 0.0)
    drag = NormalFriction(viscosity)
    unit = np.pi * viscosity * speed**2
    expected: list[tuple[Callable[[float, float], Site], AbstractTerm, float]] = [
        (growing, bulk, 8.0), (growing, shear, 0.0), (growing, slip, 0.0),
        (flowing, bulk, 8 / 3), (flowing, shear, 0.0), (flowing, slip, 4 / 3 * radius**2),
        (growing, drag, 2.0 * radius**2), (flowing, drag, 0.0), (twisting, drag, 0.0),
        (twisting, bulk, 0.0), (twisting, shear, 16 / 15), (twisting, slip, 4 / 15 * radius**2),
    ]  # fmt: skip
    for motion, term, factor in expected:
        assert_allclose(total(term.power(motion(radius, speed))), factor * unit, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("speed", [-0.6, 1.0])
def test_force_on_a_moving_sphere(speed: float):
    """-F V with F the integral of the force density: the area for a uniform one, patch_integral for a patch."""
    rates = AT_REST._replace(z=speed + ZERO, meridional_velocity=-speed * np.sin(ANGLES))
    site = Site(sphere(1.2), rates, AT_REST, ZERO)
    patch = SmoothPatch(0.8, 0.5, 6.0)
    assert_allclose(total(AxialForce(Uniform(0.3)).power(site)), -0.3 * 4 * np.pi * 1.2**2 * speed, rtol=1e-12)
    force = 2 * np.pi * 0.8 * float(patch_integral(patch.patch_area, patch.sharpness))
    assert_allclose(total(AxialForce(patch).power(site)), -force * speed, rtol=1e-7)  # the nodes resolve tanh so far


def test_patch():
    """Half its value at the edge, the whole of it far inside; patch_integral also where the exponential overflows."""
    assert_allclose(PATCH(jnp.asarray([0.6, -20.0, 20.0])), [0.85, 1.7, 0.0], atol=1e-15)
    area = 8.0 * NODES
    assert_allclose(float(patch_integral(0.6, 2.0)), 8.0 * np.dot(WEIGHTS, PATCH(area)) / 1.7, rtol=1e-12)
    assert_allclose(float(patch_integral(3.0, 1e4)), 3.0, rtol=1e-12)


def test_edges_and_contrasts_of_a_coat():
    """On a sphere, where r^2 = 2 a - a^2/R^2: 2 pi int r |tension'| da, and the bending energy times the coat's area."""
    radius, coat = 1.2, SmoothPatch(0.8, 0.5, 6.0)
    g = sphere(radius)
    a, weights = np.polynomial.legendre.leggauss(400)
    a, weights = radius**2 * (a + 1.0), radius**2 * weights
    edge = 0.5 * 0.8 * 6.0 / np.cosh(6.0 * (a - 0.5)) ** 2
    expected = 2 * np.pi * weights @ (np.sqrt(2 * a - a**2 / radius**2) * edge)
    assert_allclose(total(LineTension(coat).density(g) * area_element(g)), expected, rtol=1e-6)
    sharp = 2 * np.pi * 0.8 * np.sqrt(2 * 0.5 - 0.25 / radius**2)
    assert_allclose(expected, sharp, rtol=0.02)
    contrast = BendingContrast(coat, Uniform(0.4)).density(g) * area_element(g)
    size = 2 * np.pi * 0.8 * float(patch_integral(0.5, 6.0))
    assert_allclose(total(contrast), 0.5 * (2 / radius - 0.4) ** 2 * size, rtol=1e-6)


def test_friction_lets_a_surface_turn_with_its_surroundings():
    site = random_site(3)
    rates = AT_REST._replace(azimuthal_velocity=0.9 * site.geometry.r)
    assert_allclose(TangentialFriction(2.0, 0.9).power(site._replace(rates=rates)), 0.0, atol=1e-14)


# Derivatives.


@pytest.mark.parametrize("name", ENERGIES)
def test_energy_power_is_the_derivative_of_the_energy(name: str):
    """What is left of f r h along a motion after its value and energy_power is of second order: ratio 4."""
    energy, site = ENERGIES[name], random_site(1)
    g, w = site.geometry, site.rates
    direction = Geometry(w.r, w.psi, site.gradients.psi, w.h, -coordinate_flow(g, w) * g.r)

    def remainder(t: float) -> float:
        moved = Geometry(*(a + t * b for a, b in zip(g, direction, strict=True)))
        value, start = (energy.density(x) * area_element(x) for x in (moved, g))
        return float(np.linalg.norm(value - start - t * energy_power(energy, site)))

    assert remainder(2e-4) / remainder(1e-4) == pytest.approx(4.0, abs=0.05)


def test_power_of_tension_is_that_of_its_energy_on_material_points():
    site = random_site(2)
    g, w = site.geometry, site.rates
    rates = lagrangian_rates(g, w.z, site.gradients.z, w.meridional_velocity, site.gradients.meridional_velocity, w.z)
    moved, tension = site._replace(rates=rates), IsotropicTension(0.9)
    assert_allclose(tension.power(moved), energy_power(tension, moved), rtol=1e-12, atol=1e-12)


def test_power_of_pressure_is_the_derivative_of_the_volume():
    """On spheroids r = a sin(theta), z = b cos(theta), V = 4 pi a^2 b/3, which change in a and b."""
    a, b, a_t, b_t = 0.8, 1.5, 0.7, -0.4
    dr, dz = np.pi * a * np.cos(ANGLES), -np.pi * b * np.sin(ANGLES)
    g = Geometry(a * np.sin(ANGLES), np.arctan2(-dz, dr), ZERO, np.hypot(dr, dz), ZERO)
    power = total(Pressure(-1.0).power(
        Site(g, AT_REST._replace(r=a_t * np.sin(ANGLES), z=b_t * np.cos(ANGLES)), AT_REST, ZERO)
    ))  # fmt: skip

    def remainder(t: float) -> float:
        return 4 * np.pi / 3 * ((a + t * a_t) ** 2 * (b + t * b_t) - a**2 * b) - t * power

    assert remainder(1e-3) / remainder(5e-4) == pytest.approx(4.0, abs=0.05)


@pytest.mark.parametrize(("name", "degree"), [*((n, 1) for n in LINEAR), *((n, 2) for n in DISSIPATIVE)])
def test_powers_are_linear_or_quadratic_in_the_motion(name: str, degree: int):
    """Euler's identity: the derivative along the motion itself is degree times the power; so is that of scaling it."""
    term, site = {**LINEAR, **DISSIPATIVE}[name], random_site(4)
    motion = (site.rates, site.gradients)

    def power(rates: Rates, gradients: Rates) -> Traced:
        return term.power(site._replace(rates=rates, gradients=gradients))

    value, slope = jax.jvp(power, motion, motion)
    assert_allclose(slope, degree * value, rtol=1e-10, atol=1e-10)
    assert_allclose(power(*jax.tree.map(lambda x: -3 * x, motion)), (-3) ** degree * value, rtol=1e-10, atol=1e-10)


# Signs and symmetries.


@pytest.mark.parametrize("name", DISSIPATIVE)
def test_dissipation_is_never_negative(name: str):
    for seed in range(10):
        assert np.all(np.asarray(DISSIPATIVE[name].power(random_site(seed))) >= 0)


@examples
@given(seed=st.integers(0, 10**6), speed=signed, rotation=signed)
def test_rigid_motion_neither_strains_nor_costs(seed: int, speed: float, rotation: float):
    """Translation along the axis, rotation about it: S = 0, no viscous power, no change of energy, v . e_z uniform."""
    g = random_shape(np.random.default_rng(seed))
    sin, cos = np.sin(g.psi), np.cos(g.psi)
    rates = AT_REST._replace(z=speed + ZERO, meridional_velocity=-speed * sin, azimuthal_velocity=rotation * g.r)
    gradients = AT_REST._replace(meridional_velocity=-speed * cos * g.dpsi, azimuthal_velocity=rotation * g.h * cos)
    site = Site(g, rates, gradients, 1.0 + ZERO)
    for component in strain_rate(g, rates, gradients):
        assert_allclose(component, 0.0, atol=1e-12)
    for name in (*ENERGIES, *VISCOUS, "activity", "incompressibility"):
        assert_allclose({**LINEAR, **VISCOUS}[name].power(site), 0.0, atol=1e-10, err_msg=name)
    assert_allclose(axial_velocity(g, rates), speed, atol=1e-12)


def test_sliding_the_mesh_along_a_resting_surface_dissipates_nothing():
    g, slide = random_shape(np.random.default_rng(5)), 0.7
    site = Site(g, AT_REST._replace(r=slide * np.cos(g.psi), z=-slide * np.sin(g.psi)), AT_REST, ZERO)
    for name, term in DISSIPATIVE.items():
        assert_allclose(term.power(site), 0.0, atol=1e-14, err_msg=name)


def test_every_power_is_booked_once():
    site, terms = random_site(6), (*LINEAR.values(), *DISSIPATIVE.values())
    booked = sum(booked_power(terms, ledger, site) for ledger in Ledger)
    assert_allclose(booked, density(terms, site), rtol=1e-12, atol=1e-12)


# The species.


def test_diffusion_on_a_sphere():
    """c = cos(theta) decays at 2 D/R^2: N' = 2 D/R^2 c r h without motion."""
    radius, law = 1.3, Species(0.4, 2.0, Ring(1.0, 0.0, 0.2))

    def flux(u: Traced) -> Traced:
        x = jnp.pi * u
        g = Geometry(radius * jnp.sin(x), x, jnp.pi, jnp.pi * radius, 0.0)
        return law.flux(Site(g, Rates(*[0.0] * 6), Rates(*[0.0] * 6), jnp.cos(x)), -jnp.pi * jnp.sin(x))

    found = jax.vmap(jax.grad(flux))(jnp.asarray(NODES))
    assert_allclose(found, 2 * 0.4 / radius**2 * np.cos(ANGLES) * area_element(sphere(radius)), atol=1e-13)


def test_amount_and_source_of_a_species():
    """Amount 4 pi R^2 c, carried along at c r h q; no source at the reference, k times what is missing elsewhere."""
    ring = Ring(1.5, 2.0, 0.2)
    assert_allclose(ring(np.array([0.5, 0.3, 0.7])), 1.5 * (1 + 2 * np.exp([0.0, -1.0, -1.0])), rtol=1e-14)
    law, site = Species(0.0, 2.0, ring), growing(1.1, 0.5, 0.7)
    assert_allclose(total(law.amount(site)), 4 * np.pi * 1.1**2 * 0.7, rtol=1e-12)
    assert_allclose(law.source(site._replace(concentration=ring(NODES)), NODES), 0.0, atol=1e-14)
    missing: Array = (ring(NODES) - 0.7) * area_element(site.geometry)
    assert_allclose(law.source(site, NODES), 2.0 * missing, rtol=1e-13)
    moved = random_site(8)
    carried = moved.concentration * moved.geometry.r * coordinate_flow(moved.geometry, moved.rates)
    assert_allclose(law.flux(moved, ZERO + 1.0), carried, rtol=1e-13)
