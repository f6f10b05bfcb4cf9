"""The command `search`, with the real solver on the swimming sphere."""

import json
from pathlib import Path

import pytest
from tests.shell import Shell, one_complaint

SEARCH = ("search", "polar-swimmer", "-s", "elements=20", "peclet=24")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_search_lists_states_and_what_was_tried(shell: Shell):
    answer = shell(*SEARCH, "--starts", "5", "--json", "--out", "states")
    assert answer.status == 0, answer.err
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (record["outcome"], record["store"], len(record["tried"])) == ("max-starts", "states", 5)
    assert [(one["label"], one["n_unstable"], one["has_mirror_image"]) for one in record["states"]] == [
        ("state-1", 1, False),
        ("state-2", 0, True),
    ]
    assert {"start", "outcome", "state", "iterations", "residual"} == record["tried"][0].keys()
    assert abs(record["states"][1]["observables"]["velocity"]) > 1.0
    assert "start 1 (reference): state-1, n_unstable 1" in answer.err
    text = shell(*SEARCH, "--starts", "5", "--resume", "--out", "states").out
    assert "state-2" in text
    assert "5 starts: " in text
    steady = json.loads(shell("steady", *SEARCH[1:], "--from", "states:state-2", "--json").out)
    assert steady["n_unstable"] == 0


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--starts", "0"], "must be at least 1"),
        (["--starts", "x"], "x"),
        (["--out", "foreign"], "holds other files"),
        (["--from", "foreign"], "holds no run"),
        (["-s", "turnover_rate=0"], "turnover_rate = 0"),
    ],
)
def test_bad_search_is_one_line(shell: Shell, arguments: list[str], part: str):
    Path("foreign").mkdir()
    Path("foreign/thesis.tex").write_text("precious")
    assert part in one_complaint(shell(*SEARCH, *arguments))
    assert [str(file) for file in Path().rglob("*") if file.is_file()] == ["foreign/thesis.tex"]
