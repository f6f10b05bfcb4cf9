"""The answers that the page draws, against what is stored."""

import base64
from typing import Any

import numpy as np
import pytest
from tests.app.served import Stores

from shapespace.app.catalogue import Catalogue
from shapespace.app.page import files, question, single_file
from shapespace.base.errors import InputError
from shapespace.study.branch_store import BranchStore, open_branch
from shapespace.study.dataset import open_dataset, profile_of
from shapespace.study.modes import find_modes
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


def test_one_file_names_every_module_and_no_address():
    page = single_file({question("stores"): {"stores": []}}).decode()
    for name in files():
        if name.endswith(".js"):
            assert f'"@{name}"' in page
    assert "<!-- linked -->" not in page
    assert " src=" not in page
    assert "http:" not in page.partition('<script type="importmap">')[0]
