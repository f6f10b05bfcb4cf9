"""Solved states obey the balances of force and torque with tensors that were coded by hand (App. E), and at the ends (App. F).

The tensors need up to three derivatives of the shape, which the solution's polynomials of degree 6 give to fourth order: what
is left over must be small and fall accordingly as the elements are halved.
"""

from dataclasses import replace

import numpy as np
import pytest
from tests.exact.tensors import misses, surface_of, tensors_of
from tests.surfaces import integral, make_engine, march, resting

import shapespace as ss
from shapespace.analysis.evolution import Moment
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.models import open_membrane
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.newton import Newton
from shapespace.study.engine import Engine
from shapespace.variational.ends import Free, Pinned

TIGHT = Newton(1e-11)
TOLERANCE = 1e-5
"""`mesh_tolerance` of the shipped scenarios."""

MOVING = {
    "polar-swimmer": (0.02, 40, {"seed_amplitude": 0.3, "spontaneous_curvature": 0.4}),
    "guided-division": (0.02, 80, {}),
    "ring-slipping": (0.004, 160, {"seed_amplitude": 0.1}),
    "vesicle": (0.01, 160, {"initial_leaning": 0.3}),
    "membrane-protrusion": (0.01, 160, {"pulling_force": 20.0}),
}
RESTING = {
    "polar-swimmer": {"peclet": 40.0},
    "guided-division": {"ring_amplitude": 1.0},
    "vesicle": {},
    "membrane-protrusion": {},
}


def moved(engine: Engine, until: float, steps: int = 4) -> Moment:
    """After a few steps of backward Euler, whose force balance holds at its end."""
    moments, outcome = march(engine, until, order=1, fixed_step=until / steps, newton=TIGHT)
    assert outcome is Outcome.REACHED_END
    return moments[-1]


@pytest.mark.parametrize("name", MOVING)
def test_balances_hold_on_a_surface_in_motion(name: str):
    until, elements, keys = MOVING[name]
    found = []
    for count in (elements // 2, elements):
        engine = make_engine(name, elements=count, degree=6, **keys)
        last = moved(engine, until)
        assert last.rate is not None
        found.append(misses(engine, last.x, last.rate))
    for component in ("meridional", "normal"):
        coarse, fine = (one[component] for one in found)
        assert fine < TOLERANCE, f"{component}: {found}"
        assert coarse > 8.0 * fine or fine < 1e-9, f"{component} does not converge: {found}"


@pytest.mark.parametrize("name", RESTING)
def test_balances_hold_on_a_stationary_state(name: str):
    state = ss.steady(ss.scenario(name, elements=80, degree=6, mesh_tolerance=1e-8, **RESTING[name]))
    assert state.outcome is Outcome.CONVERGED
    found = misses(state.engine, state.found.x, resting(state.engine, state.found.x))
    assert max(found.values()) < TOLERANCE, f"{found}"


def test_azimuthal_balance_holds_where_a_rim_is_held_in_turning_surroundings():
    made = make_engine("membrane-protrusion", elements=160, degree=6, azimuthal_flow=True, friction=9.0)
    p = made.p.copy()
    p[made.system.parameters.index("rotation_rate")] = 0.7
    engine = replace(made, p=p, values={**made.values, "rotation_rate": 0.7})
    last = moved(engine, 0.02)
    assert last.rate is not None
    assert np.abs(surface_of(engine, last.x, last.rate).v_phi).max() > 0.1
    found = misses(engine, last.x, last.rate)
    assert max(found.values()) < TOLERANCE, f"{found}"


def end_value(engine: Engine, values: Array) -> float:
    """At u = 1, by the polynomial through the Gauss points (N, k) of the last element."""
    points = gauss_rule(engine.problem.degree).points
    return float(np.polynomial.Polynomial.fit(points, values[-1], len(points) - 1)(1.0))


def pulled(ends: dict[str, tuple[object, object]]) -> tuple[Engine, Moment]:
    """A membrane that rises under a pull, with other ends."""
    made = make_engine("membrane-protrusion", elements=160, degree=6, pulling_force=20.0)
    system = replace(open_membrane.RECIPE, ends={**open_membrane.ENDS, **ends}).system()
    engine = replace(made, problem=replace(made.problem, system=system))
    return engine, moved(engine, 0.01)


def rim(engine: Engine, last: Moment) -> dict[str, float]:
    """At the rim gamma_H if there is one, the moment and the axial force 2 pi r t_z; the axial force from outside on all."""
    assert last.rate is not None
    s = surface_of(engine, last.x, last.rate)
    t = tensors_of(engine, s)
    sin, cos = np.sin(s.psi), np.cos(s.psi)
    axial = (t.force_n * cos - t.force_u * sin) * s.r * s.h
    return {
        "gamma": end_value(engine, s.fields.get("gamma", s.r)),
        "moment": end_value(engine, t.moment),
        "force": 2.0 * np.pi * end_value(engine, s.r * (t.un * cos - t.uu * sin)),
        "load": 2.0 * np.pi * integral(engine, axial),
        "height": float(s.fields["z"][0, 0]),
    }


def test_a_clamped_rim_carries_the_load_at_the_tension_of_the_reservoir():
    engine, last = pulled({})
    at = rim(engine, last)
    assert at["height"] > 0.05
    assert at["gamma"] == pytest.approx(engine.values["boundary_tension"], rel=1e-6)
    assert at["load"] == pytest.approx(20.0, rel=0.1), "the rest is friction"
    assert at["force"] == pytest.approx(-at["load"], rel=1e-5)
    assert abs(at["moment"]) > 0.1


def test_a_hinged_rim_bears_no_moment():
    """delta(d psi/dt) is free at the rim: its factor, the bending moment, vanishes there (App. F)."""
    engine, last = pulled({"psi": (Pinned(), Free())})
    at = rim(engine, last)
    assert at["height"] > 0.05
    assert abs(at["moment"]) < 1e-6
    assert at["force"] == pytest.approx(-at["load"], rel=1e-5)


def test_a_rim_free_to_rise_bears_no_axial_force():
    """delta(d z/dt) is free at the rim, and the apex is held: nothing but the apex carries the load."""
    engine, last = pulled({"z": (Pinned(), Free())})
    at = rim(engine, last)
    assert abs(at["force"]) < 1e-5 * at["load"]


@pytest.mark.parametrize("name", ["polar-swimmer", "vesicle"])
def test_no_force_and_no_moment_enters_at_the_poles(name: str):
    """All external forces, pressure included, add up to nothing along the axis."""
    until, elements, keys = MOVING[name]
    engine = make_engine(name, elements=elements, degree=6, **keys)
    last = moved(engine, until)
    at = rim(engine, last)
    assert abs(at["load"]) < 1e-9 * 4.0 * np.pi
    assert abs(at["force"]) < 1e-5
