"""Branches of scenarios: special points in closed form, stability, side branches, reloading, resuming, bad input."""

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
from shapespace.analysis.branch import Point
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.newton import solve_root
from shapespace.study import landmarks
from shapespace.study.branch_point import BranchPoint
from shapespace.study.engine import Engine, state_of
from shapespace.study.paths import NEWTON

SWIMMER = {"elements": 20}


def sphere(**options: Any) -> ss.Branch:
    """The resting sphere through its pitchfork at Pe = 22 (exact result 2)."""
    case = ss.scenario("polar-swimmer", **SWIMMER)
    return ss.branch(case, "peclet", 30.0, start=15.0, at=(20.0, 25.0), state="trivial", **options)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("branch") / "sphere"
    assert sphere(out=path).outcome is Outcome.REACHED_STOP
    return path


@pytest.fixture(scope="module")
def sides(store: Path) -> list[ss.Branch]:
    case = ss.scenario("polar-swimmer", **SWIMMER)
    return [ss.branch(case, "peclet", 25.0, origin=f"{store}:pitchfork-1", side=side) for side in (1, -1)]


def assert_same(one: BranchPoint, other: BranchPoint) -> None:
    assert (one.label, one.kind, one.leg, one.n_unstable) == (other.label, other.kind, other.leg, other.n_unstable)
    assert (one.n_unstable_before, one.n_unstable_after) == (other.n_unstable_before, other.n_unstable_after)
    assert one.parameter == pytest.approx(other.parameter, abs=1e-10)
    np.testing.assert_allclose(one.frame.nodes, other.frame.nodes, atol=1e-9)
    np.testing.assert_allclose(one.growth_rates, other.growth_rates, atol=1e-5)


def test_the_sphere_loses_stability_at_its_pitchfork(store: Path):
    found = ss.open_branch(store)
    assert [point.label for point in found.special_points] == ["user-1", "pitchfork-1", "user-2", "end-1"]
    fork = found["pitchfork-1"]
    assert abs(fork.parameter - 22.0) < 1e-8
    assert abs(fork.parameter - 22.0) <= fork.parameter_error
    assert (fork.n_unstable_before, fork.n_unstable_after) == (0, 1)
    for point in found.points:
        leading = 0.5 * point.parameter - 11.0
        assert point.growth_rates[0] == pytest.approx([leading, 0.0], abs=1e-6)
        if point.is_step:
            assert point.n_unstable == int(leading > 0.0)
    assert [found[label].parameter for label in ("start", "user-1", "user-2", "end-1")] == [15.0, 20.0, 25.0, 30.0]
    assert not found.missed


def test_the_swimmer_leaves_to_both_sides(sides: list[ss.Branch]):
    for found in sides:
        assert found.outcome is Outcome.REACHED_STOP
        assert [point.label for point in found.special_points] == ["end-1"]
        speeds = np.abs([point.observables["velocity"] for point in found.points])
        assert (np.diff(speeds) > 0.0).all()
        assert all(point.n_unstable == 0 for point in found.points[1:])
    one, other = (found["end-1"].observables for found in sides)
    assert one["velocity"] == pytest.approx(-other["velocity"], rel=1e-8)
    assert abs(one["velocity"]) == pytest.approx(
        abs(ss.steady(ss.scenario("polar-swimmer", peclet=25.0, **SWIMMER)).observables["velocity"]), rel=1e-7
    )


def assert_found_again(path: Path) -> None:
    """Each stored point converges in one or two steps."""
    found = ss.open_branch(path)
    for point in found.points:
        if point.kind in ("fold", "pitchfork"):  # where the Jacobian at a fixed parameter is singular
            assert ss.steady(found.scenario_at(point), start=f"{path}:{point.label}").found.iterations <= 2
            continue
        engine = Engine.of(found.scenario_at(point))
        problem, x = engine.placed(state_of(point.frame))
        root = solve_root(problem, x, engine.p, REST, NEWTON)
        assert root.outcome is Outcome.CONVERGED
        assert root.iterations <= 2, point


def test_every_stored_point_is_found_again(store: Path):
    assert_found_again(store)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "key", "start", "stop", "state"),
    [
        (ss.scenario("membrane-protrusion"), "spontaneous_curvature", 0.0, 14.0, "trivial"),
        (ss.scenario("guided-division"), "ring_amplitude", 0.0, 4.2, "trivial"),
        (ss.scenario("vesicle"), "reduced_volume", 0.95, 0.6, "prolate"),
    ],
    ids=["fig-3a", "fig-7b", "prolate"],
)
def test_every_point_of_a_whole_branch_is_found_again(
    case: ss.Scenario, key: str, start: float, stop: float, state: str, tmp_path: Path
):
    ss.branch(case, key, stop, start=start, state=state, stability=False, out=tmp_path / "branch")
    assert_found_again(tmp_path / "branch")


