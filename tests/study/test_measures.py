"""Observables that a branch is held at or stopped at: values, derivatives, and branches under control."""

from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.state import state_from_functions
from shapespace.study import branch_starts
from shapespace.study.engine import Engine, state_of
from shapespace.study.keyed import KeyedProblem
from shapespace.study.measures import READ, make_observable, observed_names
from shapespace.study.observables import measure

COAT = {"elements": 40}


@pytest.mark.parametrize("name", ["guided-division", "membrane-protrusion"])
def test_measures_are_the_observables_with_their_derivatives(name: str):
    case = ss.scenario(name, elements=20)
    key = "peclet" if name == "guided-division" else "spontaneous_curvature"
    problem, engine = KeyedProblem.of(case, (key,)), Engine.of(case)
    u, column = engine.initial_state(), {field: i for i, field in enumerate(engine.system.fields)}
    # A pear with a neck, smooth, and without a symmetry that makes a derivative vanish.
    shapes = {
        "r": lambda t: np.sin(np.pi * t) * (0.3 + (1.8 * t - 1.0) ** 2),
        "z": lambda t: np.cos(np.pi * t) + 0.1 * t**2,
        "psi": lambda t: np.pi * t + 0.2 * t**2,
        "c": lambda t: 1.0 + t * np.sin(np.pi * t),
    }
    for field in shapes.keys() & column.keys():
        shape, stages, step = shapes[field], u.stage_points, 1e-5
        u.nodes[:, column[field]] = shape(u.mesh)
        u.slopes[..., column[field]] = (shape(stages + step) - shape(stages - step)) / (2.0 * step)
    u = state_from_functions(u.mesh, problem.base.degree, u.nodes, u.slopes, u.algebraic, u.scalars)
    x, p = problem.base.pack(u), np.array([float(case.values()[key])])
    known = measure(engine, x, REST)
    random = np.random.default_rng(0)
    assert READ.keys() & known.keys() < {*observed_names(case)}
    assert {"area", "bending_energy", "max_meridional_curvature", "tension_pole"} < {*observed_names(case)}
    # The place of a maximum is known to the root of round-off only, which no difference over so small a step resolves.
    for observable in sorted({*observed_names(case)} - {"ring_position"}):
        held = make_observable(case, observable, key)
        if observable in known:
            assert held.value(problem, x, p) == pytest.approx(known[observable] * held.unit, rel=1e-9, abs=1e-9)
        row, by_key = held.gradient(problem, x, p)
        dx, dp = 1e-2 * random.standard_normal(len(x)), 0.1 * random.standard_normal(1)
        step = 1e-4
        ahead, behind = (held.value(problem, x + s * dx, p + s * dp) for s in (step, -step))
        difference = (ahead - behind) / (2.0 * step)
        assert row @ dx + by_key @ dp == pytest.approx(difference, rel=2e-4, abs=1e-6), observable


def test_an_integral_is_held_and_stopped_at_as_well():
    """Area, whose gradient is dense, and bending energy, which depends on the key itself."""
    case, key = ss.scenario("membrane-protrusion", spontaneous_curvature=4.0, **COAT), "spontaneous_curvature"
    by_key = ss.branch(case, key, 5.0, start=3.0, at=(("area", 3.17), ("bending_energy", 1.0)), stability=False)
    by_area, by_energy = by_key["user-1"], by_key["user-2"]
    assert by_area.observables["area"] == pytest.approx(3.17, rel=1e-9)
    assert by_energy.observables["bending_energy"] == pytest.approx(1.0, rel=1e-9)
    for name, point, other in (("area", by_area, 3.18), ("bending_energy", by_energy, 1.1)):
        value = point.observables[name]
        held = ss.branch(case, name, other, start=value, free=key, stability=False)
        assert held["start"].freed == pytest.approx(point.parameter, rel=1e-7)
        assert held["end-1"].observables[name] == pytest.approx(other, rel=1e-9)


