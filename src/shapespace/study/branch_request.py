"""Which branch to follow, as it was asked for."""

from dataclasses import dataclass

import numpy as np

from shapespace.analysis.continuation import Stop
from shapespace.analysis.extended import Parameter
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.course import Course
from shapespace.study.measures import make_observable
from shapespace.study.scenario import Scenario

FARTHEST = 10.0
"""Times the way to the stop, or the key itself where that is larger: how far a branch that leaves another one may lead the other
way before it turns."""


@dataclass(frozen=True)
class Request:
    """Which branch to follow: from start to stop in a key, with exact points at `at`.

    free: the key that answers where `key` is an observable. at: values of the key, and (observable, value) pairs.

    origin: stored state to begin at, as text; without it the state of this name, or the default one, or where there is none
    the trivial one. side: 1 or -1 for either way along the other branch through a stored branch
    point, 0 for the branch itself. both: also the other way, as far as from start to stop on the other side. stability:
    growth rates at every point.
    """

    key: str
    start: float
    stop: float
    at: tuple[float | tuple[str, float], ...] = ()
    origin: str | None = None
    state: str | None = None
    side: int = 0
    both: bool = False
    stability: bool = True
    free: str | None = None

    def __post_init__(self) -> None:
        if self.side not in (-1, 0, 1):
            raise InputError(f"--side {self.side}: must be 1, -1 or 0; choose one of them.")
        if self.side and self.origin is None:
            raise InputError(f"--side {self.side}: needs a branch point to leave from; give it as --from STORE:LABEL.")
        if self.origin is not None and self.state is not None:
            raise InputError(f"--state {self.state} and --from {self.origin}: name two states; give only one.")
        if self.start == self.stop and not self.side:
            raise InputError(
                f"--stop {self.stop:g}: must differ from the start, {self.start:g}; choose another --stop."
            )
        at = (("--at", one if isinstance(one, float) else one[1]) for one in self.at)
        for name, value in (("--start", self.start), ("--stop", self.stop), *at):
            if not np.isfinite(value):
                raise InputError(f"{name} {value}: must be a finite number; give one.")
        low, high = min(self.bounds), max(self.bounds)
        for one in self.at:
            if isinstance(one, float) and not low <= one <= high:
                raise InputError(f"--at {one:g}: lies outside {low:g} to {high:g}; choose a value between.")

    @property
    def course(self) -> Course:
        """What varies."""
        return Course(self.key, self.free)

    @property
    def values(self) -> tuple[float, ...]:
        """Of what varies, where to stop."""
        return tuple(dict.fromkeys(one for one in self.at if isinstance(one, float) and one not in self.bounds))

    def stops(self, scenario: Scenario) -> list[Stop]:
        """The ends and the exact points."""
        stops = [Stop(Parameter(0), value, "end", ends=True) for value in self.bounds]
        stops += [Stop(Parameter(0), value, "user") for value in self.values]
        for name, value in (one for one in self.at if not isinstance(one, float)):
            stops.append(Stop(make_observable(scenario, name, self.course.moved), value, "user"))
        return stops

    @property
    def direction(self) -> float:
        """1 where the key rises from start to stop, else -1."""
        return 1.0 if self.stop >= self.start else -1.0

    @property
    def bounds(self) -> tuple[float, ...]:
        """Values of the key at which the branch ends: the stop, and one for a branch that does not come there."""
        way = self.stop - self.start
        reach = FARTHEST * max(abs(way), abs(self.start)) if self.side else abs(way) if self.both else 0.0
        return tuple(dict.fromkeys((self.stop, self.start - reach * float(np.sign(way)))))

    def ending(self, value: float) -> Outcome:
        """How a branch ends that comes to a bound."""
        return Outcome.REACHED_STOP if self.both or value == self.stop else Outcome.TURNED_BACK

    @property
    def span(self) -> float:
        """Change of the key that counts as one."""
        return abs(self.stop - self.start) or max(abs(self.stop), 1.0)
