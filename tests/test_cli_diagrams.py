"""The command `diagram` and its figure, with the real solver on swimmers."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
import xarray as xr
from tests.shell import Shell, one_complaint

import shapespace as ss
from shapespace.app.maps import DiagramSource
from shapespace.cli import diagrams
from shapespace.cli.progress import ProgressDisplay
from shapespace.study import cluster
from shapespace.study.tiles import Done
from shapespace.view.diagram import HATCH, plot_diagram

COMMAND = ("diagram", "polar-swimmer", "-s", "elements=20", "mesh_tolerance=1e-3", "--workers", "1")
LOCAL = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
AXES = ("-x", "peclet=20:26:4", "-y", "inverse_hydrodynamic_length=1:2:2")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_diagram_maps_and_draws_swimmers(shell: Shell):
    answer = shell(*COMMAND, *AXES, "--out", "map", "--json")
    assert answer.status == 0, answer.err
    record = json.loads(answer.out.splitlines()[-1], parse_constant=pytest.fail)
    assert (record["store"], record["points"], record["computed"], record["converged"]) == ("map", 8, 8, 4)
    assert 8 / record["seconds"] <= record["points_per_second"] < 16 / record["seconds"]
    assert {(one["peclet"] <= 22.0, one["outcome"]) for one in record["failed"]} <= {
        (True, "no-state"),
        (True, "not-reached"),
    }
    data = xr.open_zarr("map")
    assert data["velocity"].dims == ("inverse_hydrodynamic_length", "peclet")
    assert (np.isfinite(data["velocity"]) == (data["peclet"] > 22.0)).all()
    again = json.loads(shell(*COMMAND, *AXES, "--out", "map", "--resume", "--json").out)
    assert (again["computed"], again["converged"], again["points_per_second"]) == (0, 4, None)
    assert "8 points: 4 converged" in shell(*COMMAND, *AXES, "--out", "map", "--resume").out
    assert shell("plot", "map", "--of", "polarity").out == "map/figure.png\n"
    assert Path("map/figure.png").stat().st_size > 10_000
    figure = plot_diagram(ss.open_diagram("map"))
    map_axes, bar = figure.axes
    assert map_axes.get_xlabel() == "Péclet number $\\mathrm{Pe}$"
    assert map_axes.get_ylabel() == "inverse hydrodynamic length $R_{0}/L_h$"
    assert bar.get_ylabel() == r"velocity $v_{0}$ ($R_{0}/\tau$)"
    assert any(one.get_hatch() == HATCH for one in map_axes.collections)
    assert "no observable of this diagram" in one_complaint(shell("plot", "map", "--of", "wings"))
    assert "holds a diagram already" in one_complaint(shell(*COMMAND, *AXES, "--out", "map"))
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in Path("map").rglob("*") if path.is_file()}
    others = (
        [*AXES[:2], "-y", "inverse_hydrodynamic_length=1:3:2"],
        [*AXES, "-s", "turnover_rate=8"],
        [*AXES, "--stability"],
    )
    for other in others:
        assert "resume with the same value" in one_complaint(shell(*COMMAND, *other, "--out", "map", "--resume"))
    assert before == {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in before}


def test_what_the_page_proposes_is_the_clicked_state(shell: Shell):
    """Also of a state that is not the first at its point."""
    command = ("diagram", "polar-swimmer", "-s", "elements=20", "mesh_tolerance=1e-3", "-x", "peclet=26:30:3",
               "-y", "inverse_hydrodynamic_length=1:2:2", "--state", "trivial,default", "--branches", "2")  # fmt: skip
    assert shell(*command, "--workers", "1", "--out", "map").status == 0
    point = xr.open_zarr("map").isel(state=1, peclet=2, inverse_hydrodynamic_length=1)
    shown = DiagramSource(Path("map")).shape("1,2,1")
    assert shown["start"].endswith("map:1,2,1")
    (proposed,) = [one["text"] for one in shown["commands"] if one["name"] == "steady"]
    program, *words = shlex.split(proposed)
    assert program == "shapespace"
    record = json.loads(shell(*words, "--json").out.splitlines()[-1])
    for name in ("velocity", "bending_energy", "pressure"):
        assert abs(record["observables"][name]) == pytest.approx(abs(float(point[name])), rel=1e-7), name
    assert abs(record["observables"]["velocity"]) > 0.1
    names: dict[str, Any] = {}
    exec(shown["python"], names)
    assert names["state"].observables["velocity"] == pytest.approx(record["observables"]["velocity"], rel=1e-7)


def test_a_cluster_that_cannot_help_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    """No scheduler, and a worker with another version of the package: nothing is written."""
    monkeypatch.setattr(cluster, "SECONDS", 0.5)
    command = (*COMMAND[:-2], *AXES, "--out", "map", "--dask")
    assert "no scheduler answers there" in one_complaint(shell(*command, "tcp://127.0.0.1:9"))
    monkeypatch.setattr(cluster, "SECONDS", 60.0)
    monkeypatch.setattr(cluster, "_look", lambda file: cluster._Look("0.0.9", "here", True))
    with distributed.LocalCluster(**LOCAL) as local:
        complaint = one_complaint(shell(*command, local.scheduler_address))
    assert re.search(r"has shapespace 0\.0\.9, not .*; install the same version there", complaint)
    assert not Path("map").exists()


def test_a_lost_scheduler_is_one_line_and_its_address_is_not_repeated(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    def lost(*_: Any) -> None:
        raise OSError("gone")

    monkeypatch.setattr(cluster, "_compute", lost)
    monkeypatch.setattr(cluster, "RETRIES", 0)
    with distributed.LocalCluster(**LOCAL) as local:
        words = [*COMMAND[:-2], *AXES, "--out", "map", "--dask", local.scheduler_address]
        monkeypatch.setattr("sys.argv", ["shapespace", *words])
        answer = shell(*words)
    assert answer.status == 3
    told = answer.err.splitlines()
    assert told[0] == "shapespace: starting map"
    assert "the scheduler of the cluster is lost (OSError); nothing finished is lost: resume" in told[-1]
    assert told[-1].endswith(f"a cluster that lives: shapespace {shlex.join([*words[:-2], '--resume'])}")
    assert all(line.startswith("shapespace: ") for line in told)


def test_rate_and_time_left(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    """From the first tile's beginning on, with what was there before as done; what is inferred is not computed."""
    now = [100.0]
    monkeypatch.setattr("shapespace.cli.diagrams.monotonic", lambda: now[0])
    with ProgressDisplay(0.0) as display:
        rate = diagrams._Rate(display, Path("map"))
        rate.begin(100, 400)
        assert rate.whole is None
        now[0] = 130.0
        rate.update(Done((0, 0), 100, 100, 0, 10.0))
        rate.wait(0)
        now[0] = 140.0
        rate.wait(2)
        rate.update(Done((1, 0), 100, 60, 40, 10.0))
    assert capsys.readouterr().err.splitlines() == [
        "shapespace: continuing map after 100 of 400 points",
        "shapespace: 50 %: 200 of 400 points, 10.0 a second, 20 s left",
        "shapespace: 50 %: waiting for workers: the scheduler has none",
        "shapespace: 75 %: 300 of 400 points, 10.0 a second, 10 s left, 2 workers",
    ]
    assert rate.computed == 160
    assert rate.whole == pytest.approx(4.0)


