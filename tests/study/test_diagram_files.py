"""The files of a diagram: there whole or not at all at any instant, read while it is computed, mended where they are damaged."""

import json
import resource
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study import diagram_store
from shapespace.study.diagram_numbers import DiagramNumbers
from shapespace.study.diagram_store import CODES, Diagram, DiagramStore, open_diagram
from shapespace.study.diagrams import diagram, make_request
from shapespace.study.grid import Axis, Grid
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.tiles import Done, observable_names

X, Y = "peclet=24:40:10", "inverse_hydrodynamic_length=1:2:2"
"""In two tiles."""


def swimmer() -> Scenario:
    return scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    return diagram(swimmer(), X, Y, out=tmp_path_factory.mktemp("maps") / "whole", workers=1)


@pytest.fixture
def copy(whole: Diagram, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole.store, tmp_path / "copy"))


def resumed(out: Path) -> list[tuple[int, int]]:
    """The tiles that are computed."""
    done: list[Done] = []
    diagram(swimmer(), X, Y, out=out, workers=1, resume=True, progress=done.append)
    return [one.tile for one in done]


KILLED = """
import os, signal, sys
from pathlib import Path
from shapespace.study import diagram_arrays, files, records
from shapespace.study.diagram_store import DiagramRequest, DiagramStore
from shapespace.study.grid import Axis, Grid
from shapespace.study.scenario import scenario

case = scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)
request = DiagramRequest(Grid(*(Axis.read(one, "-x") for one in sys.argv[2:4])), ("default",), False)
written = files.write_atomically

for number in [*range(4), *range(4, 100, 6)]:
    if (pid := os.fork()) == 0:
        left = [number]

        def write(path, data):
            if left[0] == 0:
                path.with_name(f"{path.name}.tmp").write_bytes(data[: len(data) // 2])
                os.kill(os.getpid(), signal.SIGKILL)
            left[0] -= 1
            written(path, data)

        records.write_atomically = diagram_arrays.write_atomically = write
        DiagramStore.create(Path(sys.argv[1]) / str(number), case, request, sys.argv[4:])
        os._exit(0)
    if os.waitpid(pid, 0)[1] == 0:
        break
"""
"""Makes stores in forked processes, killed with the first file half written, with a later one, and so on until one survives."""


