"""A stand-in for the solver: frames of the right shapes at once, so that what surrounds it can be tested by itself."""

import sys
import time
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import ClassVar

import numpy as np
import pytest

from shapespace.base.outcome import Outcome
from shapespace.study.frame import Frame
from shapespace.study.scenario import Scenario

STEPS = 10


def make_frame(number: int, step: float = 0.1, elements: int = 60) -> Frame:
    """Frame `number` of a made-up run, with the shapes of a closed surface; the same each time."""
    random = np.random.default_rng(number)
    return Frame(
        time=number * step,
        step=step if number else 0.0,
        next_step=step,
        mesh=np.linspace(0.0, 1.0, elements + 1),
        nodes=random.normal(size=(elements + 1, 12)),
        slopes=random.normal(size=(elements, 4, 12)),
        algebraic=random.normal(size=(elements, 4, 2)),
        scalars=random.normal(size=3),
        rates=random.normal(size=(elements, 4, 2)).astype(np.float32).astype(np.float64),
        observables={"height": 2.0 + 0.1 * number, "neck_radius": 1.0 / (1 + number)},
    )


class FakeSimulation:
    """Takes STEPS equal steps to the end; what it does besides is set on the class."""

    ends_with: Outcome = Outcome.REACHED_END
    stops_at: int | None = None
    raises: BaseException | None = None
    pause: float = 0.0
    observables: ClassVar[dict[str, float]] = {}
    starts: ClassVar[list[tuple[Scenario, list[float]]]] = []

    def __init__(self, scenario: Scenario, history: Sequence[Frame] = (), start: Frame | None = None) -> None:
        del start
        self.scenario = scenario
        self.history = history
        self.outcome: Outcome | None = None
        self.starts.append((scenario, [frame.time for frame in history]))

    def __iter__(self) -> Iterator[Frame]:
        settings = self.scenario.run
        step = settings.dt or settings.until / STEPS
        first = round(self.history[-1].time / step) + 1 if self.history else 0
        taken = 0
        for number in range(first, round(settings.until / step) + 1):
            if taken >= settings.max_steps:
                self.outcome = Outcome.MAX_STEPS
                return
            taken += number > 0
            if self.stops_at == number:
                if self.raises is not None:
                    raise self.raises
                break
            time.sleep(self.pause)
            frame = make_frame(number, step)
            frame.observables.update(self.observables)
            yield frame
        self.outcome = self.ends_with


def install(patch: pytest.MonkeyPatch | None = None) -> type[FakeSimulation]:
    """Put a fresh FakeSimulation in the place of the solver, for one test or for this process."""
    fake = type("Simulation", (FakeSimulation,), {"starts": []})
    module = ModuleType("shapespace.study.simulation")
    module.Simulation = fake
    if patch is None:
        sys.modules[module.__name__] = module
    else:
        patch.setitem(sys.modules, module.__name__, module)
    return fake