def test_singular_points_are_states_at_rest_again(tmp_path: Path):
    """Newton at a fixed parameter would leave a fold; `steady` takes it for what it is."""
    case, path = ss.scenario("guided-division", elements=40), tmp_path / "ring"
    found = ss.branch(case, "ring_amplitude", 3.0, start=2.2, stability=False, out=path)
    assert [point.label for point in found.special_points] == ["fold-1", "pitchfork-1", "end-1"]
    for point in found.special_points:
        again = ss.steady(found.scenario_at(point), start=f"{path}:{point.label}")
        assert again.outcome is Outcome.CONVERGED
        assert again.found.iterations <= 2
        assert again.observables["height"] == pytest.approx(point.observables["height"], rel=1e-9)
        if point.kind in ("fold", "pitchfork"):
            assert abs(again.found.p[0] - point.parameter) < 1e-10
            assert "" in again.rates().neutral.values()


def test_a_branch_run_twice_gives_the_same_points(store: Path):
    one, other = ss.open_branch(store), sphere()
    assert [point.parameter for point in one.points] == [point.parameter for point in other.points]
    for a, b in zip(one.points, other.points, strict=True):
        np.testing.assert_array_equal(a.frame.nodes, b.frame.nodes)
        np.testing.assert_array_equal(a.growth_rates, b.growth_rates)


def test_any_label_is_a_start(store: Path):
    found = ss.open_branch(store)
    at = found.scenario_at(found["user-1"])
    steady = ss.steady(at, start=f"{store}:user-1")
    assert steady.found.iterations <= 2
    assert steady.spectrum().rates[0].real == pytest.approx(-1.0, abs=1e-6)
    run = ss.run(at.with_overrides({"until": 0.001, "stationary_rate": 0.0}), start=f"{store}:user-1")
    assert abs(run.observables["velocity"]) < 1e-9
    onwards = ss.branch(at, "peclet", 18.0, origin=f"{store}:user-1", at=(19.0,))
    assert [point.label for point in onwards.special_points] == ["user-1", "end-1"]
    other = ss.branch(at, "friction", 2.0, origin=f"{store}:user-1", stability=False)
    assert (other["start"].parameter, other["end-1"].parameter, other["end-1"].n_unstable) == (1.0, 2.0, None)


def test_both_ways_from_the_start():
    case = ss.scenario("polar-swimmer", **SWIMMER)
    found = ss.branch(case, "peclet", 24.0, start=21.0, state="trivial", both=True)
    values = [point.parameter for point in found.points]
    assert values == sorted(values)
    assert (values[0], values[-1]) == (18.0, 24.0)
    assert [point.label for point in found.special_points] == ["end-2", "pitchfork-1", "end-1"]


def test_a_branch_ends_where_the_surface_first_touches_itself(monkeypatch: pytest.MonkeyPatch):
    """Located between a shape that does not cross itself and one that does; here those beyond Pe = 21.3 are said to."""

    def crossing(point: Point) -> Outcome | None:
        return Outcome.SELF_INTERSECTING if point.parameter > 21.3 else None

    monkeypatch.setattr(landmarks, "physical_end", crossing)
    case = ss.scenario("polar-swimmer", **SWIMMER)
    found = ss.branch(case, "peclet", 30.0, start=21.0, state="trivial", stability=False)
    assert found.outcome is Outcome.SELF_CONTACT
    assert found.outcome.is_success
    contact = found["self-contact-1"]
    assert 0.0 <= 21.3 - contact.parameter <= contact.parameter_error < 1e-3
    begun = ss.branch(case, "peclet", 30.0, start=21.6, state="trivial", stability=False)
    assert [point.label for point in begun.points] == ["start", "self-intersecting-1"]


def cut(store: Path, path: Path, kept: int) -> Path:
    """A copy of a store as a kill would have left it."""
    shutil.copytree(store, path)
    for file in sorted((path / "points").iterdir())[kept:]:
        file.unlink()
    return path


@pytest.mark.parametrize("kept", [1, 5, 12, 13, 16])
def test_an_interrupted_branch_goes_on_to_the_same_points(store: Path, tmp_path: Path, kept: int):
    whole = ss.open_branch(store)
    resumed = sphere(out=cut(store, tmp_path / "cut", kept), resume=True)
    assert resumed.outcome is Outcome.REACHED_STOP
    assert len(resumed.points) == len(whole.points)
    for one, other in zip(resumed.points, whole.points, strict=True):
        assert_same(one, other)


