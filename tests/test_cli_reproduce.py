"""The command `reproduce`: figures by name, their table, exit status and JSON; the figures themselves: test_experiments."""

import json
from pathlib import Path

import pytest
from tests.shell import Shell, one_complaint

from shapespace.cli import reproducing

EXPERIMENT = """
from common import Row

def run(out, quick):
    (out / "{name}.png").write_text("")
    return [Row("it is", "so", "so", "0", {holds}), Row("quick", "-", str(quick), "", True, "not in the paper")]
"""


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    folder = tmp_path / "experiments"
    folder.mkdir()
    for name, holds in (("fig_x1", True), ("fig_x2", False)):
        (folder / f"{name}.py").write_text(EXPERIMENT.format(name=name, holds=holds))
    monkeypatch.setattr(reproducing, "experiments_folder", lambda: folder)
    monkeypatch.setattr("sys.path", [str(folder), *__import__("sys").path])
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_figures_come_with_a_table(shell: Shell):
    answer = shell("reproduce", "x1", "--quick")
    assert answer.status == 0, answer.err
    assert "it is" in answer.out
    assert "1 figures, 2 statements: 1 agree with the paper, 0 fail" in answer.out
    assert Path("results/fig_x1-quick/fig_x1.png").exists()


def test_what_fails_is_named(shell: Shell):
    answer = shell("reproduce", "all", "--out", "there", "--json")
    assert answer.status == 1
    assert "not as asserted: x2." in answer.err
    records = json.loads(answer.out.splitlines()[-1])["figures"]
    assert [(one["figure"], one["holds"], len(one["rows"])) for one in records] == [("x1", True, 2), ("x2", False, 2)]
    assert records[1]["rows"][0] == {
        "claim": "it is", "paper": "so", "here": "so", "error": "0", "verdict": "agrees", "holds": False,
    }  # fmt: skip
    assert Path("there/fig_x2/fig_x2.png").exists()


@pytest.mark.parametrize(
    ("word", "names"),
    [
        ("5a", ["5abcd"]),
        ("7", ["7a", "7b"]),
        ("s1", ["s1"]),
        ("Fig_7A", ["7a"]),
        ("5_branch", ["5_branch"]),
        ("5", ["5abcd"]),
        ("all", ["3a", "5_branch", "5abcd", "7a", "7b", "s1"]),
    ],
)
def test_a_figure_goes_by_its_parts(word: str, names: list[str]):
    assert reproducing._names(word, ["3a", "5_branch", "5abcd", "7a", "7b", "s1"]) == names


@pytest.mark.parametrize("arguments", [(), ("9z",), ("x1", "fig_y"), ("all", "nonsense"), ("nonsense", "all")])
def test_unknown_figures_are_refused(shell: Shell, arguments: tuple[str, ...]):
    assert "x1, x2, or all" in one_complaint(shell("reproduce", *arguments))
    assert not Path("results").exists()


def test_all_experiments_are_known():
    folder = reproducing.experiments_folder()
    assert {"2", *("3a", "3b", "3c", "3d"), "4", "5abcd", "6", *("7a", "7b", "7c", "7d"), "s1", "s2"} <= {
        *reproducing.figure_names(folder)
    }
    assert (folder / "common.py").exists()


def test_without_experiments_it_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(reproducing, "__file__", str(tmp_path / "a" / "b" / "c" / "d.py"))
    assert "source tree" in one_complaint(Shell(capsys)("reproduce", "all"))
