"""How a running simulation gets on: one line of text with the state and an estimate of the time left."""

import math
from collections import deque
from time import monotonic

import numpy as np

from shapespace.study.frame import Frame

# The radius that tells most, then the height.
_RADII = ("neck_radius", "equator_radius")

# An estimate beyond this many seconds comes from the first tiny steps and says nothing.
_LONGEST = 24 * 3600
# Steps that grow by less than this part at a time have one size.
_STEADY = 1e-3


class Pace:
    """The speed of the last frames, in steps per second of the clock, and how their steps have grown."""

    def __init__(self, until: float) -> None:
        self.until = until
        self._marks: deque[tuple[float, float]] = deque(maxlen=20)

    def describe(self, frame: Frame, steps: int) -> str:
        """Time, steps, main observables and ETA after a new frame."""
        self._marks.append((monotonic(), frame.time))
        values = frame.observables
        names = [*[name for name in _RADII if name in values][:1], *[name for name in ("height",) if name in values]]
        parts = [f"t = {frame.time:.4g} of {self.until:g}", f"{steps} steps"]
        return ", ".join([*parts, *(f"{name} {values[name]:.4g}" for name in names), self._eta()])

    def _eta(self) -> str:
        # The oldest mark is left out: before the second frame there was compilation.
        clocks, times = np.array(list(self._marks)[1:]).reshape(-1, 2).T
        steps = np.diff(times)
        if not len(steps) or steps.min() <= 0.0:
            return "ETA unknown"
        # Steps that have grown are taken to grow on by the same factor: then their number rises with the logarithm of the time.
        growth = float(np.log(steps[-1] / steps[0])) / max(len(steps) - 1, 1)
        left = max(0.0, self.until - float(times[-1])) / float(steps[-1])
        count = math.log1p(left * math.expm1(growth) * math.exp(-growth)) / growth if growth > _STEADY else left
        seconds = count * float(clocks[-1] - clocks[0]) / len(steps)
        if not seconds <= _LONGEST:
            return "ETA unknown"
        minutes, seconds = divmod(round(seconds), 60)
        return f"ETA {minutes} min {seconds} s" if minutes else f"ETA {seconds} s"
