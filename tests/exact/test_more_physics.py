"""Terms beyond the paper's, all in one model that switches them on by their keys, against closed forms on the sphere.

A mode l of a sphere has the stiffness s = (l-1)(l+2) [T/R^2 + kappa (l(l+1) - 2 C0 R + (C0 R)^2/2)/R^4] (Milner and Safran, Phys.
Rev. A 36, 4371 (1987)), the mobility M = (R^2/4)(1/eta_b + g) of `sphere_rates`, and changes 2H by (l-1)(l+2)/R^2.
"""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.optimize import brentq
from tests.exact.test_balances import check_order, energy_miss
from tests.surfaces import make_engine, march, stage_fields

import shapespace as ss
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.modelling import Parameter, define_model, define_scenario
from shapespace.physics.activity import ActiveMoment
from shapespace.physics.bending import InducedBending
from shapespace.physics.chirality import ChiralTorque
from shapespace.physics.species import CurvatureSpecies, Ring
from shapespace.physics.storage import AreaElasticity, OsmoticPressure
from shapespace.physics.viscosity import BendingViscosity

KEYS = {
    "bending_viscosity": Parameter("eta_c", "viscosity against bending", "E T", 1e-9, least=0.0),
    "active_moment": Parameter("m", "active bending moment", "E/L", 0.0),
    "torque": Parameter("tau", "active torque about the normal", "E/L^2", 0.0),
    "coupling": Parameter("chi", "spontaneous curvature per concentration", "1/(L C)", 0.0),
    "thermal_energy": Parameter("E_T", "energy of mixing", "E/(L^2 C)", 1.0),
}
STORES = {
    "volume_modulus": Parameter("K_V", "osmotic modulus", "E/L^3", 30.0),
    "area_modulus": Parameter("K_A", "area modulus", "E/L^2", 20.0),
    "rest_area": Parameter("A_0", "area without strain", "L^2", 12.0),
}


def terms(p: Any) -> tuple[Any, ...]:
    c0 = p.reference_concentration
    return (
        InducedBending(p.bending_rigidity, p.spontaneous_curvature, p.coupling, p.thermal_energy, c0),
        BendingViscosity(p.bending_viscosity),
        ActiveMoment(p.active_moment, c0),
        ChiralTorque(p.torque, c0),
    )


def species(p: Any) -> CurvatureSpecies:
    ring = Ring(p.reference_concentration, p.ring_amplitude, p.ring_width)
    return CurvatureSpecies(p.diffusivity, p.turnover_rate, ring, p.coupling, p.thermal_energy)


@pytest.fixture(scope="module", autouse=True)
def rich() -> Iterator[None]:
    """The model with all terms, and one that is held elastically; they go with this module."""
    from shapespace.base.scales import QUANTITIES
    from shapespace.study.keys import MODELS
    from shapespace.study.scenario import TEMPLATES

    kept = [(table, dict(table)) for table in (QUANTITIES, MODELS, TEMPLATES)]
    define_model(
        "rich", "closed-surface", [], KEYS, without=["HelfrichBending"], terms=terms, species=species, turning=True
    )
    define_scenario("rich", "All terms", "rich", "polar-swimmer", peclet=0.0, azimuthal_flow=True, elements=20)
    storages = {
        "p": lambda p: OsmoticPressure(p.volume_modulus, p.enclosed_volume),
        "sigma": lambda p: AreaElasticity(p.area_modulus, p.rest_area),
    }
    define_model("elastic", "closed-surface", [], STORES, fixed_area=True, storages=storages)
    define_scenario("elastic", "Held elastically", "elastic", "polar-swimmer", peclet=0.0, elements=20)
    yield
    for table, before in kept:
        table.clear()
        table.update(before)


