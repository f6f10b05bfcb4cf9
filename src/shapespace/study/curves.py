"""Curves of folds and branch points in two keys of a scenario, with special points and physical ends."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import MEMORY, Arclength, Continuation, Stop
from shapespace.analysis.curves import (
    NotFound,
    Special,
    own_parameter,
    start_curve,
    traced_curve,
)
from shapespace.analysis.extended import Parameter
from shapespace.analysis.passage import first_change, passed_start
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_starts import FIRST_STEP
from shapespace.study.branch_store import START
from shapespace.study.curve_recorder import Recorder
from shapespace.study.curve_store import Curve, CurvePoint, CurveStore, collected
from shapespace.study.engine import state_of
from shapespace.study.keyed import KeyedProblem
from shapespace.study.keys import MODELS
from shapespace.study.manifests import holds_store
from shapespace.study.scenario import Scenario
from shapespace.study.settling import key_values
from shapespace.study.starts import Start, find_start

AT_VALUE = 1e-9
"""A start this near to a bound, relative to it (or one), is there."""
SIDEWAYS = 1e-6
"""A curve whose second key changes less than this along its unit tangent turns there: both ways lead to one side."""
KINDS = tuple(str(kind) for kind in Kind)

Progress = Callable[[CurvePoint, int], None]
"""Called after each new point with the point and the number of points so far."""


@dataclass(frozen=True)
class Request:
    """Which curve to follow, from the stored point `origin`, in two keys: that of the branch, and another from start to stop.

    value: of the other key at the origin. at: its values for exact points. within: values of the first key, where it leaves
    which the curve ends.
    """

    origin: str
    keys: tuple[str, str]
    value: float
    start: float
    stop: float
    at: tuple[float, ...] = ()
    within: tuple[float, float] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        for name, one in (("--start", self.start), ("--stop", self.stop), *(("--at", one) for one in self.at)):
            if not np.isfinite(one):
                raise InputError(f"{name} {one}: must be a finite number; give one.")
        if self.start == self.stop:
            raise InputError(f"--stop {self.stop:g}: must differ from the start; choose another --stop.")
        low, high = sorted((self.start, self.stop))
        near = AT_VALUE * max(abs(self.value), 1.0)
        if not low - near <= self.value <= high + near:
            raise InputError(
                f"--start {self.start:g} --stop {self.stop:g}: must include {self.keys[1]} = {self.value!r}, where "
                f"{self.origin} is; choose another --start or --stop."
            )
        for one in self.at:
            if not low <= one <= high:
                raise InputError(f"--at {one:g}: lies outside {low:g} to {high:g}; choose a value between.")

    def described(self, kind: str) -> dict[str, Any]:
        """For a store. kind: of the points."""
        about = {"keys": [*self.keys], "of": str(kind), "origin": self.origin, "start": self.start, "stop": self.stop}
        return {**about, "at": [*self.at]}

    def is_at(self, bound: float) -> bool:
        """Whether the curve begins at a bound."""
        return abs(self.value - bound) <= AT_VALUE * max(abs(self.value), 1.0)

    @property
    def direction(self) -> float:
        """Of the first leg: 1 where the new key rises, else -1."""
        goal = self.start if self.is_at(self.stop) else self.stop
        return 1.0 if goal > self.value else -1.0

    def legs(self, first: CurvePoint) -> tuple[int, ...]:
        """One leg where the curve begins at a bound, unless it turns there."""
        is_once = self.is_at(self.start) or self.is_at(self.stop)
        return (0,) if is_once and abs(first.tangent[-1]) * self.options.parameter_scale > SIDEWAYS else (0, 1)

    @property
    def options(self) -> Arclength:
        """Of the steps."""
        return Arclength(first=FIRST_STEP, parameter_scale=abs(self.stop - self.start))

    @property
    def stops(self) -> list[Stop]:
        """Of the new key."""
        bounds = [Stop(Parameter(1), value, "end", ends=True) for value in (self.stop, self.start)]
        inner = [value for value in dict.fromkeys(self.at) if value not in (self.start, self.stop)]
        return bounds + [Stop(Parameter(1), value, "user") for value in inner]


def curve(
    origin: str | Path,
    key: str,
    stop: float,
    *,
    start: float | None = None,
    at: Sequence[float] = (),
    out: str | Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    ready: Callable[[int], None] | None = None,
) -> Curve:
    """Follow a stored fold or branch point while a second key goes through [start, stop]; returns the Curve.

    origin: `STORE:LABEL` of a branch or of a curve, where the second key's value must lie in that range; without a start it
    begins there. Where it lies inside, the curve is followed both ways. `out`, `resume`: as of `branch`. The outcome says how
    the curve ended. InputError before anything is computed.
    """
    known = find_start(origin)
    request = _request(known, key, stop, start, at)
    scenario, singular = known.scenario, _singular(known, request)
    if out is None:
        if resume:
            raise InputError("resume = True: needs the directory of a stored curve; give it as out.")
        points: list[CurvePoint] = []
        outcome = _follow(scenario, request, singular, points, points.append, progress)
        return collected(scenario, request.keys, points, outcome, None)
    described = request.described(singular.kind)
    begin = CurveStore.resume if resume and holds_store(out) else CurveStore.create
    with begin(out, scenario, described) as store:
        points = [*store]
        if ready is not None:
            ready(len(points))

        def keep(point: CurvePoint) -> None:
            store.append(point)
            points.append(point)

        if store.outcome is None or not store.outcome.is_success:
            outcome = _follow(scenario, request, singular, points, keep, progress)
            if not points:
                store.discard()
                return collected(scenario, request.keys, points, outcome, None)
            store.finish(outcome)
        return collected(scenario, request.keys, points, store.outcome, store.path)


def curve_through(
    scenario: Scenario,
    point: SingularPoint,
    bounds: tuple[tuple[float, float], tuple[float, float]],
    out: Path,
    origin: str,
) -> Curve:
    """The curve of a fold or branch point within bounds of both keys, stored in a new directory.

    point: of a KeyedProblem of two keys, in the first of which it is one; `scenario` has their values there. origin: what it is,
    in words.
    """
    problem = point.problem
    assert isinstance(problem, KeyedProblem)
    first, second = problem.keys
    request = Request(origin, (first, second), float(point.p[1]), *bounds[1], within=bounds[0])
    points: list[CurvePoint] = []
    with CurveStore.create(out, scenario, request.described(point.kind)) as store:

        def keep(one: CurvePoint) -> None:
            store.append(one)
            points.append(one)

        outcome = _follow(scenario, request, point, points, keep, None)
        store.finish(outcome)
    return collected(scenario, request.keys, points, outcome, out)


def _request(known: Start, key: str, stop: float, start: float | None, at: Sequence[float]) -> Request:
    """What to follow; InputError where that is not possible."""
    if known.key is None or known.point is None or known.point.kind not in KINDS:
        raise InputError(
            f"{known.text}: is no fold or branch point; give STORE:LABEL of one (labels: {', '.join(KINDS)})."
        )
    if known.key not in known.keys:
        raise InputError(
            f"{known.text}: is of a branch in {known.key}, an observable; start from one in {known.keys[0]}."
        )
    if key in (known.key, MODELS[known.scenario.model].rival_of(known.key)):
        raise InputError(f"--vary {key}: varies along the branch already; choose another key.")
    KeyedProblem.of(known.scenario, (known.key, key))  # an InputError where the key cannot vary
    value = float(key_values(known.scenario, (key,))[0])
    first = value if start is None else float(start)
    request = Request(known.text, (known.key, key), value, first, float(stop), tuple(map(float, at)))
    for one in (request.start, request.stop):
        known.scenario.with_overrides({key: one})
    return request


def _follow(
    scenario: Scenario,
    request: Request,
    origin: SingularPoint,
    done: Sequence[CurvePoint],
    keep: Callable[[CurvePoint], None],
    progress: Progress | None,
) -> Outcome:
    """Compute what is missing of a curve of which the points `done` are there; `keep` lengthens them."""
    recorder = Recorder(scenario, request.keys, str(origin.kind), done, request.within)

    def record(point: CurvePoint) -> None:
        keep(point)
        if progress is not None:
            progress(point, len(done))

    if not done:
        first = start_curve(origin, 1, request.direction, request.options)
        if isinstance(first, Outcome):
            return first
        record(recorder.record(first, START, (origin.parameter_error, 0.0)))
    outcome = Outcome.REACHED_STOP
    for leg in request.legs(done[0]):
        ended = next((Outcome(point.ends) for point in done if point.leg == leg and point.ends), None)
        if ended is None or not ended.is_success:
            ended = Outcome.MAX_STEPS
            for point in _leg(recorder, request, leg, done):
                record(point)
                ended = Outcome(point.ends) if point.ends else ended
        outcome = ended if outcome in (Outcome.REACHED_STOP, Outcome.CLOSED) else outcome
        if ended is Outcome.CLOSED:
            break
    return outcome


def _leg(recorder: "Recorder", request: Request, leg: int, done: Sequence[CurvePoint]) -> Iterator[CurvePoint]:
    """New records of one leg, special points before the point after them."""
    past, stored = _past(recorder, leg, done)
    start, last = recorder.point(done[0]), past[-1]
    recorder.leg = leg
    if (end := recorder.end(last)) is not None:
        yield recorder.record(last, end.value, ends=end, is_step=False)
        return
    continuation = Continuation(past, request.stops, request.options)
    found: list[Special] = []
    for one in traced_curve(continuation):
        if isinstance(one, NotFound):
            recorder.miss(one)
            continue
        if isinstance(one, Special):
            found.append(one)
            continue
        inside, outside, end = last, one, recorder.end(one)
        if end is not None:
            inside, outside = first_change(last, one, lambda place: recorder.end(place) is not None)
            end = recorder.end(outside) or end
            # The last shape that does not pass through itself is, to the accuracy of the bisection, the first that touches.
            end = Outcome.SELF_CONTACT if end is Outcome.SELF_INTERSECTING else end
        before = [special for special in found if end is None or special.point.arclength <= inside.arclength]
        for special in islice(before, stored, None):
            yield recorder.record(special.point, special.kind, special.errors, is_step=False)
        found, stored = [], 0
        if end is not None:
            miss = (abs(own_parameter(outside) - own_parameter(inside)), abs(outside.parameter - inside.parameter))
            yield recorder.record(inside, end.value, miss, ends=end, is_step=False)
            return
        if (passed := passed_start(start, last, one)) is not None:
            again = replace(start, arclength=passed)
            yield recorder.record(again, Outcome.CLOSED.value, ends=Outcome.CLOSED, is_step=False)
            return
        yield recorder.record(one, one.label, ends=Outcome.REACHED_STOP if one.label == "end" else None)
        last = one
    if continuation.outcome is Outcome.BRANCH_STALLED:
        yield recorder.record(last, continuation.outcome.value, ends=continuation.outcome, is_step=False)


def _singular(known: Start, request: Request) -> SingularPoint:
    """A stored fold or branch point as one in both keys."""
    point = known.point
    assert point is not None
    problem = KeyedProblem.of(known.scenario, request.keys)
    base = replace(problem, base=problem.base.on_mesh(point.frame.mesh))
    x = base.base.pack(state_of(point.frame))
    kernel = point.directions
    if point.kind == Kind.FOLD:
        along = point.tangent[:-1]
        kernel = along[None] / np.sqrt(base.weights(x) @ along**2)
    p = np.array([point.parameter, request.value])
    return SingularPoint(Kind(point.kind), base, 0, x, p, point.parameter_error, kernel, point.directions)


def _past(recorder: "Recorder", leg: int, done: Sequence[CurvePoint]) -> tuple[list[Point], int]:
    """The last steps of a leg as points, and how many special points are stored after them."""
    places = [0, *(i for i, point in enumerate(done) if i and point.leg == leg and point.is_step)][-MEMORY:]
    stored = sum(point.leg == leg and not point.ends for point in done[places[-1] + 1 :])
    points = [recorder.point(done[i]) for i in places]
    if leg and places[0] == 0:
        points[0] = points[0].reversed()
    return points, stored
