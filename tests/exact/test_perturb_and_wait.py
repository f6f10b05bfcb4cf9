"""Growth rates against the dynamics: a state perturbed by its leading mode grows or decays at the spectrum's rate."""

from dataclasses import replace

import numpy as np
import pytest
from tests.surfaces import make_engine, march

import shapespace as ss
from shapespace.study.engine import state_of

AMPLITUDE = 1e-5


@pytest.mark.parametrize(("state", "peclet", "sign"), [("trivial", 30.0, 1.0), ("default", 25.0, -1.0)])
def test_the_leading_rate_is_that_of_a_small_perturbation(state: str, peclet: float, sign: float):
    """The sphere beyond its pitchfork (unstable) and the swimmer (stable), watched for half a time of growth."""
    steady = ss.steady(ss.scenario("polar-swimmer", elements=20, peclet=peclet), state=state)
    spectrum = steady.spectrum()
    rate, mode = float(spectrum.rates[0].real), spectrum.modes[0].real
    assert spectrum.rates[0].imag == 0.0
    assert np.sign(rate) == sign
    engine = make_engine("polar-swimmer", peclet=peclet)
    engine = replace(engine, problem=engine.problem.on_mesh(steady.found.problem.base.mesh))
    start = state_of(steady.perturbed(AMPLITUDE).frame)
    moments, _ = march(engine, 0.5 / abs(rate), state=start, tolerance=1e-7)
    times = np.array([moment.time for moment in moments])
    weights = engine.problem.weights(steady.found.x) * mode
    amplitudes = np.array([weights @ (moment.x - steady.found.x) for moment in moments]) / (weights @ mode)
    assert amplitudes[0] == pytest.approx(AMPLITUDE, rel=1e-6)
    late = times > 0.2 * times[-1]
    measured = np.polyfit(times[late], np.log(amplitudes[late]), 1)[0]
    assert measured == pytest.approx(rate, rel=0.01)
