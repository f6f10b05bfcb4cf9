"""Spectra of the sphere against its growth rates in closed form, l = 0..6: passive, active, with and without friction.

The concentration's l = 0 decays with the turnover rate, l = 1 is the polar mode, each l >= 2 has two rates (closed_forms.py).
"""

from collections.abc import Mapping

import numpy as np
import pytest
from tests.surfaces import resting

from shapespace.analysis.stability import Spectral, solve_spectrum
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.newton import Newton, solve_root
from shapespace.study.engine import Engine
from shapespace.study.scenario import scenario
from shapespace.study.verification.closed_forms import sphere_rates

# Fast diffusion puts the concentration's decay among that of the shapes.
CASES = {
    "passive": {"peclet": 0.0, "tension": 0.0, "friction": 0.0, "turnover_rate": 3.3, "diffusivity": 20.0},
    "passive, with friction": {
        "peclet": 0.0,
        "tension": 9.0,
        "friction": 0.09,
        "turnover_rate": 3.3,
        "diffusivity": 20.0,
    },
    "active, oscillating": {"peclet": 1.5, "tension": 9.0, "friction": 0.0, "diffusivity": 20.0},
    "active, with friction": {"peclet": 15.0, "tension": 9.0, "friction": 2.25, "diffusivity": 20.0},
    "unstable": {"peclet": 100.0, "tension": 9.0, "friction": 1.0},
    "oscillating": {"peclet": 40.0, "tension": -20.0, "friction": 20.0},
    "oscillating, without friction": {"peclet": 40.0, "tension": -22.0, "friction": 0.0},
}
COUNTS = {"unstable": 8, "oscillating": 10, "oscillating, without friction": 8}


def start(**constants: float) -> tuple[Engine, Array]:
    """The resting sphere in closed form: where J is singular no solve can follow."""
    engine = Engine.of(scenario("polar-swimmer", elements=60, seed_amplitude=0.0, **constants))
    return engine, engine.problem.pack(engine.initial_state())


def sphere(**constants: float) -> tuple[Engine, Array]:
    """The resting sphere after one solve at rest."""
    engine, x = start(**constants)
    root = solve_root(engine.problem, x, engine.p, resting(engine, x), Newton())
    assert root.outcome is Outcome.CONVERGED
    return engine, root.x


def exact_rates(v: Mapping[str, float]) -> tuple[Array, Array]:
    """Rates (m,), largest first, and their l (m,)."""
    degrees, rates = zip(*sphere_rates(v, 39), strict=True)
    return np.array(rates), np.array(degrees)


@pytest.mark.parametrize("case", CASES)
def test_rates_and_parities(case: str):
    """To 1e-8 of themselves (of one where they are smaller), as many unstable as there are, even and odd l told apart."""
    engine, x = sphere(**CASES[case])
    found = solve_spectrum(engine.problem, x, engine.p, Spectral(count=COUNTS.get(case, 12)))
    every, degrees = exact_rates(engine.values)
    exact = every[: len(found.rates)]
    assert found.converged
    misses = np.abs(found.rates - exact) / np.maximum(np.abs(exact), 1.0)
    assert misses.max() < 1e-8, f"\nfound {found.rates}\nexact {exact}\nmisses {misses}"
    assert found.n_unstable == np.count_nonzero(every.real > 0.0)
    assert found.neutral == {}
    assert ("oscillating" in case) == bool((exact.imag != 0.0).any())
    for parity, l in zip(found.parities, degrees, strict=False):
        assert parity == ("antisymmetric" if l % 2 else "symmetric"), f"{found.parities}, l = {degrees[:12]}"


def amount_gradient(engine: Engine, x: Array) -> Array:
    """d/dx of the integral of c r h over u."""
    problem, fields = engine.problem, engine.system.fields
    weights = np.diff(problem.mesh)[:, None] * gauss_rule(problem.degree).weights

    def amount(x: Array) -> complex:
        values = problem.unpack(x).stage_values()
        return np.sum(weights * values[..., fields.index("c")] * values[..., fields.index("r")]) * x[-3]

    step = 1e-30
    return np.array([amount(x + 1j * step * unit).imag / step for unit in np.eye(len(x))])


def test_the_conserved_amount_is_neutral_and_named():
    """Without turnover any amount of regulator is at rest: one zero rate, neither stable nor unstable.

    Without friction too, translation is no mode, as the frame is fixed.
    """
    engine, x = start(peclet=3.0, turnover_rate=0.0, friction=0.0)
    found = solve_spectrum(engine.problem, x, engine.p, conserved={"amount of regulator": amount_gradient(engine, x)})
    exact, _ = exact_rates(engine.values)
    assert found.converged
    np.testing.assert_allclose(found.rates, exact[: len(found.rates)], rtol=1e-8, atol=1e-8)
    assert found.neutral == {int(np.argmin(np.abs(found.rates))): "amount of regulator"}
    assert found.n_unstable == np.count_nonzero(exact.real > 1e-6)


def test_the_polar_mode_is_neutral_at_onset():
    """At Pe* = 22 the rate of l = 1 vanishes, and changes sign there."""
    unstable = []
    for peclet in (22.0 - 1e-3, 22.0, 22.0 + 1e-3):
        engine, x = start(peclet=peclet, tension=9.0)
        found = solve_spectrum(engine.problem, x, engine.p)
        unstable.append(found.n_unstable)
        assert len(found.neutral) == int(peclet == 22.0), found.rates
        assert found.parities[0] == "antisymmetric"
        assert abs(found.rates[0] - 0.5 * (peclet - 22.0)) < 1e-8
    assert unstable == [0, 0, 1]
