"""Eulerian, Lagrangian and scaling parameterizations: one trajectory, and where another than the last is refused."""

import numpy as np
import pytest
from tests.surfaces import make_engine, march

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.engine import Engine


def test_one_trajectory_on_three_meshes():
    """Length, height, volume and speed at one time; the other two meshes stretch."""
    found, ratios = {}, {}
    for name in ("sle", "eulerian", "lagrangian"):
        case = ss.scenario("polar-swimmer", seed_amplitude=0.3, until=0.03, parameterization=name, time_tolerance=1e-6)
        run = ss.run(case)
        assert run.outcome is Outcome.REACHED_END
        found[name] = run.observables
        h = run.frames[-1].algebraic[..., -1] if name != "sle" else np.ones(1)
        ratios[name] = float(h.max() / h.min())
        assert {"meridional_curvature", "tangential_velocity"} <= set(run.dataset)
    for name in ("eulerian", "lagrangian"):
        for key in ("length", "height", "area", "polarity", "velocity", "bending_energy"):
            # The polarity is a difference from one.
            allowed = {"abs": 1e-4} if key == "polarity" else {"rel": 2e-4}
            assert found[name][key] == pytest.approx(found["sle"][key], **allowed), (name, key)
        assert found[name]["volume"] == pytest.approx(found["sle"]["volume"], rel=1e-9)
    assert min(ratios["eulerian"], ratios["lagrangian"]) > 1.5 > ratios["sle"] == 1.0


@pytest.mark.parametrize("name", ["eulerian", "lagrangian"])
def test_the_slip_that_keeps_the_pole_is_an_error_of_time_steps(name: str):
    """It falls with them at first order."""
    slips = []
    for steps in (5, 10, 20):
        engine = make_engine("polar-swimmer", elements=40, seed_amplitude=0.3, parameterization=name)
        moments, outcome = march(engine, 0.02, order=1, fixed_step=0.02 / steps)
        assert outcome is Outcome.REACHED_END
        slips.append(abs(engine.problem.unpack(moments[-1].x).scalars[engine.system.scalars.index("slip")]))
    assert np.log2(slips[0] / slips[2]) / 2.0 > 0.8, slips


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="a stationary state has no such mesh"):
        ss.steady(ss.scenario("polar-swimmer", parameterization="eulerian"))
    with pytest.raises(InputError, match="lies at u = 1/2, which is the middle of the surface for sle only"):
        Engine.of(ss.scenario("guided-division", parameterization="lagrangian"))
    with pytest.raises(ValueError, match="is for closed surfaces; at a rim matter leaves the mesh"):
        Engine.of(ss.scenario("membrane-protrusion", parameterization="eulerian"))
    with pytest.raises(InputError, match="parameterization = 'euler': must be 'sle', 'eulerian' or 'lagrangian'"):
        ss.scenario("polar-swimmer", parameterization="euler")
