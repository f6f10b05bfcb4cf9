"""Linear laws given as a matrix: random ones that the second law forbids are refused, the others run and keep the energy law."""

import numpy as np
import pytest
from tests.physics.test_terms import random_site

import shapespace as ss
from shapespace.base.outcome import Outcome
from shapespace.modelling import Parameter, define_model, define_scenario, linear_laws
from shapespace.physics.activity import ActiveTension
from shapespace.physics.viscosity import BulkViscosity
from shapespace.study.engine import Engine

pytestmark = pytest.mark.usefixtures("own_models")

UNITS = {
    "e11": "E T/L^2", "e12": "E T/L^3", "e22": "E T/L^4",
    "x1": "1/L^2", "x2": "1/L^3", "mobility": "1/(E L^2 T)", "potential": "E",
}  # fmt: skip


@linear_laws(tension="divergence", push="normal_velocity", rate="potential")
def gel(concentration, e11, e12, e22, x1, x2, mobility, reference_concentration):
    """A gel that is dragged along the normal, and that a fuel contracts and pushes outwards where the species is."""
    share = concentration / reference_concentration
    return [[e11, e12, x1 * share], [e12, e22, x2 * share], [-x1 * share, -x2 * share, mobility]]


def random_values(seed: int, is_allowed: bool) -> dict[str, float]:
    """The couplings of even and odd forces are any; the eigenvalues of the rest are positive, or one is negative."""
    rng = np.random.default_rng(seed)
    small, large = rng.uniform(0.1, 0.5), rng.uniform(0.5, 2.0)
    turn = np.linalg.qr(rng.normal(size=(2, 2)))[0]
    e = turn @ np.diag([small if is_allowed else -small, large]) @ turn.T
    x1, x2 = rng.normal(size=2)
    values = {"e11": e[0, 0], "e12": e[0, 1], "e22": e[1, 1], "x1": x1, "x2": x2}
    return values | {"mobility": rng.uniform(0.1, 2.0), "potential": rng.normal()}


def define(name: str, values: dict[str, float]) -> None:
    parameters = {key: Parameter(key, key, UNITS[key], value) for key, value in values.items()}
    define_model(name, "closed-surface", [gel], parameters)


@pytest.mark.parametrize("seed", range(5))
def test_random_laws_are_refused_or_admitted(seed: int):
    with pytest.raises(ValueError, match=r"gel: the coefficient of .*entropy"):
        define("forbidden", random_values(seed, is_allowed=False))
    define("allowed", random_values(seed, is_allowed=True))


def test_random_laws_that_are_admitted_run():
    """Dissipation is positive, and the energy law closes; other values of the keys are checked where a run begins."""
    define("gel", random_values(0, is_allowed=True))
    define_scenario("gel", "A gel", "gel", "polar-swimmer", seed_amplitude=0.3, until=0.01, elements=20, dt=5e-4)
    for seed in range(4):
        case = ss.scenario("gel", **random_values(seed, is_allowed=True))
        run = ss.run(case)
        assert run.outcome is Outcome.REACHED_END
        assert run.observables["dissipation"] > 0.0
        assert run.observables["chemical_power"] != 0.0
        assert abs(run.observables["energy_residual"]) < 0.05 * run.observables["dissipation"]
        with pytest.raises(ValueError, match=r"gel: the coefficient of .*entropy"):
            Engine.of(ss.scenario("gel", **random_values(seed, is_allowed=False)))


def test_the_matrix_of_the_active_surface_is_its_terms():
    """[[eta_b, xi], [-xi, Lambda]] is bulk viscosity and an active tension, whatever Lambda."""

    @linear_laws(tension="divergence", rate="potential")
    def active(concentration, eta, xi, mobility, saturation):
        hill = concentration**2 / (concentration**2 + saturation**2)
        return [[eta, xi * hill], [-xi * hill, mobility]]

    class Values:
        eta, xi, mobility, saturation, potential = 0.7, 2.0, 1.3, 0.4, 2.5

    site = random_site(3)
    viscous, coupling = (law.term(Values()).power(site) for law in active)
    np.testing.assert_allclose(viscous, BulkViscosity(0.7).power(site), rtol=1e-12)
    np.testing.assert_allclose(coupling, ActiveTension(5.0, 0.4).power(site), rtol=1e-12)


def test_the_rate_of_the_reaction_is_an_observable():
    """Delta mu int r_p dA is the power of the couplings and what the reaction turns into heat, Lambda Delta mu^2 A."""

    @linear_laws(tension="divergence", reaction_rate="potential")
    def fuelled(concentration, e11, x1, mobility, reference_concentration):
        share = concentration / reference_concentration
        return [[e11, x1 * share], [-x1 * share, mobility]]

    values = {"e11": 1.0, "x1": 2.0, "mobility": 0.7, "potential": 3.0}
    parameters = {key: Parameter(key, key, UNITS[key], value) for key, value in values.items()}
    define_model("fuelled", "closed-surface", [fuelled], parameters)
    define_scenario(
        "fuelled", "A gel", "fuelled", "polar-swimmer", peclet=0.0, seed_amplitude=0.3, until=2e-3, elements=20, dt=1e-3
    )
    data = ss.run(ss.scenario("fuelled", bending_rigidity=1.3, sphere_radius=1.2)).dataset.isel(time=-1)
    coupling = float(data.chemical_power)
    heat = 0.7 * 3.0**2 * float(data.area)
    assert abs(coupling) > 0.1
    assert float(data.reaction_rate) * 3.0 == pytest.approx(coupling + heat, rel=1e-6)


def test_laws_that_are_no_laws_are_named():
    with pytest.raises(ValueError, match="none of them is a motion"):
        linear_laws(rate="potential")
    with pytest.raises(ValueError, match=r"slip: coefficients cannot depend on the motion .divergence"):

        @linear_laws(tension="divergence")
        def slip(divergence, eta):
            return [[eta * divergence]]

    @linear_laws(tension="divergence", rate="potential")
    def one_sided(x1, mobility):
        return [[0.0, x1], [x1, mobility]]

    parameters = {key: Parameter(key, key, UNITS[key], 1.0) for key in ("x1", "mobility", "potential")}
    with pytest.raises(ValueError, match=r"one_sided: .*opposite signatures, reactive and antisymmetric.*must be -1"):
        define_model("one-sided", "closed-surface", [one_sided], parameters)
    with pytest.raises(ValueError, match="gel: is given twice"):
        define_model("twice", "closed-surface", [gel, gel], {})
