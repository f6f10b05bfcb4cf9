"""What the command line says where stability or a branch could not be computed: said, kept, never guessed."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from tests.shell import Shell

from shapespace.analysis import continuation
from shapespace.analysis.stability import Spectral
from shapespace.base.outcome import Outcome
from shapespace.numerics.newton import Root
from shapespace.study import spectra

SPHERE = ("polar-swimmer", "-s", "elements=20", "--state", "trivial")
BRANCH = ("branch", *SPHERE, "--vary", "peclet", "--start", "21", "--stop", "23", "--json", "--out", "sphere")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_growth_rates_that_do_not_converge_are_no_growth_rates(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    """The sphere at Pe = 30 is unstable; what is too little work to find that out must not call it stable."""
    monkeypatch.setattr(spectra, "Spectral", partial(Spectral, max_dimension=18, max_attempts=1))
    answer = shell("steady", *SPHERE, "-s", "peclet=30", "--json")
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (answer.status, record["outcome"], record["n_unstable"]) == (0, "converged", None)
    assert "the growth rates are not known (eigenvalues-unconverged): The leading growth rates did not" in answer.err
    assert "stability unknown" in shell("steady", *SPHERE, "-s", "peclet=30").out
    answer = shell(*BRANCH)
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (answer.status, record["outcome"]) == (0, "reached-stop")
    assert {point["n_unstable"] for point in record["points"]} == {None}
    assert {one["n_unstable_after"] for one in record["special_points"]} == {None}
    assert "the growth rates of" in answer.err


def test_a_branch_that_stalls_keeps_its_points_and_goes_on(shell: Shell, monkeypatch: pytest.MonkeyPatch):
    """Newton's method is made to fail beyond Pe = 21.7, until the branch is resumed."""
    solve = continuation.solve_root

    def failing(problem: Any, guess: Any, *rest: Any) -> Root:
        root = solve(problem, guess, *rest)
        return root if guess[-1] < 21.7 else replace(root, outcome=Outcome.DIVERGED)

    with monkeypatch.context() as patch:
        patch.setattr(continuation, "solve_root", failing)
        answer = shell(*BRANCH, "--no-stability")
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (answer.status, record["outcome"]) == (3, "branch-stalled")
    assert "loosen tolerances" in record["advice"]
    assert "the branch ended early (branch-stalled)" in answer.err
    assert "What there is is in sphere" in answer.err
    (end,) = record["special_points"]
    assert (end["kind"], end["parameter"]) == ("branch-stalled", pytest.approx(21.7, abs=1e-6))
    answer = shell(*BRANCH, "--no-stability", "--resume")
    assert (answer.status, json.loads(answer.out)["outcome"]) == (0, "reached-stop")


def test_no_state_beyond_a_fold(shell: Shell):
    """The undivided branch of Fig. 7b ends at the fold at 2.3625: stepping stops short of it and does not jump."""
    ring = ("steady", "guided-division", "-s", "elements=40")
    assert shell(*ring, "ring_amplitude=2.2", "--out", "before").status == 0
    answer = shell(*ring, "ring_amplitude=3", "--from", "before", "--json")
    record = json.loads(answer.out, parse_constant=pytest.fail)
    assert (answer.status, record["outcome"], record["observables"]) == (3, "not-reached", {})
    assert "follow the branch" in record["advice"]
    reached = float(answer.err.split("at ring_amplitude = ")[1].rstrip(".\n"))
    assert 2.35 < reached < 2.3625
