"""The answers that the page draws, against what is stored."""

import base64
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.app.served import MoreStores, Stores
from tests.app.stores import swimmer

from shapespace.app.catalogue import Catalogue
from shapespace.app.page import files, question, single_file
from shapespace.app.source import quantities
from shapespace.base.errors import InputError
from shapespace.study.branch_store import BranchStore, open_branch
from shapespace.study.dataset import open_dataset, profile_of
from shapespace.study.modes import find_modes
from shapespace.study.run import run
from shapespace.study.store import RunStore

KINDS = {"f8": "<f8", "f4": "<f4", "i1": "<i1"}


def array(packed: dict[str, str]) -> np.ndarray:
    ((kind, text),) = packed.items()
    return np.frombuffer(base64.b64decode(text), dtype=KINDS[kind])


def ask(catalogue: Catalogue, name: str, /, **asked: object) -> dict[str, Any]:
    return catalogue.answer(name, {key: str(value) for key, value in asked.items()})


def test_a_branch_is_told_in_its_own_order(stores: Stores):
    branch = open_branch(stores.branch)
    table = ask(Catalogue([stores.branch]), "overview", store=0)["table"]
    assert np.array_equal(array(table["columns"]["peclet"]), [point.parameter for point in branch.points])
    assert np.array_equal(array(table["columns"]["area"]), [point.observables["area"] for point in branch.points])
    named = {label: table["places"][i] for i, label in enumerate(table["labels"]) if label}
    assert named.keys() == {point.label for point in branch.special_points}
    assert len(table["segments"]) == len(branch.points) - 1
    # Stable to the pitchfork, then not.
    fork = table["labels"].index("pitchfork-1")
    assert table["segments"] == [0] * fork + [1] * (len(branch.points) - 1 - fork)


def test_profiles_and_numbers_are_those_of_the_store(stores: Stores):
    catalogue, store = Catalogue([stores.run]), RunStore.open(stores.run)
    frame = store.read(3)
    state = ask(catalogue, "state", store=0, place=3)
    assert state["observables"] == frame.observables
    assert state["time"] == frame.time
    for name, values in profile_of(store.scenario, frame).items():
        assert np.array_equal(array(state["fields"][name]), values.astype("<f4"))
    first = ask(catalogue, "state", store=0, place=0)["fields"]
    flow = open_dataset(stores.run)["tangential_velocity"].isel(time=0).to_numpy()
    assert np.array_equal(array(first["tangential_velocity"]), flow.astype("<f4"))


def test_modes_are_those_of_the_store(stores: Stores):
    catalogue, label = Catalogue([stores.branch]), "pitchfork-1"
    store = BranchStore.open(stores.branch)
    place = next(i for i, one in enumerate(store) if one.label == label)
    found, modes = ask(catalogue, "mode", store=0, place=place, index=1), find_modes(f"{stores.branch}:{label}")
    wanted = modes.profiles(1, 241)
    assert found["rate"] == modes.growth_rates[1].tolist()
    assert np.array_equal(array(found["displacement_real"]), wanted.displacement.real.astype("<f4"))
    assert wanted.regulator is not None
    assert np.array_equal(array(found["regulator_imaginary"]), wanted.regulator.imag.astype("<f4"))


def test_modes_that_are_not_stored_are_found_by_their_rates(stores: Stores):
    catalogue, place = Catalogue([stores.branch]), 1
    point = BranchStore.open(stores.branch).read(place)
    assert not len(point.modes)
    for index in (0, 3):
        found = ask(catalogue, "mode", store=0, place=place, index=index)
        assert found["rate"] == pytest.approx(point.growth_rates[index], rel=1e-5, abs=1e-5)
    with pytest.raises(InputError, match="mode 99"):
        ask(catalogue, "mode", store=0, place=place, index=99)


@pytest.mark.parametrize("name", ["folds", "forks"])
def test_points_of_curves_have_growth_rates_of_which_one_vanishes(more: MoreStores, name: str):
    """They are singular: Newton's method would not come back to them."""
    catalogue = Catalogue([getattr(more, name)])
    for place in ask(catalogue, "overview", store=0)["table"]["places"]:
        found = ask(catalogue, "spectrum", store=0, place=place)
        sizes, errors = np.linalg.norm(found["values"], axis=1), np.array(found["errors"])
        (vanishing,) = np.flatnonzero(sizes <= errors)
        assert errors[vanishing] < 1e-5
        assert found["neutral"] == {str(vanishing): "critical"}
        assert found["marginal"]
        assert found["unstable"] == 0


def test_growth_rates_of_stored_points_are_those_of_the_branch(stores: Stores):
    """Also where they are computed anew, next to a pitchfork: the sphere polarizes at the rate Pe/2 - 2 - k."""
    catalogue = Catalogue([stores.branch])
    for place, point in enumerate(BranchStore.open(stores.branch)):
        found = ask(catalogue, "spectrum", store=0, place=place)
        polarizing = min(abs(rate - (point.parameter / 2.0 - 11.0)) for rate, _ in found["values"])
        assert polarizing < 1e-6
        assert found["unstable"] == point.n_unstable


