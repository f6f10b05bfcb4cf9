"""Curves of scenarios in two keys: closed forms, special points, reloading, resuming, starts from them, bad input."""

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.curve_store import CurvePoint

SWIMMER = {"elements": 20}


@pytest.fixture(scope="module")
def sphere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The resting sphere through its pitchfork at Pe = 22 (exact result 2)."""
    path = tmp_path_factory.mktemp("branch") / "sphere"
    case = ss.scenario("polar-swimmer", **SWIMMER)
    ss.branch(case, "peclet", 23.0, start=21.0, state="trivial", out=path, stability=False)
    return path


def polarizing(sphere: Path, **options: Any) -> ss.Curve:
    """Its pitchfork with saturation."""
    return ss.curve(f"{sphere}:pitchfork-1", "saturation_concentration", 3.0, start=0.6, at=(2.0,), **options)


@pytest.fixture(scope="module")
def store(sphere: Path) -> Path:
    path = sphere.with_name("forks")
    assert polarizing(sphere, out=path).outcome is Outcome.REACHED_STOP
    return path


def exact(case: ss.Scenario) -> float:
    """Pe* = (2 + k R^2/D)/(c0 f'(c0)) for c0 = R = D = 1, whatever the friction (exact result 2)."""
    v = case.values()
    c_s, k = float(v["saturation_concentration"]), float(v["turnover_rate"])
    return (2.0 + k) * (1.0 + c_s**2) ** 2 / (2.0 * c_s**2)


def test_the_sphere_polarizes_where_theory_says(store: Path):
    found = ss.open_curve(store)
    assert (found.keys, found.of) == (("peclet", "saturation_concentration"), "pitchfork")
    assert [point.label for point in found.special_points] == ["end-2", "user-1", "degenerate-pitchfork-1", "end-1"]
    assert [found[label].parameters[1] for label in ("end-2", "start", "user-1", "end-1")] == [0.6, 1.0, 2.0, 3.0]
    assert not found.missed
    for point in found.points:
        expected = exact(found.scenario_at(point))
        assert point.parameters[0] == pytest.approx(expected, rel=1e-9)
        assert abs(point.unfolding) < 1e-12
        if point.label:
            assert abs(point.parameters[0] - expected) <= point.parameter_errors[0]


@pytest.mark.parametrize(("key", "stop"), [("turnover_rate", 12.0), ("inverse_hydrodynamic_length", 2.0)])
def test_one_leg_from_the_start(sphere: Path, key: str, stop: float):
    found = ss.curve(f"{sphere}:pitchfork-1", key, stop)
    assert [point.label for point in found.points if point.label] == ["start", "end-1"]
    end = found["end-1"]
    assert end.parameters[1] == stop
    assert end.parameters[0] == pytest.approx(exact(found.scenario_at(end)), rel=1e-9)


def test_the_side_branch_turns_round_at_the_degenerate_pitchfork(store: Path):
    """Below it swimmers begin beyond Pe*, above it before."""
    found = ss.open_curve(store)
    for label, direction in (("user-1", 1.0), ("end-1", -1.0)):
        at = found[label]
        stop = float(at.parameters[0]) * (1.0 + 0.002 * direction)
        side = ss.branch(found.scenario_at(at), "peclet", stop, origin=f"{store}:{label}", side=1, stability=False)
        assert side.outcome is Outcome.REACHED_STOP, label
        assert abs(side["end-1"].observables["velocity"]) > 1e-3


def test_any_label_is_a_start(store: Path):
    found = ss.open_curve(store)
    at = found.scenario_at(found["user-1"])
    assert at.values()["saturation_concentration"] == 2.0
    state = ss.steady(at, start=f"{store}:user-1")
    assert state.outcome.is_success
    assert state.found.iterations <= 2
    run = ss.run(at.with_overrides({"until": 0.001, "stationary_rate": 0.0}), start=f"{store}:user-1")
    assert abs(run.observables["velocity"]) < 1e-9
    onwards = ss.curve(f"{store}:user-1", "turnover_rate", 10.0)
    assert onwards.keys == ("peclet", "turnover_rate")
    assert onwards["end-1"].parameters[0] == pytest.approx(exact(onwards.scenario_at(onwards["end-1"])), rel=1e-9)


def assert_same(one: CurvePoint, other: CurvePoint) -> None:
    assert (one.label, one.kind, one.leg, one.is_step) == (other.label, other.kind, other.leg, other.is_step)
    np.testing.assert_allclose(one.parameters, other.parameters, rtol=1e-10)
    np.testing.assert_allclose(one.frame.nodes, other.frame.nodes, atol=1e-9)


@pytest.mark.parametrize("kept", [1, 7, "degenerate", "turn-round", "last"])
def test_an_interrupted_curve_goes_on_to_the_same_points(sphere: Path, store: Path, tmp_path: Path, kept: int | str):
    """Also right after a special point, after the first leg, and before the last point."""
    whole, path = ss.open_curve(store), tmp_path / "cut"
    order = sorted(whole.points, key=lambda point: (point.leg, point.arclength))
    places = {point.label: number + 1 for number, point in enumerate(order) if point.label}
    count = {"degenerate": places["degenerate-pitchfork-1"], "turn-round": places["end-1"], "last": len(order) - 1}.get(
        str(kept), kept
    )
    shutil.copytree(store, path)
    for file in sorted((path / "points").iterdir())[int(count) :]:
        file.unlink()
    resumed = polarizing(sphere, out=path, resume=True)
    assert resumed.outcome is Outcome.REACHED_STOP
    for one, other in zip(resumed.points, whole.points, strict=True):
        assert_same(one, other)


def test_a_finished_curve_is_left_as_it_is(sphere: Path, store: Path):
    before = {file: file.stat().st_mtime_ns for file in store.rglob("*")}
    assert polarizing(sphere, out=store, resume=True).outcome is Outcome.REACHED_STOP
    assert {file: file.stat().st_mtime_ns for file in store.rglob("*")} == before


def test_a_curve_ends_where_a_key_ends(tmp_path: Path):
    """Pitchforks in the turnover rate k = Pe/2 - 2, which cannot be negative: the curve ends at k = 0, Pe = 4."""
    case = ss.scenario("polar-swimmer", peclet=10.0, turnover_rate=2.8, **SWIMMER)
    path = tmp_path / "sphere"
    ss.branch(case, "turnover_rate", 3.2, state="trivial", out=path, stability=False)
    found = ss.curve(f"{path}:pitchfork-1", "peclet", 3.0)
    assert found.outcome is Outcome.OUT_OF_RANGE
    end = found["out-of-range-1"]
    assert end.parameters == pytest.approx([0.0, 4.0], abs=1e-4)
    assert (np.abs(end.parameters - [0.0, 4.0]) <= end.parameter_errors).all()


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"origin": "{sphere}:end-1"}, "is no fold or branch point"),
        ({"origin": "{sphere}"}, "is no fold or branch point"),
        ({"origin": "{sphere}:fold-7"}, "fold-7: is no label of this branch; choose one of start, pitchfork-1"),
        ({"origin": "absent:fold-1"}, "is not a directory"),
        ({"key": "peclet"}, "varies along the branch already"),
        ({"key": "active_tension"}, "varies along the branch already"),
        ({"key": "turnover"}, "turnover: is not a parameter"),
        ({"key": "elements"}, "elements: is not a parameter"),
        ({"start": 10.0}, "must include turnover_rate = 9.0"),
        ({"stop": 9.0}, "must differ from the start"),
        ({"stop": float("inf")}, "must be a finite number"),
        ({"at": (float("nan"),)}, "must be a finite number"),
        ({"at": (13.0,)}, "lies outside 9 to 12"),
        ({"stop": -1.0}, "turnover_rate = -1: must be >= 0"),
        ({"resume": True}, "needs the directory"),
    ],
)
def test_bad_input_is_one_line(sphere: Path, options: dict[str, Any], part: str):
    arguments = {"origin": "{sphere}:pitchfork-1", "key": "turnover_rate", "stop": 12.0, **options}
    origin, key, stop = arguments.pop("origin").format(sphere=sphere), arguments.pop("key"), arguments.pop("stop")
    with pytest.raises(InputError) as caught:
        ss.curve(origin, key, stop, **arguments)
    assert part in str(caught.value)


