"""Whatever is lost while a diagram is computed, in real processes: it resumes, keeps what is finished, and ends the same."""

import json
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.study.test_diagram_cluster import OWN

from shapespace.analysis import sweeping
from shapespace.analysis.stationary import Stationary
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError, StoreError, WorkerError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractProblem
from shapespace.numerics.newton import Root
from shapespace.study.diagram_store import Diagram, DiagramStore, open_diagram
from shapespace.study.diagrams import diagram
from shapespace.study.plugins import import_file
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.tiles import Done
from shapespace.study.workers import MAX_DEATHS, Workers

X, Y = "peclet=24:40:10", "inverse_hydrodynamic_length=0.5:5:10"
SETTINGS = {"elements": 20, "mesh_tolerance": 1e-3}
SECONDS = 400.0
"""After which a test has failed: minutes on a busy machine."""


def swimmer() -> Scenario:
    return scenario("polar-swimmer", **SETTINGS)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    return diagram(swimmer(), X, Y, out=tmp_path_factory.mktemp("maps") / "whole", workers=1)


def begun(whole: Diagram, out: Path) -> Path:
    """A store of the same diagram with its anchors and no tile."""
    names = [str(name) for name in whole.dataset.data_vars]
    names = [name for name in names if name not in ("outcome", "regime", "correction", "iterations", "elements")]
    with DiagramStore.create(out, whole.scenario, whole.request, names) as store:
        for anchors in DiagramStore.open(whole.store):
            store.append(anchors)
    return out


def resumed(out: Path, **choices: object) -> list[Done]:
    """Compute what is missing; the tiles that this took."""
    done: list[Done] = []
    diagram(swimmer(), X, Y, out=out, resume=True, progress=done.append, **{"workers": 1, **choices})
    return done


def assert_same(out: Path, whole: Diagram) -> None:
    """The maps are equal: all outcomes, all observables."""
    found = open_diagram(out)
    assert found.request == whole.request
    assert {*found.dataset.data_vars} == {*whole.dataset.data_vars}
    for name in whole.dataset.data_vars:
        if name != "iterations":  # from a start as good as converged, round-off decides whether one is enough
            np.testing.assert_allclose(
                found.dataset[name], whole.dataset[name], rtol=1e-9, atol=1e-9, err_msg=str(name)
            )


def chunks(out: Path) -> dict[Path, int]:
    """When the chunk that marks a tile as done was written, for each that is."""
    return {path: path.stat().st_mtime_ns for path in (out / "outcome" / "c").rglob("*") if path.is_file()}


def test_a_point_that_never_converges(undisturbed: Diagram, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """It is stored with the reason, is not tried again, and all others are what they were."""
    at = undisturbed.request.grid.values(6, 7).reshape(2)
    solved, stepped = sweeping.solve_root, sweeping.step_to

    def stubborn(problem: AbstractProblem, x: Array, p: Array, *rest: Any) -> Root:
        root = solved(problem, x, p, *rest)
        return replace(root, outcome=Outcome.MAX_ITERATIONS) if np.array_equal(p, at) else root

    def nowhere(start: Stationary, p: Array, *rest: Any) -> Stationary:
        found = stepped(start, p, *rest)
        return replace(found, outcome=Outcome.NOT_REACHED) if np.array_equal(p, at) else found

    monkeypatch.setattr(sweeping, "solve_root", stubborn)
    monkeypatch.setattr(sweeping, "step_to", nowhere)
    assert len(resumed(begun(undisturbed, tmp_path / "d"))) == 4
    assert not resumed(tmp_path / "d")
    found = open_diagram(tmp_path / "d")
    ((x, y),) = [(one["peclet"], one["inverse_hydrodynamic_length"]) for one in found.failed]
    assert (x, y) == tuple(at)
    assert found.failed[0]["outcome"] == "not-reached"
    assert (found.points, found.converged) == (100, 99)
    others = np.ones((10, 10), bool)
    others[7, 6] = False
    for name in ("velocity", "polarity", "area", "outcome"):
        mine, theirs = (one.dataset[name].to_numpy()[others] for one in (found, undisturbed))
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-9, err_msg=name)


@contextmanager
def limited(workers: Workers, limit: int, value: int, most: int) -> Iterator[set[int]]:
    """Give the first `most` worker processes a limit of a resource as soon as they are there."""
    met, is_over = set[int](), threading.Event()

    def watch() -> None:
        while not is_over.wait(0.005):
            for pid in workers.pids:
                if pid not in met and len(met) < most:
                    met.add(pid)
                    with suppress(ProcessLookupError):
                        resource.prlimit(pid, limit, (value, value))

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield met
    finally:
        is_over.set()
        watcher.join()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="limits of other processes are Linux's")
