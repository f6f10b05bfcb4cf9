"""The command line, with a stand-in for the solver: exit statuses, one-line errors, JSON, and being killed."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from tests.shell import Shell, one_complaint
from tests.study.fakes import STEPS, FakeSimulation, install

from shapespace.base.outcome import Outcome
from shapespace.study import files
from shapespace.study import tables as tables_module
from shapespace.study.scenario import load_scenario, scenario, scenario_names, template
from shapespace.study.store import RunStore
from shapespace.view import show as show_module

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = ("scenarios", "config", "run", "steady", "branch", "plot", "movie", "export", "check", "verify")
RUN = ("run", "guided-division", "--dt", "0.1", "--until", "1")


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> type[FakeSimulation]:
    return install(monkeypatch)


@pytest.fixture
def shell(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fake: type[FakeSimulation]
) -> Shell:
    del fake
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def no_space(_: int) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_scenarios_lists_them(shell: Shell):
    answer = shell("scenarios")
    assert answer.status == 0
    assert [line.split()[0] for line in answer.out.splitlines()] == [*scenario_names()]


def test_config_writes_the_template(shell: Shell):
    assert shell("config", "ring-slipping").out == template("ring-slipping")
    assert shell("config", "ring-slipping", "--out", "mine.toml") == (0, "", "")
    assert load_scenario("mine.toml") == scenario("ring-slipping")
    assert "is there already" in one_complaint(shell("config", "ring-slipping", "--out", "mine.toml"))
    assert "cannot be read or written" in one_complaint(shell("config", "ring-slipping", "--out", "no/mine.toml"))
    assert "nearest is ring-slipping" in one_complaint(shell("config", "ring-sliping"))


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_has_examples(shell: Shell, command: str):
    answer = shell(*command.split(), "--help")
    assert answer.status == 0
    assert "Examples:" in answer.out
    assert f"shapespace {command}" in answer.out


def test_run_reports_what_it_did(shell: Shell):
    answer = shell(*RUN)
    assert answer.status == 0
    assert "neck_radius" in answer.out
    assert "R0" in answer.out
    assert "reached-end" in answer.out
    assert "results/guided-division" in answer.out
    assert "ETA" in answer.err
    assert len(RunStore.open("results/guided-division")) == STEPS + 1


def test_json_is_the_last_line_with_numbers_only_where_there_are_some(shell: Shell, fake: type[FakeSimulation]):
    fake.observables = {"polarity": float("nan"), "pressure": 20.5}
    answer = shell(*RUN, "-s", "peclet=300", "elements=80", "--set", "tension=-3", "--json", "--out", "run")
    assert answer.status == 0
    record = json.loads(answer.out.splitlines()[-1], parse_constant=pytest.fail)
    assert set(record) == {
        "outcome", "advice", "scenario", "parameters", "observables", "store", "steps", "wall_time",
    }  # fmt: skip
    assert (record["outcome"], record["scenario"], record["steps"]) == ("reached-end", "guided-division", STEPS)
    assert record["advice"] == Outcome.REACHED_END.advice
    parameters = record["parameters"]
    assert (parameters["peclet"], parameters["active_tension"], parameters["tension"]) == (300, 300, -3)
    assert (parameters["elements"], parameters["until"], parameters["dt"]) == (80, 1, 0.1)
    assert record["observables"]["pressure"] == 20.5
    assert "polarity" not in record["observables"]
    assert all(type(value) in (int, float) for value in record["observables"].values())
    assert parameters.pop("parameterization") == "sle"
    assert all(type(value) in (int, float, bool) for value in parameters.values())
    assert len(RunStore.open(record["store"])) == STEPS + 1


def test_a_state_coarser_than_asked_for_is_warned_of(shell: Shell, fake: type[FakeSimulation]):
    fake.observables = {"discretisation_error": 1.3e-3}
    answer = shell(*RUN, "-s", "mesh_tolerance=1e-3")
    assert answer.status == 0
    assert "discretisation_error = 0.0013 at the end: exceeds mesh_tolerance = 0.001" in answer.err
    assert "-s mesh_tolerance=0.0001" in answer.err
    assert "exceeds" not in shell(*RUN, "-s", "mesh_tolerance=2e-3").err


def test_run_of_a_file(shell: Shell):
    Path("mine.toml").write_text(template("guided-division").replace('"guided-division"', '"mine"'))
    answer = shell("run", "mine.toml", "--dt", "0.1", "--json")
    assert json.loads(answer.out)["scenario"] == "mine"
    assert json.loads(answer.out)["store"] == "results/mine"


def test_default_directory_is_never_one_in_use(shell: Shell):
    stores = [json.loads(shell(*RUN, "--json").out)["store"] for _ in range(3)]
    assert stores == [f"results/guided-division{suffix}" for suffix in ("", "-2", "-3")]


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["-s", "pecle=3"], ["pecle = '3'", "nearest valid one is peclet"]),
        (["-s", "peclet=many"], ["peclet = 'many'", "must be a number"]),
        (["-s", "peclet=nan"], ["peclet = nan", "finite"]),
        (["-s", "peclet=inf"], ["peclet = inf", "finite"]),
        (["-s", "shear_viscosity=-1"], ["shear_viscosity = -1", "must be > 0"]),
        (["-s", "diffusivity=-1"], ["diffusivity = -1", "must be > 0"]),
        (["-s", "enclosed_volume=0"], ["enclosed_volume = 0", "must be > 0"]),
        (["-s", "peclet=1", "active_tension=2"], ["peclet", "active_tension", "only one"]),
        (["-s", "peclet=1", "-s", "peclet=2"], ["peclet = 2", "given twice"]),
        (["-s", "peclet"], ["peclet", "KEY=VALUE"]),
        (["-s", "=3"], ["KEY=VALUE"]),
        (["-s", "until=3"], ["until = 1", "given twice"]),
        (["-s", "elements=50"], ["elements = 50", "one of 20, 40"]),
        (["--dt", "-1"], ["dt"]),
        (["--bogus"], ["--bogus"]),
        (["extra"], ["extra"]),
        (["-s"], ["requires an argument"]),
        (["--out", "taken"], ["taken", "holds a run already", "--resume"]),
        (["--out", "foreign"], ["foreign", "holds other files"]),
        (["--out", "file"], ["file", "is not a directory"]),
        (["--out", "foreign", "--resume"], ["foreign", "holds other files"]),
        (["--out", "taken", "--resume", "-s", "peclet=3"], ["taken", "peclet is 450.0, not 3.0"]),
        (["--out", "damaged", "--resume"], ["damaged/frames/000010.npz", "is damaged", "delete it"]),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(shell: Shell, arguments: list[str], parts: list[str]):
    for name in ("taken", "damaged"):
        assert shell(*RUN, "--out", name).status == 0
    Path("damaged/frames/000010.npz").write_bytes(b"half a fra")
    Path("foreign").mkdir()
    for name in ("foreign/thesis.tex", "file"):
        Path(name).write_text("precious")
    before = {file: file.stat().st_mtime_ns for file in Path().rglob("*") if file.is_file()}
    message = one_complaint(shell(*RUN, *arguments))
    for part in parts:
        assert part in message
    assert {file: file.stat().st_mtime_ns for file in Path().rglob("*") if file.is_file()} == before
    assert not Path("results").exists()


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["run", "guided-divison"], "nearest is guided-division"),
        (["run", "absent.toml"], "there is no such file"),
        (["run", "."], "is a directory"),
        (["run"], "NAME_OR_FILE requires an argument"),
        (["frobnicate"], "frobnicate"),
        (["plot", "absent"], "absent"),
        (["movie", "."], "holds no run"),
        (["export", "absent", "x.nc"], "absent"),
        (["export", "absent", "x.txt"], "end it in .nc"),
    ],
)
def test_other_bad_input_is_one_line_too(shell: Shell, arguments: list[str], part: str):
    assert part in one_complaint(shell(*arguments))
    assert not [*Path().iterdir()]


def test_truncated_file_names_itself(shell: Shell):
    Path("mine.toml").write_text(template("guided-division")[:2500])
    assert "mine.toml" in one_complaint(shell("run", "mine.toml"))
    assert [file.name for file in Path().iterdir()] == ["mine.toml"]


def test_solver_that_gives_up_leaves_a_partial_store(shell: Shell, fake: type[FakeSimulation]):
    fake.ends_with, fake.stops_at = Outcome.STEP_UNDERFLOW, 5
    answer = shell(*RUN, "--json", "--out", "run")
    assert answer.status == 3
    assert json.loads(answer.out)["outcome"] == "step-underflow"
    assert answer.err.splitlines()[-1].endswith("The partial run is in run.")
    assert len(RunStore.open("run")) == 5


@pytest.mark.parametrize(("code", "part"), [(errno.ENOSPC, "the disk is full"), (errno.EROFS, "permission is missing")])
def test_failing_disk_before_and_during_a_run(shell: Shell, monkeypatch: pytest.MonkeyPatch, code: int, part: str):
    calls = 0
    sync = os.fsync

    def fail_later(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls > allowed:
            raise OSError(code, os.strerror(code))
        sync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(files.os, "fsync", fail_later)
        allowed = 0
        assert part in one_complaint(shell(*RUN, "--out", "run"))
        assert not [*Path().iterdir()]
        calls, allowed = 0, 7
        answer = shell(*RUN, "--out", "run")
    assert (answer.status, answer.out) == (2, "")
    assert part in answer.err.splitlines()[-1]
    assert 0 < len(RunStore.open("run")) < STEPS
    assert shell(*RUN, "--out", "run", "--resume").status == 0


def test_interrupt_says_how_to_resume(shell: Shell, fake: type[FakeSimulation]):
    fake.stops_at, fake.raises = 4, KeyboardInterrupt()
    answer = shell(*RUN, "-s", "peclet=300", "--out", "my run")
    assert answer.status == 130
    words = answer.err.splitlines()[-1].partition("to continue: ")[2]
    assert words.startswith("shapespace run guided-division")
    assert words.endswith("--out 'my run' --resume")
    fake.stops_at = None
    answer = shell("run", "guided-division", *RUN[2:], "-s", "peclet=300", "--out", "my run", "--resume", "--json")
    assert json.loads(answer.out)["steps"] == STEPS


def test_resume_where_there_is_nothing_starts_and_says_so(shell: Shell):
    answer = shell(*RUN, "--resume", "--json")
    assert answer.status == 0
    assert "starting guided-division in results/guided-division" in answer.err
    again = shell(*RUN, "--resume", "--json")
    ended, same = (json.loads(text.out) for text in (answer, again))
    assert {**ended, "wall_time": 0} == {**same, "wall_time": 0}


_DRIVER = """
import signal
import sys
# A job in the background of a shell script is deaf to interrupts, and so would be its children.
signal.signal(signal.SIGINT, signal.default_int_handler)
from tests.study.fakes import install
install().pause = 0.02
from shapespace.cli import main
sys.exit(main())
"""


def start(arguments: list[str], folder: Path) -> subprocess.Popen[str]:
    """The command line as a process of its own, with a slow stand-in for the solver."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])}
    command = [sys.executable, "-c", _DRIVER, *arguments]
    return subprocess.Popen(command, cwd=folder, env=environment, text=True, stdout=-1, stderr=-1)


