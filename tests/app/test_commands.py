"""What the explorer proposes to type works, from any kind of state."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.app.served import Stores
from tests.shell import Shell

from shapespace.app.catalogue import Catalogue
from shapespace.app.commands import differences
from shapespace.cli.shared import find_scenario
from shapespace.study.branch_store import BranchStore, open_branch
from shapespace.study.branching import branch
from shapespace.study.curve_store import open_curve
from shapespace.study.diagram_store import DiagramStore
from shapespace.study.run import run
from shapespace.study.scenario import scenario, scenario_names
from shapespace.study.starts import find_start
from shapespace.study.store import RunStore

SHORT = {"branch": {"vary": "peclet", "stop": "22.5"}, "curve": {"vary": "turnover_rate", "stop": "10.2"}}


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def proposals(catalogue: Catalogue, store: int, place: str) -> dict[str, str]:
    """Commands by name, with choices that end soon."""
    question = "shape" if catalogue.source(store).noun == "diagram" else "state"
    found = {}
    for one in catalogue.answer(question, {"store": str(store), "place": place})["commands"]:
        text = one["text"]
        for key, value in SHORT.get(one["name"], {}).items():
            text = text.replace(f"{{{key}}}", value)
        found[one["name"]] = text
    return found


def say(shell: Shell, command: str) -> str:
    program, *words = shlex.split(command)
    assert program == "shapespace"
    answer = shell(*words)
    assert answer.status == 0, answer
    return answer.out


def test_a_point_without_a_label_is_a_start(shell: Shell, stores: Stores):
    catalogue, point = Catalogue([stores.branch]), BranchStore.open(stores.branch).read(1)
    commands = proposals(catalogue, 0, "1")
    assert set(commands) == {"steady", "run", "branch"}
    say(shell, commands["steady"])
    found = RunStore.open("results/here")
    assert found.scenario.values()["peclet"] == point.parameter
    assert found.read(0).observables["tension_pole"] == pytest.approx(point.observables["tension_pole"], rel=1e-8)
    say(shell, commands["branch"])
    assert open_branch("results/branch-onwards").points[0].parameter == pytest.approx(point.parameter)


def test_a_pitchfork_offers_its_other_branch_and_its_curve(shell: Shell, stores: Stores):
    fork = open_branch(stores.branch)["pitchfork-1"]
    place = next(i for i, one in enumerate(BranchStore.open(stores.branch)) if one.label == fork.label)
    commands = proposals(Catalogue([stores.branch]), 0, str(place))
    say(shell, commands["branch"])
    assert abs(open_branch("results/branch-onwards").points[-1].observables["velocity"]) > 1e-3
    say(shell, commands["curve"])
    curve = open_curve("results/curve-onwards")
    assert curve.keys == ("peclet", "turnover_rate")
    # The onset of the polar swimmer, (2 + k R0^2/D)/(c0 f'(c0)) with f' = 1/2.
    onsets = np.array([one.parameters for one in curve.points])
    assert onsets[:, 0] == pytest.approx(2.0 * (2.0 + onsets[:, 1]), rel=1e-3)


def test_a_run_goes_on_from_any_of_its_frames(shell: Shell, stores: Stores):
    commands = proposals(Catalogue([stores.run]), 0, "2")
    say(shell, commands["run"])
    first, frame = RunStore.open("results/onwards").read(0), RunStore.open(stores.run).read(2)
    assert np.array_equal(first.nodes, frame.nodes)
    assert first.observables["height"] == pytest.approx(frame.observables["height"])


def test_a_run_with_other_keys_says_them_all(tmp_path: Path):
    """A run brings no value of its own, and words are written as they are."""
    case = scenario("guided-division", peclet=333.0, parameterization="lagrangian", ring_amplitude=0.0, until=1e-3)
    made = run(case, out=tmp_path / "run")
    for text in proposals(Catalogue([made.store]), 0, "1").values():
        words = shlex.split(text)
        assert words[2] == "guided-division"
        assert {"peclet=333.0", "parameterization=lagrangian", "ring_amplitude=0.0"} <= {*words}


@pytest.mark.parametrize("name", ["run", "branch", "map"])
def test_a_store_stands_for_its_scenario(name: str, stores: Stores, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """But not for a built-in one whose name its folder has."""
    path: Path = getattr(stores, name)
    kind = {"run": RunStore, "branch": BranchStore, "map": DiagramStore}[name]
    mine = kind.open(path).scenario
    assert find_scenario(str(path)) == mine
    other = next(one for one in scenario_names() if one != mine.name)
    (tmp_path / other).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    assert find_scenario(other) == scenario(other)
    assert find_scenario(f"./{other}") == mine


def test_a_point_of_a_map_is_a_start(shell: Shell, stores: Stores):
    catalogue = Catalogue([stores.map])
    commands = proposals(catalogue, 0, "0,10,20")
    say(shell, commands["steady"])
    values = RunStore.open("results/here").scenario.values()
    keys = catalogue.answer("state", {"store": "0", "place": "0,10,20"})["parameters"]
    assert {key: values[key] for key in keys} == pytest.approx(keys, rel=1e-15)


@pytest.mark.parametrize(("store", "place"), [(0, "2"), (1, "1"), (2, "0,10,20")])
def test_python_runs(stores: Stores, store: int, place: str):
    catalogue = Catalogue([*stores])
    text = catalogue.answer("shape" if store == 2 else "state", {"store": str(store), "place": place})["python"]
    names: dict[str, Any] = {}
    exec(text, names)
    assert names["start"].frame.nodes.shape[0] > 2
    if store:
        assert names["state"].outcome == "converged"


def test_a_scenario_is_its_built_in_one_with_differences():
    given = scenario("guided-division", peclet=333.0, elements=80)
    base = scenario("guided-division")
    assert differences(given, base) == {"peclet": 333.0, "elements": 80}
    assert differences(given, base, ["peclet"]) == {"elements": 80}
    other = scenario("guided-division", active_tension=3.0)
    assert differences(other, base) == {"active_tension": 3.0}


def test_a_scenario_with_units_is_that_of_its_store(shell: Shell, tmp_path: Path):
    """Its commands give results in the same units."""
    sizes = {"length": "10 um", "energy": "1e-17 J", "time": "60 s", "concentration": "1/um^2"}
    case = scenario("polar-swimmer", peclet=30.0, elements=20, mesh_tolerance=1e-3).in_units(**sizes)
    made = branch(case, "peclet", stop=31.0, state="trivial", stability=False, out=tmp_path / "branch")
    commands = proposals(Catalogue([made.store]), 0, "1")
    assert commands["steady"].split()[2] == str(made.store)
    say(shell, commands["steady"])
    found = RunStore.open("results/here").scenario
    assert found.units == case.units
    assert found.values()["peclet"] == made.points[1].parameter
    assert found.difference(made.scenario_at(made.points[1])) is None


def test_numbers_name_records(stores: Stores):
    assert find_start(f"{stores.run}:2").frame.time == RunStore.open(stores.run).read(2).time
    assert find_start(f"{stores.map}:trivial-3").keys == ("peclet", "inverse_hydrodynamic_length")
    for text, word in (
        ("run:999", "999"),
        ("branch:999", "999"),
        ("map:trivial-99", "trivial-0"),
        ("map", "trivial-0"),
    ):
        with pytest.raises(ValueError, match=word):
            find_start(stores.run.parent / text)
