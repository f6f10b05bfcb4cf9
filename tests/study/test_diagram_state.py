"""States of a stored diagram, computed again where they are asked for."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from shapespace.analysis.sweeping import Sweep, lagrange_weights, polynomial_weights
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_numbers import DiagramNumbers
from shapespace.study.diagram_points import state_at
from shapespace.study.diagram_state import DiagramStates
from shapespace.study.diagram_store import CODES, DiagramStore
from shapespace.study.diagrams import Diagram, diagram
from shapespace.study.scenario import scenario
from shapespace.study.starts import find_start
from shapespace.study.steady import steady
from shapespace.study.tiles import sheets_again

X, Y = "peclet=80:120:76", "inverse_hydrodynamic_length=1:1.001:2"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    """Swimmers away from the onset, in four tiles."""
    case = scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)
    return diagram(case, X, Y, out=tmp_path_factory.mktemp("states") / "swimmer", workers=1)


def test_a_state_is_found_again_in_one_or_two_steps(stored: Diagram):
    """Also one beyond the middles of all tiles, where their polynomial extrapolates."""
    assert stored.converged == stored.points == 152
    for i, j in ((0, 0), (3, 1), (20, 0), (33, 1), (50, 0), (75, 1)):
        again = DiagramStates(DiagramStore.open(stored.store)).state((0, i, j))
        assert 1 <= again.found.iterations <= 2, (i, j)
        point = stored.dataset.isel(peclet=i, inverse_hydrodynamic_length=j)
        for name in ("area", "velocity", "pressure"):
            assert again.observables[name] == pytest.approx(float(point[name]), rel=1e-7), (name, i, j)


def test_a_tile_without_a_state_leaves_its_neighbours_theirs(tmp_path: Path):
    """No swimmer below its onset at 22: those above are come to by steps from the middle of their own tile."""
    case = scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)
    axes = ("peclet=10:40:12", "inverse_hydrodynamic_length=0.5:1:2")
    made = diagram(case, *axes, states=("trivial", "default"), out=tmp_path / "onset", workers=1)
    exists = made.dataset["outcome"].values == CODES[Outcome.CONVERGED]
    assert exists[0].all()
    assert exists[1].any()
    assert not exists[1].all()
    assert_found_again(made)


@pytest.fixture(scope="module")
def sheets(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    """Ellipsoids up to their fold, and the states that it joins to them, in two tiles."""
    case = scenario("guided-division", elements=20, mesh_tolerance=1e-3)
    axes = ("ring_amplitude=1.9:2.6:10", "peclet=420:425:2")
    return diagram(case, *axes, branches=2, out=tmp_path_factory.mktemp("states") / "sheets", workers=1)


def test_a_sheet_goes_on_in_the_next_tile(sheets: Diagram):
    """The fold that leads to the second sheet lies in one of them."""
    assert len(sheets.request.grid.tiles) == 2
    assert sheets.dataset["n_states"].to_numpy().tolist() == [[2] * 8 + [0] * 2] * 2
    radius = sheets.dataset["equator_radius"]
    assert (radius.sel(state="state-1") > radius.sel(state="state-2")).where(radius.notnull().all("state"), True).all()


def test_states_of_several_sheets_are_found_again_at_once(sheets: Diagram, monkeypatch: pytest.MonkeyPatch):
    """From what each tile stores, in one or two steps and without computing it again."""
    monkeypatch.setattr(
        "shapespace.study.diagram_state.sheets_again", lambda *_: pytest.fail("a tile is computed again")
    )
    store, data = DiagramStore.open(sheets.store), sheets.dataset
    for place in ((0, 2, 0), (1, 2, 0), (1, 7, 1)):
        again = DiagramStates(store).state(place)
        assert again.found.iterations <= 2
        point = data.isel(state=place[0], ring_amplitude=place[1], peclet=place[2])
        for name in ("area", "pressure", "equator_radius"):
            assert again.observables[name] == pytest.approx(float(point[name]), rel=1e-7), (name, place)


def test_without_stored_states_a_tile_is_computed_again_once(
    sheets: Diagram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Its states are then at hand for the points beside."""
    copy = Path(shutil.copytree(sheets.store, tmp_path / "copy"))
    shutil.rmtree(copy / "shapes")
    computed: list[tuple[int, int]] = []

    def counted(store: DiagramStore, number: int, tile: tuple[int, int]) -> list[Sweep]:
        computed.append(tile)
        return sheets_again(store, number, tile)

    monkeypatch.setattr("shapespace.study.diagram_state.sheets_again", counted)
    states = DiagramStates(DiagramStore.open(copy))
    for place in ((1, 2, 0), (1, 3, 1), (0, 3, 1)):
        assert states.state(place).observables["area"] == pytest.approx(
            float(sheets.dataset["area"].isel(state=place[0], ring_amplitude=place[1], peclet=place[2])), rel=1e-7
        )
    assert computed == [(0, 0)]


def test_any_point_is_a_start(sheets: Diagram):
    """As the page names it, and by the values of both keys."""
    point = sheets.dataset.isel(state=1, ring_amplitude=3, peclet=1)
    ring = float(point["ring_amplitude"])
    start = find_start(f"{sheets.store}:1,3,1")
    assert start.scenario.values()["ring_amplitude"] == ring
    assert start.placing(sheets.scenario, ()) == start.scenario
    for found in (steady(start.scenario, start=start), state_at(sheets, "state-2", ring_amplitude=ring, peclet=425.4)):
        assert found.found.iterations <= 2
        assert found.scenario.values()["peclet"] == 425.0
        assert found.observables["equator_radius"] == pytest.approx(float(point["equator_radius"]), rel=1e-8)