def test_killed_run_is_resumed_to_the_same_end(tmp_path: Path):
    arguments = ["run", "guided-division", "--dt", "0.02", "--until", "1", "--json", "--out"]
    process = start([*arguments, "killed"], tmp_path)
    while not (tmp_path / "killed" / "frames" / "000005.npz").exists():
        assert process.poll() is None
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    ends = []
    for name in ("killed", "whole"):
        process = start([*arguments, name, "--resume"], tmp_path)
        out, err = process.communicate()
        assert process.returncode == 0, err
        ends.append(json.loads(out.splitlines()[-1]))
    assert ends[0]["observables"] == ends[1]["observables"]
    one, other = (RunStore.open(tmp_path / name) for name in ("killed", "whole"))
    for left, right in zip(one, other, strict=True):
        np.testing.assert_array_equal(left.nodes, right.nodes)
        assert left.time == right.time


def test_interrupted_process_exits_with_130(tmp_path: Path):
    process = start([*RUN[:2], "--dt", "0.001", "--until", "1", "--out", "run"], tmp_path)
    while not (tmp_path / "run" / "frames" / "000002.npz").exists():
        assert process.poll() is None
        time.sleep(0.002)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    assert err.splitlines()[-1].endswith("--out run --resume")
    assert len(RunStore.open(tmp_path / "run")) >= 3


