"""States of a stored diagram, computed again where they are asked for."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from shapespace.analysis.sweeping import lagrange_weights
from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_numbers import DiagramNumbers
from shapespace.study.diagram_state import DiagramStates
from shapespace.study.diagram_store import CODES, DiagramStore
from shapespace.study.diagrams import Diagram, diagram
from shapespace.study.scenario import scenario

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


@pytest.mark.slow
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