def test_a_finished_branch_is_left_as_it_is(store: Path):
    before = {file: file.stat().st_mtime_ns for file in store.rglob("*")}
    assert sphere(out=store, resume=True).outcome is Outcome.REACHED_STOP
    assert {file: file.stat().st_mtime_ns for file in store.rglob("*")} == before


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"key": "pecle"}, "pecle: is not a parameter"),
        ({"key": "elements"}, "elements: is not a parameter"),
        ({"start": 30.0}, "must differ from the start"),
        ({"stop": float("nan")}, "must be a finite number"),
        ({"key": "friction", "stop": -1.0}, "friction = -1: must be >= 0"),
        ({"key": "friction", "start": 0.5, "at": (-2.0,)}, "--at -2: lies outside 0.5 to 30"),
        ({"origin": "absent:fold-1"}, "is not a directory"),
        ({"origin": "{store}:fold-7"}, "fold-7: is no label of this branch; choose one of start, user-1"),
        ({"origin": "{store}:user-1", "side": 1}, "is no pitchfork"),
        ({"side": 1}, "needs a branch point"),
        ({"side": 2}, "must be 1, -1 or 0"),
        ({"state": "oblate"}, "is unknown"),
        ({"state": "trivial", "origin": "{store}:user-1"}, "name two states"),
        ({"resume": True}, "needs the directory"),
    ],
)
def test_bad_input_is_one_line(store: Path, options: dict[str, Any], part: str):
    options = {name: value.format(store=store) if isinstance(value, str) else value for name, value in options.items()}
    arguments = {"key": "peclet", "stop": 30.0, "start": 15.0, **options}
    key, stop = arguments.pop("key"), arguments.pop("stop")
    with pytest.raises(InputError) as caught:
        ss.branch(ss.scenario("polar-swimmer", **SWIMMER), key, stop, **arguments)
    assert part in str(caught.value)


def test_foreign_and_other_stores_are_refused(store: Path, tmp_path: Path):
    case = ss.scenario("polar-swimmer", **SWIMMER)
    with pytest.raises(StoreError, match="holds a branch already"):
        sphere(out=store)
    with pytest.raises(StoreError, match=r"stop is 30\.0, not 29\.0"):
        ss.branch(case, "peclet", 29.0, start=15.0, at=(20.0, 25.0), state="trivial", out=store, resume=True)
    with pytest.raises(StoreError, match=r"friction is 1\.0, not 2\.0"):
        ss.branch(case.with_overrides({"friction": 2.0}), "peclet", 30.0, start=15.0, out=store, resume=True)
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(StoreError, match="holds other files"):
        sphere(out=tmp_path)
    with pytest.raises(StoreError, match="not of a shapespace-run store"):
        ss.open_dataset(store)


@pytest.mark.slow
def test_killed_and_resumed_gives_the_same_points(store: Path, tmp_path: Path):
    path = tmp_path / "killed"
    words = "branch polar-swimmer -s elements=20 --vary peclet --start 15 --stop 30 --at 20,25 --state trivial --resume"
    command = [sys.executable, "-m", "shapespace", *words.split(), "--out", str(path)]
    for count in (3, 13):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 240.0
        while len(list(path.glob("points/*.npz"))) < count and process.poll() is None:
            assert time.monotonic() < deadline, "the branch stored nothing"
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        process.wait()
    whole, resumed = ss.open_branch(store), sphere(out=path, resume=True)
    for one, other in zip(resumed.points, whole.points, strict=True):
        assert_same(one, other)


@pytest.mark.slow
def test_a_branch_between_two_pitchforks_ends_at_the_second(tmp_path: Path):
    """It would go on round the loop, through its mirror image and both pitchforks, again and again."""
    case, path = ss.scenario("guided-division"), tmp_path / "ring"
    found = ss.branch(case, "ring_amplitude", 3.0, start=1.7, stability=False, out=path)
    first, second = [point for point in found.special_points if point.kind == "pitchfork"][1:3]
    side = ss.branch(case, "ring_amplitude", 3.0, origin=f"{path}:{first.label}", side=1, stability=False)
    assert side.outcome is Outcome.REJOINED
    (end,) = side.special_points
    assert side.points[-1] is end
    assert end.kind == "pitchfork"
    assert end.parameter == pytest.approx(second.parameter, abs=first.parameter_error + second.parameter_error)
    assert len(side.points) < 100


def test_a_branch_in_the_ring_begins_at_the_sphere():
    """At Pe = 450 and k = 9 there are swimmers without a ring; states with one lead on from the sphere."""
    case = ss.scenario("guided-division", elements=20, turnover_rate=9.0)
    found = ss.branch(case, "ring_amplitude", 0.01, start=0.0, stability=False)
    assert found.began == "trivial"
    assert found.points[0].observables["area"] == pytest.approx(4.0 * np.pi)
    assert found["end-1"].observables["velocity"] == pytest.approx(0.0, abs=1e-8)
