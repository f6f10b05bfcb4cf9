"""How a running simulation gets on: one line of text with the state and an estimate of the time left."""

import math
from collections import deque
from time import monotonic

from shapespace.study.frame import Frame

# The radius that tells most, then the height.
_RADII = ("neck_radius", "equator_radius")

# An estimate beyond this many seconds comes from the first tiny steps and says nothing.
_LONGEST = 24 * 3600


class Pace:
    """The speed of the last frames, in scenario time per second of the clock; adaptive steps make it vary."""

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
        (begin, first), (now, time) = self._marks[min(1, len(self._marks) - 1)], self._marks[-1]
        seconds = max(0.0, self.until - time) * (now - begin) / (time - first) if time > first else math.inf
        if seconds > _LONGEST:
            return "ETA unknown"
        minutes, seconds = divmod(round(seconds), 60)
        return f"ETA {minutes} min {seconds} s" if minutes else f"ETA {seconds} s"