def matrix(v: dict[str, Any], l: int) -> Array:
    """d/dt of the amplitudes of shape and concentration: X = -dE/d(amplitude), E their second-order energy."""
    kappa, chi, c0, energy = v["bending_rigidity"], v["coupling"], v["reference_concentration"], v["thermal_energy"]
    modes, curvature = (l - 1) * (l + 2), v["spontaneous_curvature"] + chi * c0
    # The energy less mu c, at the mu of the uniform sphere: what acts as a tension.
    tension = v["tension"] - energy * c0 + kappa * chi * c0 * (2.0 - curvature)
    stiffness = modes * (tension + kappa * (l * (l + 1) - 2.0 * curvature + 0.5 * curvature**2))
    second = np.array([[stiffness, -kappa * chi * modes], [-kappa * chi * modes, kappa * chi**2 + energy / c0]])
    g = l * (l + 1) / ((modes * v["shear_viscosity"]) + v["friction"])
    mobility, eta = 0.25 * (1.0 / v["bulk_viscosity"] + g), v["bulk_viscosity"]
    diffusion = l * (l + 1) * v["diffusivity"] * c0 / energy
    # A change of mu is one of the tension by -c0 times it, which moves the shape and dilutes.
    response = np.array([[mobility, -0.5 * c0 / eta], [-0.5 * c0 / eta, c0**2 / eta + diffusion]])
    drag = np.diag([v["bending_viscosity"] * modes**2, 0.0])
    rates = -np.linalg.solve(np.eye(2) + response @ drag, response @ second)
    # Drag acts on the shape's rate alone, turnover on the concentration.
    return rates - np.linalg.solve(np.eye(2) + response @ drag, np.diag([0.0, v["turnover_rate"]]))


def growth_rates(**keys: float) -> tuple[Array, Array]:
    """Leading rates of the resting sphere, and those expected of l = 2, 3, 4."""
    case = ss.scenario("rich", shear_viscosity=0.8, turnover_rate=30.0, **keys)
    expected = np.concatenate([np.linalg.eigvals(matrix(case.values(), l)).real for l in (2, 3, 4)])
    found = ss.steady(case, state="trivial").rates(6).values
    return np.array([real for real, _ in found]), expected


def check_rates(found: Array, expected: Array, count: int) -> None:
    """Every expected rate that is among the leading ones is there."""
    leading = np.sort(expected)[::-1][:count]
    misses = [float(np.abs(found / rate - 1.0).min()) for rate in leading]
    assert max(misses) < 1e-6, f"found {found}, expected {leading}"


def test_viscosity_against_bending_slows_modes():
    """Of l = 2 and 3; beyond -kappa/eta_c lie all rates of l without end, which no mesh resolves."""
    found, expected = growth_rates(bending_viscosity=0.01, diffusivity=10.0)
    check_rates(found, expected, count=2)
    without = growth_rates(bending_viscosity=1e-9, diffusivity=10.0)[1]
    assert np.sort(expected)[-2] > 1.5 * np.sort(without)[-2], "it hardly slows: nothing is tested"


def test_a_species_that_bends_the_surface_shifts_all_rates():
    check_rates(*growth_rates(coupling=0.9, thermal_energy=2.0), count=3)


def test_both_together_and_with_a_spontaneous_curvature():
    keys = {"coupling": -0.6, "thermal_energy": 1.3, "bending_viscosity": 0.005, "spontaneous_curvature": 0.4}
    check_rates(*growth_rates(**keys), count=2)


def test_curvature_instability():
    """Where s (kappa chi^2 + E_T/c0) = (kappa chi (l-1)(l+2))^2 a sphere yields to l; turnover shifts it."""

    def determinant(chi: float) -> float:
        v = ss.scenario("rich", turnover_rate=0.1, coupling=chi, thermal_energy=2.0).values()
        return float(np.linalg.det(matrix(v, 2)))

    critical = brentq(determinant, 3.0, 6.0)
    case = ss.scenario("rich", turnover_rate=0.1, thermal_energy=2.0)
    rates = [
        np.array(
            [real for real, _ in ss.steady(case.with_overrides({"coupling": chi}), state="trivial").rates(6).values]
        )
        for chi in (critical, critical + 0.1)
    ]
    assert np.abs(rates[0]).min() < 1e-6
    assert (rates[1] > 1e-3).sum() == (rates[0] > 1e-3).sum() + 1


def test_active_moment_changes_the_pressure_of_a_sphere():
    case = ss.scenario("rich", active_moment=1.7, tension=9.0)
    found = ss.steady(case, state="trivial").observables["pressure"]
    assert found == pytest.approx(2.0 * (9.0 - 1.0) + 2.0 * 1.7, rel=1e-9)  # mixing adds -E_T c0 to the tension


