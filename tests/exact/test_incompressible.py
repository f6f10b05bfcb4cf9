"""Closed incompressible surfaces: at rest they are vesicles; in motion no piece of area changes."""

import numpy as np
import pytest
from tests.exact.test_balances import check_order, energy_miss
from tests.surfaces import fields_at, make_engine, march

import shapespace as ss
from shapespace.base.outcome import Outcome
from shapespace.modelling import define_model, define_scenario

pytestmark = pytest.mark.usefixtures("own_models")


def define() -> None:
    define_model("tight", "vesicle", [], incompressible=True)
    define_scenario("tight", "Incompressible", "tight", "vesicle", reduced_volume=0.8)


def test_an_incompressible_vesicle():
    """The same rest as a vesicle; another way there, on which matter keeps its area."""
    define()
    states = [ss.steady(ss.scenario(name, reduced_volume=0.8)) for name in ("vesicle", "tight")]
    for state in states:
        assert state.outcome is Outcome.CONVERGED
    loose, tight = (state.observables for state in states)
    for key in ("bending_energy", "height", "pressure", "tension_pole"):
        assert tight[key] == pytest.approx(loose[key], rel=1e-7), key
    engine = make_engine("tight", elements=40)
    moments, outcome = march(engine, 0.01, tolerance=1e-5)
    assert outcome is Outcome.REACHED_END
    u = np.linspace(0.02, 0.98, 49)
    strains = []
    for moment in moments[2:]:
        state, f = engine.problem.unpack(moment.x), fields_at(engine, moment.x, u)
        slope = state.derivatives(u)
        column = {name: i for i, name in enumerate(engine.system.fields)}
        assert moment.rate is not None
        dq = engine.problem.rates(moment.x, engine.p, moment.rate)
        stages = state.stage_points.ravel()
        r_t, z_t = (np.interp(u, stages, dq[..., i].ravel()) for i in (0, 1))
        h, scalars = state.scalars[0], dict(zip(engine.system.scalars, state.scalars, strict=True))
        v_n = np.sin(f["psi"]) * r_t + np.cos(f["psi"]) * (z_t + scalars["v0"])
        curvature = slope[:, column["psi"]] / h + np.sin(f["psi"]) / f["r"]
        strain = slope[:, column["v"]] / h + np.cos(f["psi"]) / f["r"] * f["v"] + curvature * v_n
        strains.append(np.abs(strain).max() / np.abs(curvature * v_n).max())
        assert abs(scalars["dilation"]) < 1e-3 * np.abs(curvature * v_n).max()
    assert max(strains) < 1e-2, "rates between Gauss points are interpolated linearly"


@pytest.mark.slow
def test_energy_law_of_an_incompressible_vesicle():
    define()
    check_order(
        [energy_miss(make_engine("tight", elements=40), 2, steps, 0.01) for steps in (20, 40, 80)], 2, margin=0.4
    )
