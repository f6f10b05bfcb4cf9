"""Laws that users write: what is refused and how it is said, and laws that meet closed forms and shipped terms."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.physics.test_terms import growing, random_site, total

from shapespace.base.units import Dimension, read_dimension
from shapespace.geometry.curve import Geometry, area_element
from shapespace.physics.admission import check_law
from shapespace.physics.bending import HelfrichBending
from shapespace.physics.friction import NormalFriction
from shapespace.physics.laws import Law, LawEnergy, dissipation, energy, power
from shapespace.physics.patch import Uniform
from shapespace.physics.quantities import LOCAL_QUANTITIES, local_values
from shapespace.physics.term import carried_rate, energy_power
from shapespace.physics.viscosity import BulkViscosity, ShearViscosity

VALUES = {"kappa": 1.3, "c_0": 0.8, "eta": 0.7, "modulus": 1.1, "c0": 1.5, "gamma": 0.9}
UNITS = {"kappa": "E", "c_0": "1/L", "eta": "E T/L^2", "modulus": "E/L^2", "c0": "C", "gamma": "E T/L^4"}
DIMENSIONS = {name: read_dimension(unit) for name, unit in UNITS.items()}


class _Values:
    def __init__(self) -> None:
        self.__dict__ |= VALUES


def admitted(law: Law) -> Law:
    check_law(law, VALUES, DIMENSIONS)
    return law


@energy
def bending(total_curvature, kappa, c_0):
    return 0.5 * kappa * (total_curvature - c_0) ** 2


@energy
def area_elasticity(concentration, modulus, c0):
    return 0.5 * modulus * (c0 / concentration - 1.0) ** 2 * concentration / c0


@dissipation("shear")
def shear(meridional_strain_rate, azimuthal_strain_rate, shear_strain_rate, eta):
    return eta * ((meridional_strain_rate - azimuthal_strain_rate) ** 2 + 4.0 * shear_strain_rate**2)


@dissipation("bulk")
def bulk(divergence, eta):
    return eta * divergence**2


@dissipation("friction")
def drag(normal_velocity, gamma):
    return gamma * normal_velocity**2


SHIPPED = [
    (bending, HelfrichBending(1.3, Uniform(0.8))),
    (shear, ShearViscosity(0.7)),
    (bulk, BulkViscosity(0.7)),
    (drag, NormalFriction(0.9)),
]


@pytest.mark.parametrize(("law", "term"), SHIPPED)
def test_a_law_of_one_line_is_the_shipped_term(law: Law, term: HelfrichBending):
    site = random_site(3)
    made = admitted(law).term(_Values())
    assert made.ledger is term.ledger
    assert_allclose(made.power(site), term.power(site), rtol=1e-12, atol=1e-12)


def test_area_elasticity_is_a_tension():
    """f - c f' = K (c0/c - 1): the power of a sphere that grows, with its species diluted, is that tension times dA/dt."""
    site = growing(1.2, 0.4, 0.7)
    expected = 1.1 * (1.5 / 0.7 - 1.0) * 8.0 * np.pi * 1.2 * 0.4
    assert_allclose(total(admitted(area_elasticity).term(_Values()).power(site)), expected, rtol=1e-12)


def test_power_of_an_energy_of_the_concentration_is_its_derivative():
    """What is left of f r h along a motion that carries the species is of second order: ratio 4."""
    term, site = (
        area_elasticity.term(_Values()),
        random_site(5)._replace(concentration_slope=np.linspace(-1.0, 1.0, 60)),
    )
    assert isinstance(term, LawEnergy)
    g, w = site.geometry, site.rates
    along = Geometry(w.r, w.psi, site.gradients.psi, w.h, 0.0 * g.r)
    rate = carried_rate(site)

    def remainder(t: float) -> float:
        moved = Geometry(*(a + t * b for a, b in zip(g, along, strict=True)))
        after = term.density(moved, site.concentration + t * rate) * area_element(moved)
        before = term.density(g, site.concentration) * area_element(g)
        return float(np.linalg.norm(after - before - t * energy_power(term, site)))

    assert remainder(1e-4) / remainder(5e-5) == pytest.approx(4.0, abs=0.05)


def test_carried_amount_is_conserved():
    """d(c r h)/dt + (c r h q^u)' = 0 with c' of the carried species: on points that move with the matter nothing changes."""
    site = growing(1.3, 0.6, 0.7)
    change = carried_rate(site) * area_element(site.geometry)
    dilution = site.concentration * (site.rates.r * site.geometry.h + site.geometry.r * site.rates.h)
    assert_allclose(change + dilution, 0.0, atol=1e-13)


