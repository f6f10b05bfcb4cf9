"""Diagrams: states over two keys against single solves and exact onsets; stores, resuming, workers and their deaths."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import dask_jobqueue
import distributed
import numpy as np
import pytest
import xarray as xr
from docs.executed import blocks_of

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_store import CODES, Diagram, DiagramStore, open_diagram
from shapespace.study.diagrams import diagram
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.steady import steady
from shapespace.study.tiles import Done, compute_tile
from shapespace.study.workers import Workers
from shapespace.view.diagram import plot_diagram

X, Y = "peclet=18:40:12", "inverse_hydrodynamic_length=0.5:5:10"
ONSET = 22.0
"""(2 + k R0^2/D)/(c0 f'(c0)) of the polar swimmer."""


def swimmer() -> Scenario:
    return scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    """Spheres and swimmers around the onset."""
    out = tmp_path_factory.mktemp("diagrams") / "swimmer"
    return diagram(swimmer(), X, Y, states=("trivial", "default"), out=out, workers=1)


def test_states_exist_where_they_should(stored: Diagram):
    """The sphere everywhere, the swimmer above its pitchfork, and there with the polarity of one side."""
    data = stored.dataset
    assert data["outcome"].dims == ("state", "inverse_hydrodynamic_length", "peclet")
    exists = data["outcome"] == CODES[Outcome.CONVERGED]
    assert exists.sel(state="trivial").all()
    assert (exists.sel(state="default") == (data["peclet"] > ONSET)).all()
    assert abs(data["velocity"].sel(state="trivial")).max() < 1e-9
    speed = data["velocity"].sel(state="default").where(data["peclet"] > ONSET, drop=True)
    assert (speed < -0.5).all() or (speed > 0.5).all()
    assert (abs(speed).diff("peclet") > 0.0).all()
    assert (data["correction"].fillna(0.0) < 1e-8).all()
    assert stored.points == 240
    assert stored.converged == 120 + 10 * int((data["peclet"] > ONSET).sum())
    assert len(stored.failed) == stored.points - stored.converged
    assert {one["outcome"] for one in stored.failed} <= {"no-state", "not-reached"}
    assert {"peclet", "inverse_hydrodynamic_length", "state", "outcome", "reason"} == stored.failed[0].keys()


def test_states_are_those_of_single_solves(stored: Diagram):
    data = stored.dataset.sel(state="default")
    for i, j in ((11, 9), (4, 0), (3, 5)):
        point = data.isel(peclet=i, inverse_hydrodynamic_length=j)
        keys = {name: float(point[name]) for name in stored.request.grid.keys}
        single = steady(stored.scenario.with_overrides(keys)).observables
        for name in ("area", "bending_energy", "pressure", "dissipation", "length"):
            assert float(point[name]) == pytest.approx(single[name], rel=1e-6), name
        assert abs(float(point["velocity"])) == pytest.approx(abs(single["velocity"]), rel=1e-6)


def test_a_store_describes_itself(stored: Diagram):
    data = xr.open_zarr(stored.store)
    assert data["velocity"].attrs == {"long_name": "axial swimming speed", "symbol": "v0", "units": "R0/tau"}
    assert data.attrs["parameters"]["turnover_rate"] == 9.0
    assert data.attrs["versions"]["shapespace"]
    assert data["outcome"].attrs["flag_meanings"].split()[CODES[Outcome.CONVERGED]] == "converged"
    assert data["peclet"].to_numpy() == pytest.approx(np.linspace(18.0, 40.0, 12))
    assert open_diagram(stored.store).request == stored.request


def test_growing_modes(tmp_path: Path):
    """The sphere's l = 1 mode grows above the onset, nothing grows of the swimmer."""
    axes = ("peclet=19:25:4", "inverse_hydrodynamic_length=1:2:2")
    found = diagram(swimmer(), *axes, states=("trivial", "default"), stability=True, out=tmp_path / "d", workers=1)
    growing = found.dataset["n_unstable"]
    assert growing.sel(state="trivial").to_numpy().tolist() == [[0, 0, 1, 1]] * 2
    assert np.nan_to_num(growing.sel(state="default"), nan=-1).tolist() == [[-1, -1, 0, 0]] * 2


def test_a_lost_tile_is_computed_again_the_same(stored: Diagram):
    told: list[Done] = []
    before = stored.dataset.copy(deep=True)
    (lost,) = [one for one in (stored.store / "outcome").rglob("*") if one.match("c/0/1/0")]
    lost.unlink()
    assert DiagramStore.open(stored.store).missing_tiles == [(0, 1)]
    arguments = {"states": ("trivial", "default"), "out": stored.store, "workers": 1, "resume": True}
    again = diagram(swimmer(), X, Y, progress=told.append, **arguments)
    assert [one.tile for one in told] == [(0, 1)]
    xr.testing.assert_identical(again.dataset, before)
    diagram(swimmer(), X, Y, progress=told.append, **arguments)
    assert len(told) == 1


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"x": "peclet=18:41:12"}, "x is peclet=18:40:12, not peclet=18:41:12"),
        ({"states": ("default",)}, "states is"),
        ({"scenario": swimmer().with_overrides({"turnover_rate": 8.0})}, "turnover_rate is 9.0, not 8.0"),
    ],
)
def test_another_diagram_is_not_continued(stored: Diagram, changes: dict[str, object], part: str):
    before = {path: path.stat().st_mtime_ns for path in stored.store.rglob("*")}
    arguments = {"scenario": swimmer(), "x": X, "y": Y, "states": ("trivial", "default"), "workers": 1} | changes
    with pytest.raises(StoreError, match="resume with the same") as complaint:
        diagram(**arguments, out=stored.store, resume=True)
    assert part in str(complaint.value)
    assert before == {path: path.stat().st_mtime_ns for path in stored.store.rglob("*")}