@pytest.mark.parametrize(
    ("name", "keys"),
    [("turning", {"seed_amplitude": 0.4}), ("counter-turning", {"initial_ring_amplitude": 1.0, "seed_amplitude": 0.0})],
)
def test_a_torque_turns_a_sphere(name: str, keys: dict[str, float]):
    """v_phi = -sum_l tau_l/(2R) dP_l/d theta/(Gamma + eta_s (l-1)(l+2)/R^2), with tau_l those of the concentration."""
    keys = {"ring_width": 0.4, "thermal_energy": 1e-9, "torque": 1.6, "friction": 0.7, "shear_viscosity": 0.8, **keys}
    engine = make_engine("rich", azimuthal_flow=True, elements=40, **keys)
    moments, outcome = march(engine, 0.05, order=1, fixed_step=0.01)
    assert outcome is Outcome.REACHED_END
    f = stage_fields(engine, moments[-1].x)
    x = np.cos(f["psi"]).ravel()
    modes = legendre.legfit(x, 1.6 * f["c"].ravel(), 40)
    expected = np.zeros_like(x)
    for l in range(1, 41):
        slope = -np.sqrt(1.0 - x**2) * legendre.legval(x, legendre.legder(np.eye(41)[l]))
        expected -= 0.5 * modes[l] * slope / (0.7 + 0.8 * (l - 1) * (l + 2))
    np.testing.assert_allclose(f["v_phi"].ravel(), expected, atol=1e-7)
    halves = [float(v[f["psi"].ravel() < 0.5 * np.pi].sum()) for v in (f["v_phi"].ravel(), f["v_phi"].ravel()[::-1])]
    assert halves[0] * halves[1] > 0.0 if name == "turning" else halves[0] == pytest.approx(-halves[1], rel=1e-9)


ALL = {"bending_viscosity": 0.5, "active_moment": 1.5, "torque": 2.0, "coupling": 0.5}


@pytest.mark.parametrize("on", [*((key,) for key in ALL), tuple(ALL)])
def test_energy_law_closes_with_each_term_alone_and_with_all(on: tuple[str, ...]):
    keys = {"peclet": 60.0, "seed_amplitude": 0.3, "normal_friction": 0.0} | {key: ALL[key] for key in on}
    keys.pop("normal_friction")
    engine = make_engine("rich", azimuthal_flow=True, **keys)
    check_order([energy_miss(engine, 2, steps, 0.02) for steps in (10, 20, 40)], 2, margin=0.35)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_energy_law_closes_with_random_combinations(seed: int):
    """Of these terms and of the paper's, at random strengths."""
    rng = np.random.default_rng(seed)
    paper = {
        "spontaneous_curvature": 0.6,
        "tension": 5.0,
        "friction": 2.0,
        "shear_viscosity": 1.5,
        "thermal_energy": 2.0,
    }
    chosen = [*rng.permutation([*ALL])[: rng.integers(2, 5)], *rng.permutation([*paper])[: rng.integers(2, 6)]]
    keys = {key: (ALL | paper)[key] * rng.uniform(0.3, 1.2) for key in chosen}
    engine = make_engine("rich", azimuthal_flow=True, peclet=60.0 * rng.uniform(), seed_amplitude=0.3, **keys)
    # At one moment alone what is left over may just pass zero.
    misses = [max(energy_miss(engine, 2, steps, until) for until in (0.01, 0.02)) for steps in (10, 20, 40)]
    check_order(misses, 2, margin=0.35)


def test_volume_and_area_that_are_held_elastically():
    """2 (gamma + K_A (A/A0 - 1))/R = K_V (1 - V/V0) gives the radius; the energy law closes on the way there."""
    case = ss.scenario("elastic", tension=3.0)
    v = SimpleNamespace(**case.values())

    def excess(radius: float) -> float:
        tension = 3.0 + v.area_modulus * (4.0 * np.pi * radius**2 / v.rest_area - 1.0)
        return 2.0 * tension / radius - v.volume_modulus * (1.0 - radius**3)

    radius = brentq(excess, 0.3, 1.0)
    found = ss.steady(case, state="trivial").observables
    assert found["volume"] == pytest.approx(4.0 / 3.0 * np.pi * radius**3, rel=1e-8)
    assert found["pressure"] == pytest.approx(v.volume_modulus * (1.0 - radius**3), rel=1e-8)
    engine = make_engine("elastic", tension=3.0)
    check_order([energy_miss(engine, 2, steps, 0.02) for steps in (10, 20, 40)], 2, margin=0.35)
