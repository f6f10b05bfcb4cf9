"""The line about a running simulation."""

from dataclasses import replace

import pytest
from tests.study.fakes import make_frame

from shapespace.study import pace


def test_estimate_comes_from_the_last_frames_without_the_compilation(monkeypatch: pytest.MonkeyPatch):
    clock = iter([0.0, 60.0, 61.0, 62.0])
    monkeypatch.setattr(pace, "monotonic", lambda: next(clock))
    speed = pace.Pace(until=10.2)
    lines = [speed.describe(make_frame(number), number) for number in range(4)]
    assert lines[0].endswith("ETA unknown")
    assert lines[1].endswith("ETA unknown")
    assert lines[3] == "t = 0.3 of 10.2, 3 steps, neck_radius 0.25, height 2.3, ETA 1 min 39 s"


def test_steps_that_grow_are_taken_to_grow_on(monkeypatch: pytest.MonkeyPatch):
    """Doubling from 1 to 1023 takes ten steps, of which five are done in five seconds."""
    clock = iter(range(10))
    monkeypatch.setattr(pace, "monotonic", lambda: float(next(clock)))
    speed = pace.Pace(until=1023.0)
    lines = [speed.describe(replace(make_frame(0), time=2.0**number - 1.0), number) for number in range(6)]
    assert lines[-1].endswith("ETA 5 s")


def test_estimate_from_tiny_first_steps_is_not_shown(monkeypatch: pytest.MonkeyPatch):
    clock = iter([0.0, 1.0, 2.0])
    monkeypatch.setattr(pace, "monotonic", lambda: next(clock))
    speed = pace.Pace(until=1.0)
    lines = [speed.describe(make_frame(number, step=1e-9), number) for number in range(3)]
    assert lines[-1].endswith("ETA unknown")