def test_help_loads_no_numerical_library():
    code = "import sys; from shapespace.cli import main; main(['--help']); print(*sys.modules)"
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert not {"jax", "numpy", "scipy", "xarray", "matplotlib", "pydantic"} & set(done.stdout.split())


def test_pictures_and_export_go_where_they_are_wanted(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    dataset = xr.Dataset({"height": ("time", [1.0, 2.0])})
    for module in (show_module, tables_module):
        monkeypatch.setattr(module, "open_dataset", lambda _: dataset)
    monkeypatch.setattr(show_module, "plot_run", lambda _: Figure())
    monkeypatch.setattr(show_module, "movie", lambda _store, path, _progress: path)
    Path("run").mkdir()
    assert shell("plot", "run") == (0, "run/figure.png\n", "")
    assert shell("plot", "run", "--out", "a.pdf") == (0, "a.pdf\n", "")
    assert Path("run/figure.png").stat().st_size > 0
    assert "no ending of a picture" in one_complaint(shell("plot", "run", "--out", "a.xyz"))
    assert "cannot be read or written" in one_complaint(shell("plot", "run", "--out", "no/a.png"))
    assert shell("movie", "run").out == "run/movie.mp4\n"
    assert shell("export", "run", "run.nc") == (0, "run.nc\n", "")
    with monkeypatch.context() as patch:
        patch.setattr(files.os, "fsync", no_space)
        assert "the disk is full" in one_complaint(shell("export", "run", "more.nc"))
    xr.testing.assert_identical(xr.load_dataset("run.nc"), dataset)
    assert sorted(file.name for file in Path().iterdir()) == ["a.pdf", "run", "run.nc"]


def test_check_reports_line_by_line(shell: Shell, fake: type[FakeSimulation]):
    lines = shell("check").out.splitlines()
    assert [line.partition(": ")[0].split(maxsplit=1)[1] for line in lines] == [
        "versions", "double precision", "small solve", "writing", "cores", "cache", "accelerator", "movie writer", "cluster",
        "meshes",
    ]  # fmt: skip
    assert all(line.startswith("ok") for line in lines[1:5]), lines
    assert all("pip install" in line for line in lines[7:] if line.startswith("absent")), lines
    fake.ends_with = Outcome.DIVERGED
    answer = shell("check")
    assert answer.status == 1
    assert "failed  small solve: diverged" in answer.out
    assert not [*Path().iterdir()]
