"""Running and resuming, with a stand-in for the solver: what is stored, when nothing is done, what a kill costs."""

import errno
import os
from pathlib import Path

import pytest
from tests.study.fakes import STEPS, FakeSimulation, install

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.frame import Frame
from shapespace.study.run import HISTORY, free_path, run
from shapespace.study.scenario import scenario
from shapespace.study.store import RunStore

SCENARIO = scenario("guided-division", until=1.0, dt=0.1)


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> type[FakeSimulation]:
    return install(monkeypatch)


def test_run_stores_every_frame_and_its_outcome(tmp_path: Path, fake: type[FakeSimulation]):
    del fake
    seen: list[tuple[int, int]] = []

    def progress(_: Frame, steps: int) -> None:
        # Whoever hears of a frame finds it stored.
        seen.append((steps, len(RunStore.open(tmp_path / "run"))))

    result = run(SCENARIO, out=tmp_path / "run", progress=progress)
    store = RunStore.open(tmp_path / "run")
    assert (result.outcome, result.steps, result.store) == (Outcome.REACHED_END, STEPS, tmp_path / "run")
    assert (len(store), store.outcome) == (STEPS + 1, Outcome.REACHED_END)
    assert result.observables == {"time": 1.0, **store.read(-1).observables}
    assert result.wall_time >= 0
    assert seen == [(n, n + 1) for n in range(STEPS + 1)]


def test_run_without_store_keeps_its_frames(fake: type[FakeSimulation]):
    del fake
    result = run(SCENARIO)
    assert result.store is None
    assert [round(10 * frame.time) for frame in result.frames] == [*range(STEPS + 1)]
    with pytest.raises(InputError, match="needs the directory"):
        run(SCENARIO, resume=True)


def test_interrupted_run_is_resumed_from_its_last_frames(tmp_path: Path, fake: type[FakeSimulation]):
    fake.stops_at, fake.raises = 6, KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        run(SCENARIO, out=tmp_path / "run")
    assert RunStore.open(tmp_path / "run").outcome is None
    fake.stops_at, steps = None, []
    result = run(SCENARIO, out=tmp_path / "run", resume=True, progress=lambda _, number: steps.append(number))
    assert (result.outcome, result.steps, steps) == (Outcome.REACHED_END, STEPS, [6, 7, 8, 9, 10])
    assert fake.starts[-1][1] == pytest.approx([0.2, 0.3, 0.4, 0.5])
    assert len(fake.starts[-1][1]) == HISTORY


def test_resuming_where_there_is_nothing_starts(tmp_path: Path, fake: type[FakeSimulation]):
    del fake
    assert run(SCENARIO, out=tmp_path / "run", resume=True).steps == STEPS


@pytest.mark.parametrize("outcome", [Outcome.STATIONARY, Outcome.NECK_CLOSED, Outcome.REACHED_END])
def test_resuming_a_finished_run_does_nothing(tmp_path: Path, fake: type[FakeSimulation], outcome: Outcome):
    fake.ends_with = outcome
    first = run(SCENARIO, out=tmp_path / "run")
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*")}
    again = run(SCENARIO, out=tmp_path / "run", resume=True)
    assert (again.outcome, again.steps, again.observables) == (outcome, first.steps, first.observables)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*")} == before
    assert len(fake.starts) == 1


def test_resuming_with_a_later_end_goes_on(tmp_path: Path, fake: type[FakeSimulation]):
    run(SCENARIO, out=tmp_path / "run")
    longer = SCENARIO.with_overrides({"until": 2.0})
    result = run(longer, out=tmp_path / "run", resume=True)
    assert (result.steps, result.scenario) == (2 * STEPS, longer)
    assert run(SCENARIO, out=tmp_path / "run", resume=True).steps == 2 * STEPS
    assert len(fake.starts) == 2
    assert RunStore.open(tmp_path / "run").scenario == longer


def test_run_killed_after_its_last_frame_is_found_complete(tmp_path: Path, fake: type[FakeSimulation]):
    run(SCENARIO, out=tmp_path / "run")
    manifest = tmp_path / "run" / "store.json"
    manifest.write_text(
        manifest.read_text()
        .replace('"finished"', '"running"')
        .replace('"reached-end"', "null")
        .replace('"frames": 11', '"frames": null')
    )
    assert run(SCENARIO, out=tmp_path / "run", resume=True).outcome is Outcome.REACHED_END
    assert RunStore.open(tmp_path / "run").outcome is Outcome.REACHED_END
    assert len(fake.starts) == 1


def test_step_limit_counts_the_whole_run(tmp_path: Path, fake: type[FakeSimulation]):
    limited = SCENARIO.with_overrides({"max_steps": 4})
    for _ in range(2):
        result = run(limited, out=tmp_path / "run", resume=True)
        assert (result.outcome, result.steps) == (Outcome.MAX_STEPS, 4)
    assert len(fake.starts) == 1
    result = run(limited.with_overrides({"max_steps": 7}), out=tmp_path / "run", resume=True)
    assert (result.outcome, result.steps) == (Outcome.MAX_STEPS, 7)
    assert run(SCENARIO, out=tmp_path / "run", resume=True).outcome is Outcome.REACHED_END


def test_a_solver_that_gave_up_is_tried_again(tmp_path: Path, fake: type[FakeSimulation]):
    fake.ends_with, fake.stops_at = Outcome.STEP_UNDERFLOW, 3
    assert run(SCENARIO, out=tmp_path / "run").steps == 2
    fake.ends_with, fake.stops_at = Outcome.STATIONARY, None
    result = run(SCENARIO, out=tmp_path / "run", resume=True)
    assert (result.outcome, result.steps) == (Outcome.STATIONARY, STEPS)


def test_bad_directories_stop_a_run_before_it_computes(tmp_path: Path, fake: type[FakeSimulation]):
    (tmp_path / "thesis.tex").touch()
    for resume in (False, True):
        with pytest.raises(StoreError, match="holds other files"):
            run(SCENARIO, out=tmp_path, resume=resume)
    run(SCENARIO, out=tmp_path / "run")
    with pytest.raises(StoreError, match="holds a run already"):
        run(SCENARIO, out=tmp_path / "run")
    with pytest.raises(StoreError, match="friction is"):
        run(SCENARIO.with_overrides({"friction": 1.0}), out=tmp_path / "run", resume=True)
    assert len(fake.starts) == 1


def test_default_directories_are_numbered(tmp_path: Path, fake: type[FakeSimulation]):
    del fake
    for name in ("division", "division-2", "division-3"):
        path = free_path("division", tmp_path)
        assert path == tmp_path / name
        run(SCENARIO, out=path)
    (tmp_path / "division-4").mkdir()
    assert free_path("division", tmp_path) == tmp_path / "division-4"


def test_default_directory_that_cannot_be_looked_at_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(_: Path) -> bool:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "exists", refuse)
    with pytest.raises(StoreError, match="permission is missing"):
        free_path("division", tmp_path)
