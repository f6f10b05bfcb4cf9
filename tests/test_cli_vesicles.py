"""The scenario `vesicle` from the command line: states by name, what there is not, and all states at one volume."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.shell import Shell, one_complaint


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_states_by_name(shell: Shell):
    """An oblate with its parities; the flattest ones are said to pass through themselves; no cups above their fold."""
    command = ("steady", "vesicle", "--json", "-s")
    record = json.loads(shell(*command, "reduced_volume=0.8", "--state", "oblate").out, parse_constant=pytest.fail)
    assert (record["outcome"], record["n_unstable"]) == ("converged", 0)
    assert {*record["parities"]} == {"symmetric", "antisymmetric"}
    seen = record["observables"]
    assert seen["area"] == pytest.approx(4.0 * np.pi, rel=1e-12)
    assert seen["reduced_volume"] == pytest.approx(0.8, rel=1e-12)
    assert seen["tension"] == seen["tension_pole"] == pytest.approx(0.5 * 0.8 * seen["pressure"])
    flat = json.loads(shell(*command, "reduced_volume=0.48", "--state", "oblate").out)
    assert flat["outcome"] == "self-intersecting"
    answer = shell(*command, "reduced_volume=0.7", "--state", "stomatocyte")
    assert (answer.status, json.loads(answer.out)["outcome"]) == (3, "no-state")
    assert "reach up to 0.66" in answer.err


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--state", "trivial"], "choose one of default, prolate, oblate, stomatocyte"),
        (["--state", "cup"], "choose one of default, prolate, oblate, stomatocyte"),
        (["-s", "reduced_volume=1"], "must be < 1"),
        (["-s", "reduced_volume=0"], "must be > 0"),
        (["-s", "tension=1"], "unknown key in a vesicle scenario"),
        (["-s", "initial_leaning=1"], "must be < 1"),
    ],
)
def test_bad_requests_are_one_line(shell: Shell, arguments: list[str], part: str):
    assert part in one_complaint(shell("steady", "vesicle", *arguments))
    assert "choose one of default, trivial" in one_complaint(shell("steady", "polar-swimmer", "--state", "oblate"))


@pytest.mark.slow
def test_search_finds_all_three(shell: Shell):
    """At v = 0.6: prolate, oblate and stomatocyte, and states that are not stable."""
    found = json.loads(shell("search", "vesicle", "-s", "reduced_volume=0.6", "--starts", "12", "--json").out)
    energies = sorted(state["observables"]["bending_energy"] for state in found["states"])
    assert len(energies) >= 4
    assert [state["n_unstable"] for state in found["states"]].count(0) == 3