def test_killed_while_the_store_is_made(whole: Diagram, tmp_path: Path):
    """Whichever file it was at: there is a whole Zarr store or none, and the diagram is resumed, or begun, to the same map."""
    names = [*observable_names(swimmer(), whole.request.grid.keys)]
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), X, Y, *names], check=True)
    made = sorted(tmp_path.iterdir(), key=lambda path: int(path.name))
    assert int(made[-1].name) > len(names)
    for out in made[:-1]:
        assert not (out / "zarr.json").exists()
    xr.testing.assert_equal(xr.open_zarr(made[-1]), open_diagram(made[-1]).dataset)
    for out in made:
        request = whole.request
        begin = DiagramStore.resume if (out / "store.json").exists() else DiagramStore.create
        begin(out, swimmer(), request, names).close()
        data = open_diagram(out).dataset
        assert {*data.variables} == {*whole.dataset.variables}
        np.testing.assert_array_equal(data["peclet"], whole.dataset["peclet"])
        assert data.attrs["parameters"] == whole.dataset.attrs["parameters"]
        assert not [*out.rglob("*.tmp")]
    assert len(resumed(made[len(made) // 2])) == 2
    xr.testing.assert_equal(open_diagram(made[len(made) // 2]).dataset, whole.dataset)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """No file may have more bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("size", [300, 8000, 30_000])
def test_no_room_for_a_new_store(tmp_path: Path, size: int):
    """Nothing is left of it, so that the same command may begin anew."""
    (tmp_path / "empty").mkdir()
    grid = Grid(*(Axis.read(one, "-x") for one in (X, Y)))
    request = make_request(swimmer(), grid, ("default",), stability=False)
    names = observable_names(swimmer(), grid.keys)
    for out in (tmp_path / "new" / "map", tmp_path / "empty"):
        with largest_file(size), pytest.raises(StoreError, match="cannot be read or written"):
            DiagramStore.create(out, swimmer(), request, names)
        assert [path.name for path in tmp_path.rglob("*")] == ["empty"]
        DiagramStore.create(out, swimmer(), request, names).close()
        shutil.rmtree(out)
        (tmp_path / "empty").mkdir(exist_ok=True)
        shutil.rmtree(tmp_path / "new", ignore_errors=True)


def test_a_map_is_readable_at_any_moment(tmp_path: Path):
    """From the moment it is there: what is marked as a state has its numbers."""
    out, is_over, seen, faults = tmp_path / "d", threading.Event(), list[int](), list[str]()

    def look() -> None:
        while not is_over.is_set():
            if (out / "zarr.json").exists():
                data = xr.open_zarr(out).load()
                is_state = data["outcome"] == CODES[Outcome.CONVERGED]
                seen.append(int(is_state.sum()))
                if bool((is_state & data["area"].isnull()).any()):
                    faults.append("a state without numbers")

    watcher = threading.Thread(target=look)
    watcher.start()
    try:
        diagram(swimmer(), X, Y, out=out, workers=1)
    finally:
        is_over.set()
        watcher.join()
    assert not faults
    assert len(seen) > 1
    assert seen == sorted(seen)


def test_a_session_is_entered_before_its_first_tile(copy: Path):
    (copy / "outcome" / "c" / "0" / "1").unlink()

    def stop(_: Done) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagram(swimmer(), X, Y, out=copy, workers=1, resume=True, progress=stop)
    manifest = DiagramStore.open(copy).manifest
    assert [one["versions"] for one in manifest["resumed"]] == [manifest["versions"]]
    assert manifest["status"] == "running"
    assert resumed(copy) == []
    assert len(DiagramStore.open(copy).manifest["resumed"]) == 2
    assert resumed(copy) == []
    assert len(DiagramStore.open(copy).manifest["resumed"]) == 2


def test_another_version_does_not_go_on(copy: Path, monkeypatch: pytest.MonkeyPatch):
    before = {path: path.stat().st_mtime_ns for path in copy.rglob("*")}
    monkeypatch.setattr(diagram_store, "own_version", lambda: "9.9.9")
    with pytest.raises(StoreError, match=r"was begun by shapespace .*, this is 9\.9\.9; resume with that version"):
        resumed(copy)
    assert before == {path: path.stat().st_mtime_ns for path in copy.rglob("*")}


@pytest.mark.parametrize(
    ("part", "tiles"),
    [
        ("area/c/0/1", [(1, 0)]),
        ("outcome/c/0/0", [(0, 0)]),
        ("shapes/000001.npz", [(1, 0)]),
        ("peclet/c/0", []),
        ("zarr.json", []),
    ],
)
def test_a_damaged_part_is_named_and_computed_again(
    whole: Diagram, copy: Path, part: str, tiles: list[tuple[int, int]]
):
    data = (copy / part).read_bytes()
    (copy / part).write_bytes(data[:10])
    if not part.startswith("shapes"):
        with pytest.raises(StoreError, match=r"(damaged|missing).*resume") as complaint:
            _ = open_diagram(copy).dataset
        assert part.startswith("peclet") or str(copy / part) in str(complaint.value)
    assert resumed(copy) == tiles
    xr.testing.assert_equal(open_diagram(copy).dataset, whole.dataset)
    assert (copy / part).read_bytes() == data


def test_a_changed_byte_is_damage(copy: Path):
    """Numbers have check sums."""
    part = copy / "velocity" / "c" / "0" / "0"
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    numbers = DiagramNumbers(DiagramStore.open(copy))
    with pytest.raises(StoreError, match=r"velocity/c/0/0: numbers of tile 0, 0 are damaged"):
        numbers.at(0, 0, 0)


def test_what_was_killed_in_the_writing_is_removed(copy: Path):
    left = copy / "area" / "c" / "0" / "0.0123456789abcdef.partial"
    left.write_bytes(b"half a chunk")
    assert resumed(copy) == []
    assert not left.exists()


def test_what_differs_is_named_as_it_was_given(copy: Path):
    """Also where it stands for another key, and with all that differs of the request."""
    with pytest.raises(StoreError, match=r"whose peclet is 100\.0, not 30\.0; resume with"):
        diagram(swimmer().with_overrides({"peclet": 30.0}), X, Y, out=copy, workers=1, resume=True)
    with pytest.raises(
        StoreError, match=r"whose turnover_rate is 9\.0, not 8\.0 and x is peclet=24:40:10, not peclet=24:"
    ):
        diagram(
            swimmer().with_overrides({"turnover_rate": 8.0}), "peclet=24:41:10", Y, out=copy, workers=1, resume=True
        )


@pytest.mark.parametrize(
    ("x", "part"),
    [
        ("elements=20:30:3", "-x elements=20:30:3: elements belongs to the computation, while maps vary parameters"),
        ("height=1:2:3", "-x height=1:2:3: height is an observable, while maps vary parameters of the model"),
    ],
)
def test_what_is_no_parameter_says_what_it_is(tmp_path: Path, x: str, part: str):
    with pytest.raises(InputError) as complaint:
        diagram(swimmer(), x, Y, out=tmp_path / "d", workers=1)
    assert str(complaint.value).startswith(part)


def test_the_manifest_tells_what_was_asked(whole: Diagram):
    about = json.loads((whole.store / "store.json").read_text())
    assert about["diagram"]["x"] == {"key": "peclet", "start": 24.0, "stop": 40.0, "count": 10}
    assert DiagramStore.open(whole.store).request == whole.request