def test_foreign_and_other_stores_are_refused(sphere: Path, store: Path, tmp_path: Path):
    with pytest.raises(StoreError, match="holds a curve already"):
        polarizing(sphere, out=store)
    with pytest.raises(StoreError, match=r"stop is 3\.0, not 2\.5"):
        ss.curve(f"{sphere}:pitchfork-1", "saturation_concentration", 2.5, start=0.6, at=(2.0,), out=store, resume=True)
    with pytest.raises(StoreError, match="not of a shapespace-branch store"):
        ss.open_branch(store)
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(StoreError, match="holds other files"):
        polarizing(sphere, out=tmp_path)


@pytest.mark.slow
def test_killed_and_resumed_gives_the_same_points(sphere: Path, store: Path, tmp_path: Path):
    path = tmp_path / "killed"
    words = "--vary saturation_concentration --start 0.6 --stop 3 --at 2 --resume"
    command = [sys.executable, "-m", "shapespace", "curve", f"{sphere}:pitchfork-1", *words.split(), "--out", str(path)]
    for count in (3, 9):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 240.0
        while len(list(path.glob("points/*.npz"))) < count and process.poll() is None:
            assert time.monotonic() < deadline, "the curve stored nothing"
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        process.wait()
    whole, resumed = ss.open_curve(store), polarizing(sphere, out=path, resume=True)
    for one, other in zip(resumed.points, whole.points, strict=True):
        assert_same(one, other)