def test_a_map_without_states_is_no_success(shell: Shell):
    answer = shell(*COMMAND, "-x", "peclet=5:10:2", "-y", "turnover_rate=8:9:2", "--out", "map")
    assert answer.status == 3
    assert "4 points: 0 converged, 4 no-state" in answer.out
    assert "no point of the grid" in answer.err


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["-x", "peclet=20:30:1", "-y", "turnover_rate=5:6:2"], "must have 2 to"),
        (["-x", "peclet=30:20:4", "-y", "turnover_rate=5:6:2"], "must run upwards"),
        (["-x", "peclet=20:20:4", "-y", "turnover_rate=5:6:2"], "must run upwards"),
        (["-x", "pecelt=20:30:4", "-y", "turnover_rate=5:6:2"], "the nearest valid one is peclet"),
        (["-x", "peclet=20:30:4", "-y", "turnover_rate=0:6:2"], "turnover_rate = 0"),
        (["-x", "peclet=20:30:4"], "y"),
        ([*AXES, "--out", "foreign"], "holds other files"),
        ([*AXES, "--workers", "0"], "workers"),
        ([*AXES, "--workers", "1.5"], "1.5 must be a whole number"),
        ([*AXES, "--branches", "2", "--from", "nowhere"], "--from nowhere: is not a directory with stored states"),
    ],
)
def test_bad_diagram_is_one_line(shell: Shell, arguments: list[str], part: str):
    Path("foreign").mkdir()
    Path("foreign/thesis.tex").write_text("precious")
    assert part in one_complaint(shell(*COMMAND[:-2], *arguments))
    assert [str(file) for file in Path().rglob("*") if file.is_file()] == ["foreign/thesis.tex"]