@pytest.mark.parametrize(
    ("place", "part"),
    [
        ("2,0,0", "which has 2 by 10 by 2"),
        ("0,1", "give STATE,I,J"),
        ("1,9,1", "has no state at this point"),
        ("state-3", "give a point of it as STATE,I,J"),
    ],
)
def test_what_is_no_point_is_no_start(sheets: Diagram, place: str, part: str):
    with pytest.raises(InputError, match=part):
        find_start(f"{sheets.store}:{place}")


@pytest.mark.parametrize(
    ("state", "values", "part"),
    [
        ("state-3", {"ring_amplitude": 2.0, "peclet": 420.0}, "state-1, state-2"),
        (None, {"ring_amplitude": 2.0}, "needs values of ring_amplitude and peclet"),
        (None, {"ring_amplitude": 2.0, "peclet": 450.0}, "peclet = 450: lies outside"),
    ],
)
def test_a_state_is_asked_for_by_its_keys(sheets: Diagram, state: str | None, values: dict[str, float], part: str):
    with pytest.raises(InputError, match=part):
        state_at(sheets, state, **values)


def test_weights_of_the_least_polynomial():
    """Exact for a bicubic on a lattice, for a plane on scattered places, and for a line where all lie on one."""
    lattice = np.array([(x, y) for x in (-2.0, -0.5, 1.0, 3.0) for y in (-1.5, 0.5, 2.0, 2.5)])
    scattered = np.random.default_rng(1).normal(size=(7, 2)) + 0.5
    line = np.array([(x, 0.7) for x in (-1.0, 0.5, 1.0)])
    for places, values in (
        (lattice, lambda x, y: 3.0 + x * y - (x * y) ** 3 + y**2),
        (scattered, lambda x, y: 3.0 + x - 2.0 * y),
        (line, lambda x, y: 3.0 + x - x**2),
    ):
        weights = polynomial_weights(places)
        assert weights @ values(*places.T) == pytest.approx(3.0, abs=1e-9)


def test_states_numbered_by_energy_are_found_again(tmp_path: Path):
    """Two of them, where the anchors of one number may lie on different sheets, but none at the onset, where both are one."""
    case = scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)
    axes = ("peclet=18:31:10", "inverse_hydrodynamic_length=0.5:1:2")
    made = diagram(case, *axes, states=("trivial", "default"), branches=2, out=tmp_path / "sheets", workers=1)
    assert len(made.dataset["state"]) == 2
    assert_found_again(made)


def assert_found_again(made: Diagram) -> None:
    """All states, with what is stored of them."""
    states, data = DiagramStates(DiagramStore.open(made.store)), made.dataset
    for number, j, i in np.argwhere(data["outcome"].values == CODES[Outcome.CONVERGED]):
        found = states.state((int(number), int(i), int(j))).observables
        for name in ("velocity", "pressure"):
            stored = float(data[name][number, j, i])
            assert abs(found[name]) == pytest.approx(abs(stored), rel=1e-6, abs=1e-7), (name, number, i, j)


def test_damaged_numbers_are_said_in_a_line(stored: Diagram, tmp_path: Path):
    copy = tmp_path / "copy"
    shutil.copytree(stored.store, copy)
    part = copy / "length" / "c" / "0" / "0"
    part.write_bytes(part.read_bytes()[:20])
    numbers = DiagramNumbers(DiagramStore.open(copy))
    assert numbers.whole("area").shape == (1, 2, 76)
    with pytest.raises(StoreError, match=r"length/c/0/0: numbers of tile 0, 0 are damaged.*--resume"):
        numbers.whole("length")
    # The first part is that of the first tile.
    with pytest.raises(StoreError, match=r"length/c/0/0: numbers of tile 0, 0 are damaged.*--resume"):
        numbers.at(0, 0, 0)
    values, damage = numbers.readable("length")
    assert len(damage) == 1
    assert "length/c/0/0: numbers of tile 0, 0" in damage[0]
    lost = np.isnan(values)
    assert np.array_equal(values[~lost], DiagramNumbers(DiagramStore.open(stored.store)).whole("length")[~lost])
    x, y = stored.request.grid.span((0, 0))
    assert lost[..., y, x].all()
    assert lost.sum() == lost[..., y, x].sum()
    assert numbers.readable("area")[1] == []


def test_numbers_of_an_unfinished_map_are_read_anew(stored: Diagram, tmp_path: Path):
    """Those of a finished one are kept."""
    for name, fields, again in (("finished", {}, False), ("running", {"outcome": None, "status": "running"}, True)):
        copy = tmp_path / name
        shutil.copytree(stored.store, copy)
        manifest = json.loads((copy / "store.json").read_text())
        (copy / "store.json").write_text(json.dumps(manifest | fields))
        numbers = DiagramNumbers(DiagramStore.open(copy))
        before = numbers.whole("length").copy()
        array: Any = zarr.open_group(copy, mode="r+")["length"]
        array[...] = before.reshape(array.shape) + 1.0
        assert np.array_equal(numbers.whole("length"), before + again)


def test_weights_reproduce_a_polynomial():
    """Of degree m - 1, at a place between the values, beyond them and at one of them."""
    for places in ([-2.0, -0.5, 1.0, 3.0], [1.0, 2.0, 4.0], [0.0, 1.0, -1.0]):
        at = np.array(places)
        values = np.polynomial.polynomial.polyval(at, np.arange(1.0, len(at) + 1.0))
        assert lagrange_weights(at) @ values == pytest.approx(1.0, abs=1e-12)