@pytest.fixture(scope="module")
def division(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Guided division at Pe = 450 (Fig. 7b) past both of its folds."""
    path = tmp_path_factory.mktemp("division") / "branch"
    case = ss.scenario("guided-division")
    found = ss.branch(case, "ring_amplitude", 4.2, start=0.0, at=(1.4,), out=path, stability=False)
    assert found["fold-1"].parameter == pytest.approx(2.36247419, abs=1e-6)
    assert found["fold-2"].parameter == pytest.approx(1.29348538, abs=1e-6)
    return path


@pytest.mark.slow
def test_the_folds_and_the_pitchforks_of_division_merge_in_one_point(division: Path):
    """Located on both curves, by different equations, it is the same within the errors given."""
    folds = ss.curve(f"{division}:fold-1", "peclet", 650.0)["fold-pitchfork-1"]
    forks = ss.curve(f"{division}:pitchfork-1", "peclet", 650.0)["fold-pitchfork-1"]
    errors = folds.parameter_errors + forks.parameter_errors
    assert (np.abs(folds.parameters - forks.parameters) <= errors).all()
    assert (errors < 1e-6 * np.array([1.0, 620.0])).all()


@pytest.mark.slow
def test_the_second_fold_of_division_ends_in_a_cusp(division: Path, tmp_path: Path):
    """On both meshes at one place within the errors."""
    cusps = []
    for elements in (40, 80):
        case = ss.scenario("guided-division", elements=elements)
        path = tmp_path / str(elements)
        ss.branch(case, "ring_amplitude", 1.2, start=1.4, origin=f"{division}:user-2", out=path, stability=False)
        cusps.append(ss.curve(f"{path}:fold-1", "peclet", 2000.0)["cusp-1"])
    errors = cusps[0].parameter_errors + cusps[1].parameter_errors
    assert (np.abs(cusps[0].parameters - cusps[1].parameters) <= errors).all()
    assert (errors < 1e-5 * np.array([1.0, 1950.0])).all()