ACROSS = ("peclet=17.5:40:18", "turnover_rate=7:13:9")


@pytest.fixture(scope="module")
def adaptive(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    """Spheres and swimmers again, only where they change in kind."""
    out = tmp_path_factory.mktemp("diagrams") / "adaptive"
    return diagram(swimmer(), *ACROSS, states=("trivial", "default"), adaptive=True, out=out, workers=1)


def test_an_adaptive_map_is_the_same_at_fewer_points(adaptive: Diagram, tmp_path: Path):
    """Every point is of the same kind as where all are computed; observables are those of computed points, others have none."""
    whole = diagram(swimmer(), *ACROSS, states=("trivial", "default"), out=tmp_path / "d", workers=1)
    one, other = adaptive.dataset, whole.dataset
    xr.testing.assert_equal(one["regime"], other["regime"])
    is_inferred = one["outcome"] == CODES[Outcome.INFERRED]
    exists = other["outcome"] == CODES[Outcome.CONVERGED]
    assert ((one["outcome"] == CODES[Outcome.CONVERGED]) == exists.where(~is_inferred, False)).all()
    for name in ("area", "bending_energy", "velocity", "correction"):
        assert one[name].isnull().where(is_inferred, True).all()
    for name in ("area", "bending_energy", "length"):
        assert np.nanmax(np.abs(one[name] / other[name] - 1.0)) < 1e-7, name
    assert one["area"].notnull().sum() == adaptive.converged
    computed = {*zip(*np.nonzero(~is_inferred.to_numpy()), strict=True)}
    assert len(computed) == adaptive.points - adaptive.inferred == adaptive.converged + len(adaptive.failed)
    assert adaptive.inferred > 0.2 * adaptive.points
    assert whole.inferred == 0


def test_an_adaptive_map_is_continued_the_same(adaptive: Diagram):
    before = adaptive.dataset.copy(deep=True)
    told: list[Done] = []
    arguments = {"states": ("trivial", "default"), "out": adaptive.store, "workers": 1, "resume": True}
    (lost,) = [one for one in (adaptive.store / "outcome").rglob("*") if one.match("c/0/0/1")]
    lost.unlink()
    with pytest.raises(StoreError, match="adaptive is True, not none"):
        diagram(swimmer(), *ACROSS, **arguments)
    again = diagram(swimmer(), *ACROSS, adaptive=True, progress=told.append, **arguments)
    xr.testing.assert_identical(again.dataset, before)
    assert [one.tile for one in told] == [(1, 0)]
    assert told[0].inferred == int((before["outcome"].isel(peclet=slice(9, None)) == CODES[Outcome.INFERRED]).sum())


def test_an_adaptive_map_draws_its_regimes(adaptive: Diagram):
    named = [text.get_text() for text in plot_diagram(adaptive).legends[0].get_texts()]
    assert named == ["symmetric, resting", "symmetric & asymmetric, resting & swimming"]
    plot_diagram(adaptive, "velocity")


def test_searches_find_what_no_fold_connects(tmp_path: Path):
    """Swimmers leave the sphere at a pitchfork, which no sheet of spheres leads over; what is asked for is stored."""
    axes, choices = ("peclet=24:30:3", "turnover_rate=8:9:2"), {"states": ("trivial",), "branches": 2, "workers": 1}
    alone = diagram(swimmer(), *axes, out=tmp_path / "alone", **choices)
    found = diagram(swimmer(), *axes, deflate=1, out=tmp_path / "searched", **choices)
    assert (alone.dataset["n_states"] == 1).all()
    assert (found.dataset["n_states"] == 2).all()
    speeds = abs(found.dataset["velocity"])
    assert ((speeds > 0.5).sum("state") == 1).all()
    assert found.request.deflate == 1
    assert open_diagram(found.store).request == found.request
    with pytest.raises(StoreError, match="deflate is 1, not 2"):
        diagram(swimmer(), *axes, deflate=2, out=found.store, resume=True, **choices)


def test_no_state_at_all_says_so(tmp_path: Path):
    found = diagram(swimmer(), "peclet=5:10:2", "inverse_hydrodynamic_length=1:2:2", out=tmp_path / "d", workers=1)
    assert found.converged == 0
    assert [one["outcome"] for one in found.failed] == ["no-state"] * 4


def without(stored: Diagram, out: Path, tiles: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Copy a store and take some tiles out of it; these."""
    shutil.copytree(stored.store, out)
    for i, j in tiles:
        for chunk in [*out.rglob(f"c/0/{j}/{i}")]:
            chunk.unlink()
    missing = DiagramStore.open(out).missing_tiles
    assert sorted(missing) == sorted(tiles)
    return missing


def assert_same(out: Path, stored: Diagram) -> None:
    one, other = open_diagram(out).dataset, stored.dataset
    for name in other.data_vars:
        if name != "iterations":  # from a start as good as converged, round-off decides whether one is enough
            np.testing.assert_allclose(one[name], other[name], rtol=1e-9, atol=1e-9, err_msg=str(name))


def test_workers_give_the_same_map_and_may_be_killed(stored: Diagram, tmp_path: Path):
    """A killed worker's tile is computed by another; no process is left."""
    tiles = without(stored, tmp_path / "d", [(0, 1), (1, 0), (1, 1)])
    done: list[Done] = []
    with Workers(2) as workers:
        for one in workers.map(tmp_path / "d", tiles):
            if not done:
                os.kill(workers.pids[0], signal.SIGKILL)
            done.append(one)
        pids = workers.pids
    assert sorted(one.tile for one in done) == sorted(tiles)
    assert pids
    assert not [pid for pid in pids if Path(f"/proc/{pid}").exists()]
    assert_same(tmp_path / "d", stored)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stored", "adaptive"])
def test_a_killed_client_leaves_no_process_and_loses_nothing(name: str, request: pytest.FixtureRequest, tmp_path: Path):
    known: Diagram = request.getfixturevalue(name)
    out = tmp_path / "d"
    axes = known.request.grid.x, known.request.grid.y
    command = [sys.executable, "-m", "shapespace", "diagram", "polar-swimmer", "-s", "elements=20", "mesh_tolerance=1e-3",
               "-x", str(axes[0]), "-y", str(axes[1]), "--state", "trivial,default", "--workers", "2", "--out", str(out),
               *(["--adaptive"] if known.request.adaptive else [])]  # fmt: skip
    client = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 240.0
    while not (finished := [path for path in (out / "outcome" / "c").rglob("*") if path.is_file()]):
        assert client.poll() is None, "it ended by itself"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    children = [int(pid) for pid in Path(f"/proc/{client.pid}/task/{client.pid}/children").read_text().split()]
    assert len(children) == 2
    client.send_signal(signal.SIGKILL)
    client.wait()
    while any(Path(f"/proc/{pid}").exists() for pid in children):
        assert time.monotonic() < deadline, "a worker survives"
        time.sleep(0.05)
    missing = DiagramStore.open(out).missing_tiles
    assert len(missing) <= 4 - len(finished)
    times = {path: path.stat().st_mtime_ns for path in finished}
    diagram(
        swimmer(),
        *axes,
        states=("trivial", "default"),
        adaptive=known.request.adaptive,
        out=out,
        workers=1,
        resume=True,
    )
    assert times == {path: path.stat().st_mtime_ns for path in finished}
    assert_same(out, known)


def test_a_cluster_gives_the_same_map(stored: Diagram, tmp_path: Path):
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    tiles, done = without(stored, tmp_path / "d", [(0, 1), (1, 1)]), list[Done]()
    with distributed.LocalCluster(**options) as cluster:
        choices = {"states": ("trivial", "default"), "resume": True, "progress": done.append}
        diagram(swimmer(), X, Y, out=tmp_path / "d", dask=cluster.scheduler_address, **choices)
    assert sorted(one.tile for one in done) == sorted(tiles)
    assert_same(tmp_path / "d", stored)


def slurm_cluster(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The cluster of the page on maps, which submits nothing."""
    monkeypatch.setattr(dask_jobqueue.SLURMCluster, "scale", lambda self, jobs: None)
    page = Path(__file__).parents[2] / "docs" / "how-to" / "map-shape-space.md"
    (block,) = [one.text for one in blocks_of(page) if "SLURMCluster" in one.text]
    names: dict[str, Any] = {}
    exec(block, names)
    return names["cluster"]


def test_the_job_script_for_slurm(monkeypatch: pytest.MonkeyPatch):
    """One core, memory and time as asked for, one thread, and a worker of this interpreter for this scheduler."""
    with slurm_cluster(monkeypatch) as cluster:
        lines = cluster.job_script().splitlines()
        address = cluster.scheduler_address
    assert lines[0].startswith("#!/")
    assert {"#SBATCH -n 1", "#SBATCH --cpus-per-task=1", "#SBATCH -t 01:00:00"} <= {*lines}
    assert "export OMP_NUM_THREADS=1 NPROC=1" in lines
    assert [line for line in lines if re.fullmatch(r"#SBATCH --mem=[12]G", line)]
    (start,) = [line for line in lines if "dask_worker" in line]
    assert start.startswith(f"{sys.executable} -m distributed.cli.dask_worker {address} ")
    assert "--nthreads 1" in start


@pytest.mark.slow
def test_a_job_of_the_script_computes_a_map(stored: Diagram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What SLURM would start on a node, started here."""
    with slurm_cluster(monkeypatch) as cluster:
        script = tmp_path / "job.sh"
        script.write_text(cluster.job_script())
        job = subprocess.Popen(["bash", str(script)], cwd=tmp_path, start_new_session=True)
        try:
            axes, address = (X, Y), cluster.scheduler_address
            diagram(swimmer(), *axes, states=("trivial", "default"), out=tmp_path / "d", dask=address)
        finally:
            os.killpg(job.pid, signal.SIGKILL)
            job.wait()
    assert_same(tmp_path / "d", stored)


def test_a_worker_meets_no_store(tmp_path: Path):
    with pytest.raises(StoreError, match="is not a directory"):
        compute_tile(tmp_path / "none", (0, 0))


@pytest.mark.parametrize(
    ("x", "part"),
    [
        ("peclet", "must be KEY=FROM:TO:COUNT"),
        ("peclet=1:b:3", "FROM and TO must be numbers"),
        ("peclet=1:2:2.5", "COUNT must be a whole number"),
        ("peclet=30:20:5", "must run upwards"),
        ("peclet=20:20:5", "must run upwards"),
        ("peclet=20:inf:5", "must run between finite numbers"),
        ("peclet=20:30:1", "must have 2 to"),
        ("pecelt=20:30:5", "peclet"),
        ("elements=20:30:5", "elements"),
        ("turnover_rate=-1:3:4", "turnover_rate"),
        ("friction=1:3:4", "varies the same as -x"),
    ],
)
def test_bad_axes_are_refused(tmp_path: Path, x: str, part: str):
    with pytest.raises(InputError, match=re.escape(part)):
        diagram(swimmer(), x, Y, out=tmp_path / "d", workers=1)
    assert not (tmp_path / "d").exists()


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ({"workers": 0}, "--workers 0"),
        ({"workers": 2, "dask": "tcp://127.0.0.1:9"}, "give only one"),
        ({"states": ()}, "must name different states"),
        ({"states": ("default", "default")}, "must name different states"),
        ({"states": ("upside-down",)}, "upside-down"),
        ({"adaptive": True, "branches": 2}, "--adaptive and --branches 2"),
        ({"deflate": 2}, "--deflate 2: adds states to those of --branches N"),
        ({"branches": 2, "deflate": 65}, "--deflate 65: must be 1 to 64"),
    ],
)
def test_bad_requests_are_refused(tmp_path: Path, arguments: dict[str, object], part: str):
    with pytest.raises(InputError, match=re.escape(part)):
        diagram(swimmer(), X, Y, out=tmp_path / "d", **arguments)
    assert not (tmp_path / "d").exists()
