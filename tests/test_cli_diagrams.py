"""The command `diagram` and its figure, with the real solver on swimmers."""

import json
import re
from pathlib import Path

import distributed
import numpy as np
import pytest
import xarray as xr
from tests.shell import Shell, one_complaint

import shapespace as ss
from shapespace.view.diagram import HATCH, plot_diagram

COMMAND = ("diagram", "polar-swimmer", "-s", "elements=20", "mesh_tolerance=1e-3", "--workers", "1")
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
    assert record["points_per_second"] == pytest.approx(8 / record["seconds"])
    assert {(one["peclet"] <= 22.0, one["outcome"]) for one in record["failed"]} <= {
        (True, "no-state"),
        (True, "not-reached"),
    }
    data = xr.open_zarr("map")
    assert data["velocity"].dims == ("inverse_hydrodynamic_length", "peclet")
    assert (np.isfinite(data["velocity"]) == (data["peclet"] > 22.0)).all()
    again = json.loads(shell(*COMMAND, *AXES, "--out", "map", "--resume", "--json").out)
    assert (again["computed"], again["converged"]) == (0, 4)
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


def test_a_cluster_that_cannot_help_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    """No scheduler, and a worker with another version of the package: nothing is written."""
    monkeypatch.setattr("shapespace.study.cluster.SECONDS", 0.5)
    command = (*COMMAND[:-2], *AXES, "--out", "map", "--dask")
    assert "no scheduler answers there" in one_complaint(shell(*command, "tcp://127.0.0.1:9"))
    monkeypatch.setattr("shapespace.study.cluster.SECONDS", 60.0)
    monkeypatch.setattr("shapespace.study.cluster._version", lambda: "0.0.9")
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as cluster:
        complaint = one_complaint(shell(*command, cluster.scheduler_address))
    assert re.search(r"has shapespace 0\.0\.9, not .*; install the same version there", complaint)
    assert not Path("map").exists()


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
    ],
)
def test_bad_diagram_is_one_line(shell: Shell, arguments: list[str], part: str):
    Path("foreign").mkdir()
    Path("foreign/thesis.tex").write_text("precious")
    assert part in one_complaint(shell(*COMMAND[:-2], *arguments))
    assert [str(file) for file in Path().rglob("*") if file.is_file()] == ["foreign/thesis.tex"]
