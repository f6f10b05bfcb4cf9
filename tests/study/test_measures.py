"""Observables that a branch is held at or stopped at: values, derivatives, and branches under control."""

from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.state import state_from_functions
from shapespace.study import branching
from shapespace.study.engine import Engine, state_of
from shapespace.study.keyed import KeyedProblem
from shapespace.study.measures import OBSERVED, make_observable
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
    tested = 0
    for observable in OBSERVED:
        if observable not in known:
            continue
        tested += 1
        held = make_observable(case, observable, key)
        assert held.value(problem, x, p) == pytest.approx(known[observable] * held.unit, rel=1e-9, abs=1e-12)
        row, _ = held.gradient(problem, x, p)
        dx = 1e-2 * random.standard_normal(len(x))
        step = 1e-4
        difference = (held.value(problem, x + step * dx, p) - held.value(problem, x - step * dx, p)) / (2.0 * step)
        assert row @ dx == pytest.approx(difference, rel=1e-4, abs=1e-7), observable
    assert tested >= 4


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
        ({"key": "height"}, "height: is not a parameter of this model"),
        ({"key": "height", "free": "elements"}, "elements: is not a parameter"),
        ({"key": "heigth", "free": "pulling_force"}, "heigth: is neither a parameter nor an observable to hold"),
        ({"key": "area", "free": "pulling_force"}, "choose height, neck_radius"),
        ({"key": "pressure", "free": "pulling_force"}, "pressure: is neither"),
        ({"key": "height", "free": "base_radius"}, "base_radius: changes the unit of height"),
        ({"key": "height", "free": "pulling_force", "start": None}, "give the value to start at as --start"),
        ({"key": "pulling_force", "free": "height"}, "goes with an observable"),
        ({"key": "pulling_force", "at": (("heigth", 1.0),)}, "heigth: is neither"),
        ({"key": "height", "free": "pulling_force", "stop": float("nan")}, "must be a finite number"),
    ],
)
def test_bad_control_is_one_line(options: dict[str, object], part: str):
    arguments = {"key": "height", "stop": 1.0, "start": 0.5, **options}
    with pytest.raises(InputError) as caught:
        ss.branch(ss.scenario("membrane-protrusion", **COAT), arguments.pop("key"), arguments.pop("stop"), **arguments)
    assert part in str(caught.value)


def test_a_value_that_is_not_reached_is_said(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(branching, "MAX_POINTS", 3)
    case = ss.scenario("membrane-protrusion", spontaneous_curvature=0.0, elements=20)
    found = ss.branch(case, "height", 2.0, start=1.0, free="pulling_force", stability=False)
    assert found.outcome is Outcome.NOT_REACHED
    assert not found.points
    assert "No state with height = 1 to start from" in found.detail
