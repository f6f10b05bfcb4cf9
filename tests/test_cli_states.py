"""The commands `steady`, `branch` and `curve`, with the real solver on the swimming sphere."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.shell import Shell, one_complaint

from shapespace.cli import main


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_steady_prints_a_state_with_its_growth_rates(shell: Shell):
    """The resting sphere at Pe = 30: its slowest perturbation is odd and grows with (Pe/2 - 2 - k) = 4 (exact result 2)."""
    command = ("steady", "polar-swimmer", "--state", "trivial", "-s", "elements=20", "peclet=30")
    record = json.loads(shell(*command, "--json", "--out", "sphere").out, parse_constant=pytest.fail)
    assert (record["outcome"], record["n_unstable"], record["parities"][0]) == ("converged", 1, "antisymmetric")
    assert record["growth_rates"][0] == pytest.approx([4.0, 0.0], abs=1e-6)
    assert record["observables"]["area"] == pytest.approx(4.0 * np.pi)
    again = json.loads(shell(*command[:2], *command[4:], "--from", "sphere", "--json").out)
    assert again["growth_rates"][0] == pytest.approx([4.0, 0.0], abs=1e-6)
    text = shell(*command).out
    assert "unstable: 1 growing mode; `shapespace search`" in text
    assert "antisymmetric" in text


def test_steady_says_where_it_got_to_and_what_is_wrong(shell: Shell):
    answer = shell("steady", "polar-swimmer", "-s", "elements=20", "peclet=15", "--json")
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (answer.status, record["outcome"], record["observables"]) == (3, "no-state", {})
    assert 0.0 <= record["residual"] < 1e-3
    assert "polarizes at peclet = 22; the branch from there comes to no swimmer at 15" in answer.err
    assert "best residual" in answer.err
    Path("foreign").mkdir()
    Path("foreign/thesis.tex").write_text("precious")
    assert "name two states" in one_complaint(shell("steady", "polar-swimmer", "--state", "trivial", "--from", "run"))
    assert "holds other files" in one_complaint(shell("steady", "polar-swimmer", "--out", "foreign"))
    assert "holds no run" in one_complaint(shell("steady", "polar-swimmer", "--from", "foreign"))


BRANCH = ("branch", "polar-swimmer", "-s", "elements=20", "--vary", "peclet", "--state", "trivial", "--start", "21")


def test_branch_reports_special_points(shell: Shell):
    """The sphere's pitchfork at Pe = 22 (exact result 2), as a table, as JSON, and as a picture."""
    answer = shell(*BRANCH, "--stop", "23", "--at", "21.5", "--json", "--out", "sphere")
    assert answer.status == 0, answer.err
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (record["outcome"], record["vary"], record["store"], record["missed"]) == (
        "reached-stop",
        "peclet",
        "sphere",
        [],
    )
    labels = [(point["label"], point["kind"]) for point in record["special_points"]]
    assert labels == [("user-1", "user"), ("pitchfork-1", "pitchfork"), ("end-1", "end")]
    fork = record["special_points"][1]
    assert abs(fork["parameter"] - 22.0) < min(1e-8, fork["parameter_error"])
    assert (fork["n_unstable_before"], fork["n_unstable_after"]) == (0, 1)
    assert fork["growth_rates"][0] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert [point["n_unstable"] for point in record["points"]] == [int(p["parameter"] > 22.0) for p in record["points"]]
    assert record["points"][0]["observables"]["area"] == pytest.approx(4.0 * np.pi)
    assert "n_unstable 0 pitchfork-1" in answer.err
    assert record["began"] == "trivial"
    assert "start from the state trivial" in answer.err
    again = shell(*BRANCH, "--stop", "23", "--at", "21.5", "--resume", "--out", "sphere")
    assert "pitchfork-1" in again.out
    assert fork["parities"][0] == "antisymmetric"
    assert fork["neutral_modes"] == [{"name": "translation", "index": None}, {"name": "critical", "index": 0}]
    assert shell("plot", "sphere:pitchfork-1", "--mode", "0") == (0, "sphere/pitchfork-1-mode-0.png\n", "")
    assert "--mode 7: is not stored" in one_complaint(shell("plot", "sphere:pitchfork-1", "--mode", "7"))
    assert "fork-1: is no label" in one_complaint(shell("plot", "sphere:fork-1", "--mode", "0"))
    assert shell("plot", "sphere") == (0, "sphere/figure.png\n", "")
    assert "pressures: is no observable" in one_complaint(shell("plot", "sphere", "--observable", "pressures"))
    steady = json.loads(shell("steady", *BRANCH[1:4], "--from", "sphere:user-1", "--json").out)
    assert steady["parameters"]["peclet"] == 21.5