def test_a_node_out_of_memory(undisturbed: Diagram, tmp_path: Path):
    """A process that gets no more memory dies; another takes its tile. Where none gets any the command gives up, and resumes."""
    out, memory = begun(undisturbed, tmp_path / "d"), 64 * 2**20
    tiles = DiagramStore.open(out).missing_tiles
    with Workers(2) as workers, limited(workers, resource.RLIMIT_AS, memory, most=99) as starved:
        with pytest.raises(WorkerError, match="perhaps of too little memory; nothing finished is lost"):
            list(workers.map(out, tiles))
        assert len(starved) >= MAX_DEATHS
    assert DiagramStore.open(out).missing_tiles == tiles
    with Workers(2) as workers, limited(workers, resource.RLIMIT_AS, memory, most=1) as starved:
        done = [one.tile for one in workers.map(out, tiles)]
    assert len(starved) == 1
    assert sorted(done) == sorted(tiles)
    assert_same(out, undisturbed)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="limits of other processes are Linux's")
def test_a_disk_that_takes_no_more(undisturbed: Diagram, tmp_path: Path):
    """Chunks of more than some bytes cannot be written: the command says so, no tile counts as done, and it resumes."""
    out = begun(undisturbed, tmp_path / "d")
    tiles = DiagramStore.open(out).missing_tiles
    with (
        Workers(2) as workers,
        limited(workers, resource.RLIMIT_FSIZE, 100, most=99),
        pytest.raises(StoreError, match="cannot be read or written"),
    ):
        list(workers.map(out, tiles))
    written = [path for path in out.rglob("*") if path.is_file() and "c" in path.parts]
    assert written, "no chunk was written before the disk was full: nothing is tested"
    assert DiagramStore.open(out).missing_tiles == tiles
    assert open_diagram(out).converged == 0
    assert sorted(one.tile for one in resumed(out)) == sorted(tiles)
    assert_same(out, undisturbed)
    assert not [path for path in out.rglob("*") if "tmp" in path.name or "partial" in path.name]


def command(out: Path) -> list[str]:
    """That computes on with two processes."""
    return [sys.executable, "-m", "shapespace", "diagram", "polar-swimmer", "-s",
            *(f"{key}={value}" for key, value in SETTINGS.items()), "-x", X, "-y", Y, "--workers", "2",
            "--out", str(out), "--resume"]  # fmt: skip