def test_the_end_of_a_run_settles_before_its_growth_rates_are_computed(tmp_path: Path):
    case = swimmer(peclet=5.0, turnover_rate=10.0, until=3.0, stationary_rate=1e-3)
    assert run(case, out=tmp_path / "run").outcome == "stationary"
    catalogue = Catalogue([tmp_path / "run"])
    last = ask(catalogue, "overview", store=0)["table"]["places"][-1]
    assert ask(catalogue, "spectrum", store=0, place=last)["values"][0] == pytest.approx(
        (5.0 / 2.0 - 12.0, 0.0), abs=1e-8
    )


def test_growth_rates_of_a_moving_surface_are_refused(stores: Stores):
    with pytest.raises(InputError, match="moves"):
        ask(Catalogue([stores.run]), "spectrum", store=0, place=1)


def test_a_map_gives_one_observable_at_a_time(stores: Stores):
    catalogue = Catalogue([stores.map])
    about = ask(catalogue, "overview", store=0)["map"]
    assert about["of"] == "velocity"
    assert len(array(about["outcomes"])) == 10_000
    values = array(ask(catalogue, "values", store=0, name="velocity")["values"]).reshape(100, 100)
    state = ask(catalogue, "state", store=0, place="0,12,34")
    assert state["observables"]["velocity"] == values[34, 12]
    shape = ask(catalogue, "shape", store=0, place="0,12,34")
    assert shape["observables"]["area"] == pytest.approx(state["observables"]["area"], rel=1e-8)
    assert array(shape["fields"]["radius"]).max() == pytest.approx(1.0, abs=1e-6)


def test_numbers_of_a_map_are_at_hand_once_it_is_warm(stores: Stores, monkeypatch: pytest.MonkeyPatch):
    catalogue = Catalogue([stores.map])
    before = ask(catalogue, "state", store=0, place="0,3,4")
    catalogue.source(0).warm()
    monkeypatch.setattr("shapespace.study.diagram_numbers.reading", None)
    assert ask(catalogue, "state", store=0, place="0,3,4") == before


def test_a_map_with_damaged_parts_is_told_without_them(more: MoreStores, tmp_path: Path):
    damaged = tmp_path / "damaged"
    shutil.copytree(more.states, damaged)
    whole = ask(Catalogue([damaged]), "overview", store=0)
    files = damaged / "curves" / "made-up" / "points" / "000001.npz", damaged / "outcome" / "c" / "0" / "0" / "0"
    for file in files:
        file.write_bytes(file.read_bytes()[:9])
    found = ask(Catalogue([damaged]), "overview", store=0)
    assert whole["damage"] == []
    assert len(found["damage"]) == 2
    assert any(str(files[0]) in one for one in found["damage"])
    assert any(f"{files[1]}: numbers of tile 0, 0" in one for one in found["damage"])
    assert [one["of"] for one in found["map"]["boundaries"]] == [one["of"] for one in whole["map"]["boundaries"]]
    assert not array(found["map"]["outcomes"]).any()


def test_what_cannot_be_read_of_a_run_is_named(stores: Stores, tmp_path: Path):
    """Also its last frame, one that is missing, and the one that the flow at the beginning comes from."""
    damaged = tmp_path / "damaged"
    shutil.copytree(stores.run, damaged)
    frames = sorted((damaged / "frames").iterdir())
    frames[2].unlink()
    for frame in (frames[1], frames[-1]):
        frame.write_bytes(b"")
    catalogue = Catalogue([damaged])
    overview = ask(catalogue, "overview", store=0)
    assert [frame.name in one for one, frame in zip(overview["damage"], (*frames[1:3], frames[-1]), strict=True)] == [
        True
    ] * 3
    assert len(overview["table"]["places"]) == len(frames) - 3
    first = ask(catalogue, "state", store=0, place=0)["fields"]
    assert "radius" in first
    assert "tangential_velocity" not in first


def test_quantities_come_with_the_change_that_counts_as_none(stores: Stores):
    """Flows as in the words about arrows, in the units of the store; keys, times and errors are small by nature."""
    sizes = {"length": "10 um", "energy": "1e-17 J", "time": "60 s", "concentration": "1/um^2"}
    case = swimmer().in_units(**sizes)
    told = quantities(case)
    assert told["velocity"][2:] == ["μm/s", pytest.approx(1e-5 * case.scales.factor("velocity"))]
    assert told["tangential_velocity"][3] == told["velocity"][3]
    assert told["area"][2:] == ["μm^2", pytest.approx(1e-8 * case.scales.factor("area"))]
    assert {told[name][3] for name in ("time", "peclet", "seed_amplitude", "discretisation_error")} == {0.0}
    assert ask(Catalogue([stores.map]), "overview", store=0)["at_rest"] == 1e-5


def test_one_file_names_every_module_and_no_address():
    page = single_file({question("stores"): {"stores": []}}).decode()
    for name in files():
        if name.endswith(".js"):
            assert f'"@{name}"' in page
    assert "<!-- linked -->" not in page
    assert " src=" not in page
    assert "http:" not in page.partition('<script type="importmap">')[0]
