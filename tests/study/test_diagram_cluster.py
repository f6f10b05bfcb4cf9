"""Diagrams on a Dask cluster: who answers, whose tiles, what is said where workers or the scheduler cannot help."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import distributed
import pytest

from shapespace.base.errors import InputError, WorkerError
from shapespace.study import cluster
from shapespace.study.diagrams import diagram
from shapespace.study.keys import MODELS
from shapespace.study.plugins import files_here, import_file, receive_files
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.tiles import Done
from shapespace.study.versions import own_version

X, Y = "peclet=24:40:10", "inverse_hydrodynamic_length=1:2:2"


def swimmer() -> Scenario:
    return scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)


@pytest.fixture
def local() -> Iterator[distributed.LocalCluster]:
    """Two workers in this process."""
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as found:
        yield found


def mapped(address: str, out: Path, **choices: Any) -> None:
    diagram(swimmer(), X, Y, out=out, dask=address, **choices)


@pytest.mark.parametrize(
    ("address", "part"),
    [
        ("localhost", "missing port"),
        ("", "missing port"),
        ("tcp://127.0.0.1:abc", "'abc'"),
        ("http://127.0.0.1:8786", "unknown address scheme 'http'"),
    ],
)
def test_what_is_no_address_is_said_at_once(tmp_path: Path, address: str, part: str):
    began = time.monotonic()
    with pytest.raises(InputError, match=rf"is no address \(.*{part}.*\); give one like tcp://host:8786"):
        mapped(address, tmp_path / "d")
    assert time.monotonic() - began < 5.0
    assert not [*tmp_path.iterdir()]


def test_where_no_scheduler_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Nobody, somebody who says nothing, and a worker: in a line, and soon."""
    monkeypatch.setattr(cluster, "SECONDS", 0.5)
    with pytest.raises(InputError, match=r"tcp://127\.0\.0\.1:9: no scheduler answers there"):
        mapped("tcp://127.0.0.1:9", tmp_path / "d")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(InputError, match="no scheduler answers there"):
            mapped(f"tcp://127.0.0.1:{port}", tmp_path / "d")
    assert not [*tmp_path.iterdir()]


def test_a_worker_is_no_scheduler(tmp_path: Path, local: distributed.LocalCluster):
    with pytest.raises(InputError, match="there is a worker, no scheduler"):
        mapped(local.workers[0].worker_address, tmp_path / "d")


def looking(odd: Callable[[str], Any]) -> Callable[..., Any]:
    """What workers say, but for the first, which does something odd."""
    honest = cluster._look

    def look(file: str, dask_worker: Any) -> Any:
        return odd(file) if dask_worker.name == 0 else honest(file)

    return look


def lost(_: str) -> Any:
    raise distributed.comm.core.CommClosedError("in <a test>: it died")


@pytest.mark.parametrize(
    ("odd", "part"),
    [
        (
            lambda file: cluster._Look("0.0.9", "node7", True),
            r"has shapespace 0\.0\.9, not .*; install the same version",
        ),
        (lambda file: __import__("no_such_package"), r"has no shapespace \(No module named .*\); install .* there"),
        (
            lambda file: cluster._Look(own_version(), "node7", False),
            r"on node7 does not see .*; choose an --out .*share",
        ),
    ],
)
def test_a_worker_that_cannot_help_is_named_before_anything_is_written(
    tmp_path: Path, local: distributed.LocalCluster, monkeypatch: pytest.MonkeyPatch, odd: Any, part: str
):
    monkeypatch.setattr(cluster, "_look", looking(odd))
    with pytest.raises(InputError, match=part):
        mapped(local.scheduler_address, tmp_path / "new" / "d")
    assert not [*tmp_path.iterdir()]


def test_a_worker_that_is_lost_while_it_is_asked_is_made_up_for(
    tmp_path: Path, local: distributed.LocalCluster, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(cluster, "_look", looking(lost))
    done: list[Done] = []
    mapped(local.scheduler_address, tmp_path / "d", progress=done.append)
    assert sorted(one.tile for one in done) == [(0, 0), (1, 0)]


def test_a_worker_that_comes_later_and_does_not_see_the_store(tmp_path: Path):
    with pytest.raises(InputError, match=r"a worker on .* does not see .*none; all must share it"):
        cluster._compute(str(tmp_path / "none"), (0, 0), own_version(), [])


def test_workers_that_die_over_the_same_points(
    tmp_path: Path, local: distributed.LocalCluster, monkeypatch: pytest.MonkeyPatch
):
    def killed(*_: Any) -> None:
        raise distributed.KilledWorker("tile", SimpleNamespace(address="tcp://node7:1"), 3)

    monkeypatch.setattr(cluster, "_compute", killed)
    with pytest.raises(WorkerError, match=r"workers .* died over the same points, most often of too little memory"):
        mapped(local.scheduler_address, tmp_path / "d")


def test_without_workers_it_waits_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(cluster, "PAUSE", 0.2)
    told: list[int] = []
    options = {"n_workers": 0, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as empty:

        def waiting(count: int) -> None:
            told.append(count)
            if told == [0, 0]:
                # In a thread of its own: this one waits for the worker.
                threading.Thread(target=empty.scale, args=(1,)).start()

        mapped(empty.scheduler_address, tmp_path / "d", waiting=waiting)
    assert told[:2] == [0, 0]
    assert {*told} <= {0, 1}


OWN = """
from shapespace.modelling import Parameter, define_model, define_scenario, dissipation


@dissipation("friction")
def drag(normal_velocity, normal_friction):
    return normal_friction * normal_velocity**2


define_model("dragged", like="closed-surface", laws=[drag], parameters={
    "normal_friction": Parameter("Gamma_n", "friction along the normal", "E T/L^4", default=1.0, least=0.0)})
define_scenario("dragged-swimmer", "A swimmer that drags its surroundings", "dragged", like="polar-swimmer")
"""


@pytest.mark.usefixtures("own_models")
def test_models_of_ones_own_go_to_the_workers(tmp_path: Path):
    """As files by name and text, which are imported where they are not known yet."""
    file = tmp_path / "own.py"
    file.write_text(OWN)
    receive_files([("own.py", OWN)])
    assert "dragged" in MODELS
    assert [(name, text) for name, text in files_here()] == [("own.py", OWN)]
    receive_files([("own.py", OWN)])
    receive_files([("other.py", "1/1")])
    assert [name for name, _ in files_here()] == ["own.py", "other.py"]
    with pytest.raises(InputError, match="nonsense"):
        receive_files([("bad.py", "import nonsense")])
    with pytest.raises(InputError, match="no such file"):
        import_file(tmp_path / "none.py")