def test_branch_without_a_start_says_how_near_it_came(shell: Shell):
    command = ("branch", *BRANCH[1:6], "--state", "default", "--start", "15", "--stop", "16", "--out", "none")
    answer = shell(*command, "--json")
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (answer.status, record["outcome"], record["points"]) == (3, "no-state", [])
    assert "best residual" in answer.err


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--stop", "21"], "must differ from the start"),
        (["--stop", "23", "--at", "21,x"], "must be numbers with commas"),
        (["--stop", "x"], "x"),
        (["--stop", "23", "-s", "pecle=3"], "nearest valid one is peclet"),
        (["--stop", "23", "--out", "foreign"], "holds other files"),
        (["--stop", "23", "--side", "1"], "needs a branch point"),
        ([], "--stop"),
    ],
)
def test_bad_branch_is_one_line(shell: Shell, arguments: list[str], part: str):
    Path("foreign").mkdir()
    Path("foreign/thesis.tex").write_text("precious")
    assert part in one_complaint(shell(*BRANCH, *arguments))
    assert [str(file) for file in Path().rglob("*") if file.is_file()] == ["foreign/thesis.tex"]


@pytest.fixture(scope="module")
def sphere(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A stored branch with a pitchfork."""
    path = tmp_path_factory.mktemp("branch") / "sphere"
    assert main([*BRANCH, "--stop", "23", "--no-stability", "--out", str(path)]) == 0
    return str(path)


def test_curve_reports_points_of_two_keys(shell: Shell, sphere: str):
    """Pe* = 2 (2 + k) (exact result 2), as a table, as JSON, and as a picture."""
    command = (
        "curve",
        f"{sphere}:pitchfork-1",
        "--vary",
        "turnover_rate",
        "--start",
        "8",
        "--stop",
        "10",
        "--at",
        "9.5",
    )
    answer = shell(*command, "--json", "--out", "forks")
    assert answer.status == 0, answer.err
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (record["outcome"], record["scenario"], record["store"]) == ("reached-stop", "polar-swimmer", "forks")
    assert (record["keys"], record["kind"], record["missed"]) == (["peclet", "turnover_rate"], "pitchfork", [])
    assert record["parameters"]["turnover_rate"] == 9.0
    assert [(one["label"], one["kind"]) for one in record["special_points"]] == [
        ("end-2", "end"), ("user-1", "user"), ("end-1", "end"),
    ]  # fmt: skip
    for one in record["special_points"]:
        wanted = 2.0 * (2.0 + one["parameters"]["turnover_rate"])
        assert abs(one["parameters"]["peclet"] - wanted) <= one["parameter_error"]["peclet"] < 1e-7
        assert one["parameter_error"]["turnover_rate"] == 0.0
    assert {"start", "user-1", "end-1", "end-2"} <= {one["label"] for one in record["points"]}
    assert record["points"][0]["observables"]["area"] == pytest.approx(4.0 * np.pi)
    assert "turnover_rate = 9.5 user-1" in answer.err
    assert "user-1" in shell(*command, "--resume", "--out", "forks").out
    assert shell("plot", "forks") == (0, "forks/figure.png\n", "")
    assert "is for the figure of a branch" in one_complaint(shell("plot", "forks", "--observable", "area"))
    steady = json.loads(shell("steady", *BRANCH[1:4], "--from", "forks:user-1", "--json").out)
    assert steady["parameters"]["turnover_rate"] == 9.5
    assert steady["parameters"]["peclet"] == pytest.approx(23.0)
    onwards = ("--vary", "peclet", "--stop", "23.2", "--from", "forks:user-1", "--side", "1", "--no-stability")
    side = json.loads(shell("branch", *BRANCH[1:4], *onwards, "--json", "--out", "side").out)
    assert (side["outcome"], side["parameters"]["turnover_rate"]) == ("reached-stop", 9.5)
    assert side["points"][0]["parameter"] == pytest.approx(23.0)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--vary", "turnover_rate", "--start", "10", "--stop", "12"], "must include turnover_rate = 9.0"),
        (["--vary", "turnover_rate", "--stop", "12", "--at", "x"], "must be numbers with commas"),
        (["--vary", "turnover_rate", "--stop", "12", "--out", "foreign"], "holds other files"),
        (["--vary", "peclet", "--stop", "12"], "varies along the branch already"),
        (["--vary", "turnover_rate"], "--stop"),
        (["--stop", "12"], "--vary"),
    ],
)
def test_bad_curve_is_one_line(shell: Shell, sphere: str, arguments: list[str], part: str):
    Path("foreign").mkdir()
    Path("foreign/thesis.tex").write_text("precious")
    assert part in one_complaint(shell("curve", f"{sphere}:pitchfork-1", *arguments))
    assert [str(file) for file in Path().rglob("*") if file.is_file()] == ["foreign/thesis.tex"]


def test_no_key_is_no_sensitivity(capsys: pytest.CaptureFixture[str]):
    command = ("steady", "polar-swimmer", "--state", "trivial", "-s", "elements=20", "--sensitivity")
    for keys in ("", "peclet,"):
        assert "must name parameters" in one_complaint(Shell(capsys)(*command, keys))