@pytest.mark.parametrize("name", [name for name, entry in LOCAL_QUANTITIES.items() if entry.at_pole])
def test_limits_at_a_pole_are_approached(name: str):
    """On a spheroid-like curve with a flow that is smooth at the pole, to the order of the distance."""
    misses = []
    for u in (2e-3, 1e-3):
        x = np.array([np.pi * u])
        # psi = x + x^3/5 gives r = int h cos(psi); near the pole to the order needed: r = h u (1 - x^2/6 - ...).
        h, psi, dpsi = 2.0, x + 0.2 * x**3, np.pi * (1.0 + 0.6 * x**2)
        fine, weights = np.polynomial.legendre.leggauss(20)
        s = 0.5 * (fine + 1.0) * u
        r = np.array([0.5 * u * weights @ (h * np.cos(np.pi * s + 0.2 * (np.pi * s) ** 3))])
        site = random_site(1)
        rates = type(site.rates)(0.0 * x, 0.7 + 0.0 * x, 0.0 * x, 0.0 * x, 0.4 * np.sin(x), 0.3 * r)
        slopes = type(site.rates)(*[0.0 * x] * 4, 0.4 * np.pi * np.cos(x), 0.3 * h * np.cos(psi))
        at = type(site)(Geometry(r, psi, dpsi, h + 0.0 * x, 0.5 * r**2), rates, slopes, 1.0 + 0.0 * x, 0.8 * np.sin(x))
        near, limit = (local_values((name,), at, at_pole=pole)[name] for pole in (False, True))
        misses.append(float(np.abs(near - limit)[0]))
    assert misses[1] < 2e-2
    assert misses[1] < 1e-12 or misses[0] / misses[1] > 1.9


def mixed(meridional_strain_rate, azimuthal_strain_rate, eta):
    return eta * meridional_strain_rate * azimuthal_strain_rate


REFUSED = {
    "typo": (energy(lambda total_curvatur, kappa: kappa * total_curvatur**2), "nearest is total_curvature"),
    "motion": (energy(lambda divergence, kappa: kappa * divergence), "an energy cannot depend on the motion"),
    "gradient": (energy(lambda concentration_gradient, kappa: kappa), "concentration_gradient is not supported"),
    "unit": (energy(lambda total_curvature, kappa: kappa * total_curvature), "its unit is not E/L\\^2; .* of kappa"),
    "pole": (energy(lambda radius, kappa: kappa / radius**2), "is not finite at the pole u = 0, where radius = 0"),
    "far pole": (
        energy(lambda tangent_angle, modulus: modulus / (1.0 + jnp.cos(tangent_angle))),
        "is not finite at the pole u = 1, where radius = 0, tangent_angle = 3.14",
    ),
    "numpy": (
        energy(lambda tangent_angle, modulus: modulus * np.cos(tangent_angle)),
        "cannot be differentiated .* write it with jax.numpy",
    ),
    "branching": (
        energy(lambda tangent_angle, modulus: modulus if float(tangent_angle[0]) > 1.0 else 2.0 * modulus),
        "cannot be differentiated",
    ),
    "everywhere": (energy(lambda radius, modulus: modulus * jnp.sqrt(-radius / radius)), "is not finite inside"),
    "shape": (energy(lambda radius, modulus: modulus * jnp.ones((3, 3))), "one number per point"),
    "linear": (dissipation("bulk")(lambda divergence, modulus: modulus * divergence), "must be quadratic"),
    "second law": (dissipation("bulk")(lambda divergence, eta: -eta * divergence**2), "breaks the second law: .*eta = 0.7"),
    "mixed": (dissipation("shear")(mixed), "breaks the second law"),
    "quadratic": (power("external")(lambda divergence, eta: eta * divergence**2), "must be linear"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused(case: str):
    law, message = REFUSED[case]
    with pytest.raises(ValueError, match=message):
        check_law(law, VALUES, DIMENSIONS)


ROUGH = {
    "kink": energy(lambda total_curvature, c_0, modulus: modulus * jnp.abs(total_curvature / c_0 - 1.0)),
    "step": energy(lambda concentration, c0, modulus: modulus * jnp.where(concentration > c0, 1.0, 0.0)),
    "corner": energy(lambda concentration, c0, modulus: modulus * jnp.maximum(concentration / c0, 1.0)),
}


@pytest.mark.parametrize("case", ROUGH)
def test_laws_that_are_not_smooth_are_admitted_with_a_warning(case: str):
    """It names the place."""
    place = "concentration = 1.5\\." if case != "kink" else "total_curvature = 0.8\\."
    with pytest.warns(UserWarning, match=rf"<lambda>: is not smooth: .* near {place} .*round it off"):
        admitted(ROUGH[case])


def test_steep_laws_are_smooth(recwarn: pytest.WarningsRecorder):
    """A coat's edge, and a law that is flat over most of its range."""
    admitted(energy(lambda material_area, c_0, modulus: modulus * jnp.tanh(250.0 * (material_area * c_0**2 - 0.3))))
    admitted(energy(lambda concentration, c0, modulus: modulus * jnp.exp(-((concentration / c0 - 1.0) ** 2) * 1e4)))
    assert not recwarn.list


def test_unknown_channels_and_sources_are_named():
    with pytest.raises(ValueError, match="'heat': is none of the dissipation; choose one of shear, bulk"):
        dissipation("heat")
    with pytest.raises(ValueError, match="'magic': supplies no power; choose one of external, chemical"):
        power("magic")


def test_units_are_read():
    assert read_dimension("E T/L^2") == Dimension(-2, 1, 1)
    assert read_dimension("E/(L^2 T)") == Dimension(-2, 1, -1)
    assert read_dimension("1") == Dimension()
    with pytest.raises(ValueError, match="unit = 'm/s'"):
        read_dimension("m/s")