def test_a_neck_that_is_not_there_yet_is_stopped_at():
    """On the way from the sphere no neck is there at first; the branch stops where one has the radius asked for."""
    case = ss.scenario("guided-division", mesh_tolerance=1e-4)
    found = ss.branch(
        case, "ring_amplitude", 4.2, start=0.0, at=(1.5, ("neck_radius", 0.5)), state="trivial", stability=False
    )
    (necked,) = [one for one in found.special_points if one.kind == "user" and one.parameter != 1.5]
    assert necked.observables["neck_radius"] == pytest.approx(0.5, rel=1e-9)
    none = ss.branch(case, "neck_radius", 0.0043, start=0.004, free="ring_amplitude", stability=False)
    assert none.outcome is Outcome.REACHED_STOP  # the default state has one
    without = ss.branch(
        case.with_overrides({"ring_amplitude": 0.5}),
        "neck_radius",
        0.5,
        start=0.6,
        free="ring_amplitude",
        stability=False,
    )
    assert without.outcome is Outcome.NO_STATE
    assert "has no neck_radius" in without.detail


def test_holding_the_height_and_stopping_at_it_are_one_branch(tmp_path: Path):
    """The key that answers a prescribed height is the one at which its own branch has that height; any label is a start."""
    case = ss.scenario("membrane-protrusion", spontaneous_curvature=0.0, **COAT)
    path = tmp_path / "held"
    by_key = ss.branch(case, "pulling_force", 12.0, start=0.0, at=(("height", 0.1),), stability=False)
    point = by_key["user-1"]
    assert point.observables["height"] == pytest.approx(0.1, abs=1e-9)
    held = ss.branch(
        case.with_overrides({"pulling_force": 1.0}),
        "height",
        0.2,
        start=0.05,
        free="pulling_force",
        at=(0.1,),
        out=path,
    )
    assert (held["start"].parameter, held["user-1"].parameter, held["end-1"].parameter) == (0.05, 0.1, 0.2)
    assert held["user-1"].observables["height"] == pytest.approx(0.1, abs=1e-9)
    assert held["user-1"].freed == pytest.approx(point.parameter, rel=1e-7)
    assert held["user-1"].n_unstable == 0
    found = ss.open_branch(path)
    assert (found.key, found.free) == ("height", "pulling_force")
    again = ss.steady(found.scenario_at(found["user-1"]), start=f"{path}:user-1")
    assert again.found.iterations <= 2
    assert again.observables["height"] == pytest.approx(0.1, abs=1e-9)
    back = ss.branch(case, "height", 0.08, free="pulling_force", origin=f"{path}:user-1", stability=False)
    assert back["end-1"].parameter == 0.08
    problem, state = KeyedProblem.of(case, ("pulling_force",)), state_of(held["user-1"].frame)
    assert held["user-1"].modes.shape[1] == len(problem.base.on_mesh(state.mesh).pack(state))


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"key": "height"}, "--vary height: is an observable; give as --free the key"),
        ({"key": "height", "free": "elements"}, "elements: is not a parameter"),
        ({"key": "heigth", "free": "pulling_force"}, "heigth: is no observable; the nearest observable is height"),
        ({"key": "pressure", "free": "pulling_force"}, "pressure: is no observable"),
        ({"key": "height", "free": "base_radius"}, "base_radius: changes the unit of height"),
        ({"key": "height", "free": "pulling_force", "start": None}, "give the value to start at as --start"),
        ({"key": "pulling_force", "free": "height"}, "goes with an observable"),
        ({"key": "pulling_force", "at": (("heigth", 1.0),)}, "heigth: is no observable"),
        ({"key": "pulling_force", "at": (("friction", 1.0),)}, "friction: is a parameter, and stays as it is"),
        ({"key": "height", "free": "pulling_force", "stop": float("nan")}, "must be a finite number"),
    ],
)
def test_bad_control_is_one_line(options: dict[str, object], part: str):
    arguments = {"key": "height", "stop": 1.0, "start": 0.5, **options}
    with pytest.raises(InputError) as caught:
        ss.branch(ss.scenario("membrane-protrusion", **COAT), arguments.pop("key"), arguments.pop("stop"), **arguments)
    assert part in str(caught.value)


def test_a_value_that_is_not_reached_is_said(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(branch_starts, "MAX_POINTS", 3)
    case = ss.scenario("membrane-protrusion", spontaneous_curvature=0.0, elements=20)
    found = ss.branch(case, "height", 2.0, start=1.0, free="pulling_force", stability=False)
    assert found.outcome is Outcome.NOT_REACHED
    assert not found.points
    assert "No state with height = 1 to start from" in found.detail