def test_a_killed_client(undisturbed: Diagram, tmp_path: Path):
    """Its processes end with it; what they finished is not computed again, and the map is the same in the end."""
    out, deadline = begun(undisturbed, tmp_path / "d"), time.monotonic() + SECONDS
    client = subprocess.Popen(command(out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not chunks(out):
        assert client.poll() is None, "it ended by itself"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    children = Path(f"/proc/{client.pid}/task/{client.pid}/children").read_text().split()
    client.kill()
    client.wait()
    while any(Path(f"/proc/{pid}").exists() for pid in children):
        assert time.monotonic() < deadline, "a worker survives"
        time.sleep(0.02)
    kept = chunks(out)
    assert len(DiagramStore.open(out).manifest["resumed"]) == 1
    assert len(resumed(out)) == 4 - len(kept)
    assert kept == {path: time for path, time in chunks(out).items() if path in kept}
    assert_same(out, undisturbed)


def test_all_workers_are_killed(undisturbed: Diagram, tmp_path: Path):
    """As soon as one has finished a tile every one that lives or is started dies: the command gives up, and resumes."""
    out, is_over = begun(undisturbed, tmp_path / "d"), threading.Event()
    tiles = DiagramStore.open(out).missing_tiles

    def kill() -> None:
        while not is_over.wait(0.005):
            for pid in workers.pids if chunks(out) else ():
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    with Workers(2) as workers:
        killer = threading.Thread(target=kill)
        killer.start()
        try:
            with pytest.raises(WorkerError, match=r"3 processes died over the same points .*: resume with fewer"):
                list(workers.map(out, tiles))
        finally:
            is_over.set()
            killer.join()
    kept = chunks(out)
    assert 1 <= len(kept) < 4
    assert len(resumed(out)) == 4 - len(kept)
    assert kept == {path: time for path, time in chunks(out).items() if path in kept}
    assert_same(out, undisturbed)


@pytest.mark.slow
def test_whatever_is_killed_at_random(undisturbed: Diagram, tmp_path: Path):
    """Workers and clients of one command after the other: nothing finished is computed again, nothing is left running."""
    out, chance = begun(undisturbed, tmp_path / "d"), random.Random(3)
    deadline, killed, known = time.monotonic() + SECONDS, [0, 0], chunks(out)
    while DiagramStore.open(out).missing_tiles:
        client = subprocess.Popen(command(out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        children = Path(f"/proc/{client.pid}/task/{client.pid}/children")
        started: set[int] = set()
        before = len(chunks(out))
        while client.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
            with suppress(OSError):
                started |= {int(pid) for pid in children.read_text().split()}
            if len(started) < 2 or killed[1] == 2:
                continue
            time.sleep(chance.uniform(0.0, 2.0))
            which = int(killed[0] >= 2 and len(chunks(out)) > before)
            victim = client.pid if which else chance.choice(sorted(started))
            if killed[which] < 2:
                killed[which] += 1
                with suppress(ProcessLookupError):
                    os.kill(victim, signal.SIGKILL)
        while any(Path(f"/proc/{pid}").exists() for pid in started):
            assert time.monotonic() < deadline, "a worker survives"
            time.sleep(0.05)
        now = chunks(out)
        assert known == {path: now[path] for path in known}, "a finished tile was computed again"
        known = now
    assert killed[0] == 2
    assert_same(out, undisturbed)


class Daemons(NamedTuple):
    """A scheduler and its workers as processes."""

    address: str
    scheduler: subprocess.Popen[bytes]
    start_worker: Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def daemons(tmp_path: Path) -> Iterator[Daemons]:
    started, file = [], tmp_path / "scheduler.json"

    def start(kind: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
        started.append(subprocess.Popen(command, **quiet))
        return started[-1]

    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
    address = wait_for(lambda: json.loads(file.read_text())["address"] if file.exists() else None)

    def start_worker(*arguments: str) -> subprocess.Popen[bytes]:
        return start("worker", address, "--nworkers", "1", "--nthreads", "1", "--no-nanny", *arguments)

    yield Daemons(address, scheduler, start_worker)
    for one in started:
        one.kill()
        one.wait()


def wait_for(known: Callable[[], str | None]) -> str:
    """What comes to be known."""
    deadline = time.monotonic() + SECONDS
    while (found := known()) is None:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


def workers_of(address: str, count: int) -> None:
    """Wait until so many workers are there."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=SECONDS)


@pytest.mark.slow
def test_workers_and_the_scheduler_of_a_cluster_are_lost(undisturbed: Diagram, tmp_path: Path, daemons: Daemons):
    """A lost worker's tiles are computed by another one. Without a scheduler the command gives up, and resumes without it."""
    out = begun(undisturbed, tmp_path / "d")
    one, _ = daemons.start_worker(), daemons.start_worker()
    workers_of(daemons.address, 2)
    done: list[Done] = []

    def disturb(tile: Done) -> None:
        done.append(tile)
        if len(done) == 1:
            one.kill()
        if len(done) == 2:
            daemons.scheduler.kill()

    began = time.monotonic()
    with pytest.raises(WorkerError, match="nothing finished is lost: resume"):
        diagram(swimmer(), X, Y, out=out, resume=True, dask=daemons.address, progress=disturb)
    assert time.monotonic() - began < SECONDS
    kept = chunks(out)
    assert len(kept) >= 2
    again = resumed(out)
    assert len(again) == 4 - len(kept)
    assert kept == {path: time for path, time in chunks(out).items() if path in kept}
    assert_same(out, undisturbed)


@pytest.mark.slow
def test_another_version_on_a_worker(tmp_path: Path, daemons: Daemons):
    """It is refused before anything is written."""
    old = tmp_path / "old.py"
    old.write_text("import shapespace.study.cluster as cluster\ncluster.own_version = lambda: '0.0.9'\n")
    daemons.start_worker("--preload", str(old))
    workers_of(daemons.address, 1)
    with pytest.raises(InputError, match=r"has shapespace 0\.0\.9, not .*; install the same version there"):
        diagram(swimmer(), X, Y, out=tmp_path / "d", dask=daemons.address)
    assert not (tmp_path / "d").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("own_models")
def test_a_worker_learns_models_of_ones_own(tmp_path: Path, daemons: Daemons):
    """It is started where nobody knows of them."""
    daemons.start_worker()
    workers_of(daemons.address, 1)
    file = tmp_path / "own.py"
    file.write_text(OWN)
    import_file(file)
    case = scenario("dragged-swimmer", **SETTINGS)
    axes = ("peclet=150:160:2", "inverse_hydrodynamic_length=1:2:2")
    found = diagram(case, *axes, out=tmp_path / "d", dask=daemons.address)
    assert found.converged == 4
