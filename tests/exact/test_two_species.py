"""Two species that react with each other on a sphere that does not move: growth rates and Turing's threshold in closed form."""

from typing import Any

import numpy as np
import pytest

import shapespace as ss
from shapespace.modelling import Free, Parameter, ReactingSpecies, Ring, define_model, define_scenario

pytestmark = pytest.mark.usefixtures("own_models")

KINETICS = np.array([[4.0, -5.0], [6.0, -6.5]])
"""An activator and an inhibitor near their uniform state, where both concentrations are one."""
TURNOVER, FASTER = 0.5, 20.0


def species(p: Any) -> tuple[ReactingSpecies, ReactingSpecies]:
    rest = Ring(p.reference_concentration, p.ring_amplitude, p.ring_width)
    c0 = p.reference_concentration

    def activator(c: Any, other: Any) -> Any:
        return p.kinetic_rate * (KINETICS[0, 0] * (c - c0) + KINETICS[0, 1] * (other - c0) - (c - c0) ** 3 / c0**2)

    def inhibitor(c: Any, other: Any) -> Any:
        return p.kinetic_rate * (KINETICS[1, 0] * (other - c0) + KINETICS[1, 1] * (c - c0))

    return (
        ReactingSpecies(p.diffusivity, p.turnover_rate, rest, activator),
        ReactingSpecies(FASTER * p.diffusivity, p.turnover_rate, rest, inhibitor),
    )


def define() -> ss.Scenario:
    define_model(
        "turing",
        "closed-surface",
        [],
        {"kinetic_rate": Parameter("k_r", "rate of the reactions", "1/T", 1.0)},
        species=species,
        species_count=2,
        ends={"second_species": (Free(), Free())},
    )
    define_scenario("turing", "A pattern", "turing", "polar-swimmer", peclet=0.0, turnover_rate=TURNOVER, elements=20)
    return ss.scenario("turing", diffusivity=2.0)


def rates_of(l: int, diffusivity: float) -> np.ndarray:
    q = l * (l + 1) * diffusivity
    return np.linalg.eigvals(KINETICS - TURNOVER * np.eye(2) - q * np.diag([1.0, FASTER]))


def threshold(l: int) -> float:
    """The larger diffusivity at which a rate of l vanishes: det = 0 with x = l(l+1) D."""
    (a, b), (c, d) = KINETICS - TURNOVER * np.eye(2)
    return float(np.roots([FASTER, -(a * FASTER + d), a * d - b * c]).max()) / (l * (l + 1))


def test_growth_rates_and_their_sign_at_the_threshold():
    case = define()
    expected = np.concatenate([rates_of(l, 2.0) for l in range(4)])
    found = ss.steady(case, state="trivial").rates(4).values
    leading = sorted(expected, key=lambda rate: -rate.real)[:4]
    np.testing.assert_allclose([real for real, _ in found], [rate.real for rate in leading], rtol=1e-6)
    np.testing.assert_allclose(np.abs([imag for _, imag in found]), np.abs(np.imag(leading)), rtol=1e-6, atol=1e-6)
    rates = ss.steady(case.with_overrides({"diffusivity": threshold(1)}), state="trivial").rates(2).values
    assert rates[0] == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.slow
def test_the_threshold_is_located_along_a_branch():
    branch = ss.branch(define(), "diffusivity", 0.4, start=2.0, state="trivial", stability=False)
    places = [point.parameter for point in branch.special_points if point.kind in ("pitchfork", "transcritical")]
    np.testing.assert_allclose(places, [threshold(1), threshold(2)], rtol=1e-6)


def test_a_pattern_grows_where_theory_says_so_and_is_stored():
    """Near the threshold of l = 1 at its rate; amounts change by what is made, and the second species is stored."""
    case = define().with_overrides({"diffusivity": 1.2, "seed_amplitude": 1e-4, "until": 1.0, "time_tolerance": 1e-6})
    run = ss.run(case)
    data = run.dataset
    polar = data.concentration.isel(point=0) - data.concentration.isel(point=-1)
    late = data.time > 0.5
    slope = np.polyfit(data.time[late], np.log(np.abs(polar[late])), 1)[0]
    assert slope == pytest.approx(rates_of(1, 1.2).real.max(), rel=1e-3)
    assert float(np.abs(data.second_concentration - 1.0).max()) > 1e-5
