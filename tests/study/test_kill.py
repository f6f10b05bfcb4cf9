"""A real run that is killed at any moment and resumed ends in the same state."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from shapespace.base.outcome import Outcome
from shapespace.study.run import run
from shapespace.study.scenario import scenario
from shapespace.study.store import RunStore

SETTINGS = {"elements": 20, "until": 0.03, "mesh_tolerance": 1e-4}


def kill_after(store: Path, frames: int) -> None:
    """Start the run in a process of its own and kill it once it has stored so many frames."""
    text = [f"{key}={value}" for key, value in SETTINGS.items()]
    command = [
        sys.executable,
        "-m",
        "shapespace",
        "run",
        "guided-division",
        "-s",
        *text,
        "--out",
        str(store),
        "--resume",
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=dict(os.environ))
    deadline = time.monotonic() + 240.0
    while len(list(store.glob("frames/*.npz"))) < frames and process.poll() is None:
        assert time.monotonic() < deadline, "the run stored nothing"
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.mark.slow
def test_killed_twice_and_resumed_ends_in_the_same_state(tmp_path: Path) -> None:
    whole = run(scenario("guided-division", **SETTINGS))
    store = tmp_path / "killed"
    kill_after(store, 4)
    kill_after(store, 17)
    interrupted = len(list(store.glob("frames/*.npz")))
    assert 17 <= interrupted < whole.steps + 1, f"{interrupted} frames: killed too late to mean anything"
    resumed = run(scenario("guided-division", **SETTINGS), out=store, resume=True)
    assert resumed.outcome is whole.outcome is Outcome.REACHED_END
    assert resumed.steps == whole.steps
    last, expected = RunStore.open(store).read(-1), whole.frames[-1]
    for name in ("nodes", "scalars"):
        difference = np.abs(getattr(last, name) - getattr(expected, name)).max()
        assert difference < 1e-9, f"{name} differ by {difference:.1e}"
    assert abs(last.observables["energy_residual"] - expected.observables["energy_residual"]) < 1e-6
