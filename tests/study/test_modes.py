"""Modes of stationary states: neutral ones and their reasons, parities, stored and drawn."""

from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.base.problem import REST
from shapespace.study.keyed import KeyedProblem
from shapespace.study.modes import CRITICAL, find_modes, neutral_modes, store_modes
from shapespace.study.run import store_frame
from shapespace.study.spectra import AMOUNT, spectrum_at
from shapespace.study.steady import Rates, Steady
from shapespace.view.mode import plot_mode

HELD = {"name": "translation", "index": None}


@pytest.fixture(scope="module")
def sphere() -> Steady:
    return ss.steady(ss.scenario("polar-swimmer", elements=20, peclet=20.0), state="trivial")


def test_translation_costs_nothing_and_is_held_by_the_frame(sphere: Steady):
    """Of all equations only z(0) + z(1) = 0 sees a shift along the axis; without it there would be a zero rate."""
    problem, x = sphere.problem.base, sphere.found.x
    shift = problem.unpack(np.zeros_like(x))
    shift.nodes[:, problem.system.fields.index("z")] = 1.0
    change = problem.derivative(x, sphere.engine.p, problem.pack(shift), np.zeros_like(sphere.engine.p))
    assert sorted(np.abs(change))[-2:] == pytest.approx([0.0, 2.0], abs=1e-12)
    rates = sphere.rates()
    assert neutral_modes(sphere.scenario, rates.neutral) == [HELD]
    assert rates.n_unstable == 0
    assert min(abs(real) for real, _ in rates.values) > 0.5


def test_an_open_membrane_is_held_by_its_rim():
    assert neutral_modes(ss.scenario("membrane-protrusion"), {}) == []


def test_without_turnover_the_amount_of_regulator_is_neutral(sphere: Steady):
    """The resting sphere does not depend on k; its l = 0 rate is -k, which at k = 0 belongs to the conserved amount."""
    problem = KeyedProblem.of(sphere.scenario, ("turnover_rate",))
    x, p = sphere.found.x, np.zeros(1)
    rest = REST
    assert np.abs(problem.residual(x, p, rest)).max() < 1e-10
    spectrum = spectrum_at(problem, x, p, count=6)
    place = int(np.argmin(np.abs(spectrum.rates)))
    # At Pe = 20 and k = 0 the polar mode grows at 20/2 - 2 = 8 (exact result 2): that one counts, the neutral one does not.
    assert spectrum.rates[0].real == pytest.approx(8.0, abs=1e-6)
    assert spectrum.n_unstable == 1
    assert neutral_modes(sphere.scenario, spectrum.neutral) == [HELD, {"name": AMOUNT, "index": place}]


def test_at_the_pitchfork_the_polar_mode_is_critical(tmp_path: Path):
    case = ss.scenario("polar-swimmer", elements=20)
    found = ss.branch(case, "peclet", 22.5, start=21.5, state="trivial", stability=False, out=tmp_path / "sphere")
    steady = ss.steady(found.scenario_at(found["pitchfork-1"]), start=f"{tmp_path / 'sphere'}:pitchfork-1")
    rates = steady.rates()
    assert neutral_modes(steady.scenario, rates.neutral) == [HELD, {"name": CRITICAL, "index": 0}]
    assert (rates.parities[0], rates.n_unstable) == ("antisymmetric", 0)


def test_modes_are_stored_and_drawn(sphere: Steady, tmp_path: Path):
    """The polar mode of the sphere: the regulator changes as cos(theta), antisymmetric, growing at Pe/2 - 11."""
    spectrum, path = sphere.spectrum(), tmp_path / "state"
    store_frame(path, sphere.scenario, sphere.frame, sphere.outcome)
    with pytest.raises(InputError, match="has no modes"):
        find_modes(str(path))
    store_modes(path, sphere.modes(spectrum))
    found = find_modes(str(path))
    np.testing.assert_array_equal(found.modes, spectrum.modes)
    assert found.growth_rates.tolist() == [list(pair) for pair in Rates.of(spectrum, sphere.scenario).values]
    assert found.parities[0] == "antisymmetric"
    mode, _ = found.mode(0)
    regulator = mode.nodes[:, sphere.engine.system.fields.index("c")]
    np.testing.assert_allclose(regulator / regulator[0], np.cos(np.pi * mode.mesh), atol=1e-6)
    figure = plot_mode(found, 0)
    assert figure.get_suptitle().startswith("polar-swimmer, mode 0: growth rate \N{MINUS SIGN}1 ")
    assert "antisymmetric" in figure.get_suptitle()
    assert ss.plot(path, mode=0).get_suptitle() == figure.get_suptitle()
    with pytest.raises(InputError, match="--mode 6: is not stored; choose 0 to 5"):
        found.mode(6)
