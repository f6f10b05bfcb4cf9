"""Branches of stationary states: followed in one key of a scenario, with special points, stability and physical ends."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import MEMORY, Arclength, Continuation, start_point
from shapespace.analysis.passage import first_change, meets_mirror_image, passed_start
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_request import Request
from shapespace.study.branch_starts import FIRST_STEP, End, first_point, is_on, point_of, point_on
from shapespace.study.branch_store import START, Branch, BranchStore, collected
from shapespace.study.course import Course
from shapespace.study.engine import Engine
from shapespace.study.landmarks import Surveyor
from shapespace.study.manifests import holds_store
from shapespace.study.scenario import Scenario
from shapespace.study.settling import key_values
from shapespace.study.starts import Start, find_start

ENDS = (
    Outcome.REACHED_STOP,
    Outcome.TURNED_BACK,
    Outcome.OUT_OF_RANGE,
    Outcome.CLOSED,
    Outcome.REJOINED,
    Outcome.NECK_CLOSED,
    Outcome.SELF_CONTACT,
    Outcome.SELF_INTERSECTING,
)
"""A leg that came to one of these is complete."""


Progress = Callable[[BranchPoint, int], None]
"""Called after each new point with the point and the number of points so far."""


def branch(
    scenario: Scenario,
    key: str,
    stop: float,
    *,
    start: float | None = None,
    free: str | None = None,
    at: Sequence[float | tuple[str, float]] = (),
    origin: str | Path | None = None,
    state: str | None = None,
    side: int = 0,
    both: bool = False,
    stability: bool = True,
    out: str | Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    ready: Callable[[int], None] | None = None,
) -> Branch:
    """Follow the stationary state of a scenario while one key goes from start to stop, through folds; returns the Branch.

    With a key `free`, `key` may be an observable: it is prescribed, and the free key takes the value that this needs; growth
    rates are those under this control. at: exact values of the key, or (observable, value) pairs, to have points at.
    start: the key's value to begin with; without it the scenario's. The first state is the scenario's named one there, or
    what the stored state `origin` (`STORE` or `STORE:LABEL`) becomes; see `Request` for state, side, both and stability. `out` is
    the directory of the store, new or empty; with `resume` a store there is continued, to the same points as if it had
    never been interrupted. The outcome says how the branch ended. InputError before anything is computed.
    """
    known = find_start(origin) if origin is not None else None
    value = _first_value(scenario, Course(key, free), start, known)
    text = None if origin is None else str(origin)
    places = tuple((one[0], float(one[1])) if isinstance(one, tuple) else float(one) for one in at)
    request = Request(key, value, float(stop), places, text, state, side, both, stability, free)
    scenario = _checked(scenario, request, known)
    if out is None:
        if resume:
            raise InputError("resume = True: needs the directory of a stored branch; give it as out.")
        points: list[BranchPoint] = []
        end = _follow(scenario, request, known, points, points.append, progress)
        return replace(collected(scenario, key, free, points, end.outcome, None), detail=end.detail)
    described = {**asdict(request), "at": [list(one) if isinstance(one, tuple) else one for one in request.at]}
    begin = BranchStore.resume if resume and holds_store(out) else BranchStore.create
    with begin(out, scenario, described) as store:
        points = [*store]
        if ready is not None:
            ready(len(points))

        def keep(point: BranchPoint) -> None:
            store.append(point)
            points.append(point)

        if store.outcome in ENDS:
            return collected(scenario, key, free, points, store.outcome, store.path)
        end = _follow(scenario, request, known, points, keep, progress)
        if not points:
            store.discard()
            return replace(collected(scenario, key, free, points, end.outcome, None), detail=end.detail)
        store.finish(end.outcome)
        return replace(collected(scenario, key, free, points, end.outcome, store.path), detail=end.detail)


def _first_value(scenario: Scenario, course: Course, start: float | None, known: Start | None) -> float:
    course.check(scenario)
    if start is not None:
        return float(start)
    if known is not None and known.key == course.key and known.point is not None:
        return known.point.parameter
    if known is not None and course.free is None and course.key in known.keys:
        return float(key_values(known.scenario, (course.key,))[0])
    if course.free is not None:
        raise InputError(f"--vary {course.key}: is an observable; give the value to start at as --start.")
    return float(key_values(scenario, (course.key,))[0])


def _checked(scenario: Scenario, request: Request, known: Start | None) -> Scenario:
    """The scenario at the start; InputError where a value, or the stored start, is not possible."""
    for value in (request.stop, *request.values) if request.free is None else ():
        scenario.with_overrides({request.key: value})
    request.stops(scenario)  # an InputError where an observable is none
    if request.side:
        point = known.point if known is not None else None
        if point is None or known is None or not is_on(known, request) or point.kind not in {*Kind} - {Kind.FOLD}:
            raise InputError(
                f"--from {request.origin}: is no pitchfork, transcritical or branch point in {request.key}, so that no other "
                "branch leaves there; choose another label, or --side 0."
            )
    if request.free is None:
        scenario = scenario.with_overrides({request.key: request.start})
    if known is not None:
        known.check_fits(scenario)
    return scenario


def _follow(
    scenario: Scenario,
    request: Request,
    known: Start | None,
    done: Sequence[BranchPoint],
    keep: Callable[[BranchPoint], None],
    progress: Progress | None,
) -> End:
    """Compute what is missing of a branch of which the points `done` are there; `keep` lengthens them."""
    surveyor = Surveyor(scenario, request.course, request.stability, done)

    def record(point: BranchPoint) -> None:
        keep(point)
        if progress is not None:
            progress(point, len(done))

    outcome = None
    for leg in (0, 1) if request.both else (0,):
        if not done:
            first = first_point(scenario, request, known)
            if isinstance(first, End):
                return first
            record(surveyor.start(*first))
        ended = next((Outcome(point.ends) for point in done if point.leg == leg and point.ends), None)
        # A leg that gave up is tried again by a resumed call, unless the other one follows it in the store.
        if ended is None or (ended not in ENDS and not any(point.leg > leg for point in done)):
            past = _past(surveyor, request, done, leg)
            for point in _leg(surveyor, request, past, leg, done):
                record(point)
            ended = surveyor.outcome
        outcome = ended if outcome is None or not ended.is_success else outcome
        if ended is Outcome.CLOSED:
            break
    assert outcome is not None
    return End(outcome)


def _leg(
    surveyor: Surveyor, request: Request, past: list[Point], leg: int, done: Sequence[BranchPoint]
) -> Iterator[BranchPoint]:
    """New records of one leg: special points before the point after them; in the end `surveyor.outcome` says why."""
    surveyor.begin(leg, done)
    if (end := surveyor.end_of(past[-1])) is not None:
        surveyor.outcome = end
        yield surveyor.end(past[-1], past[-1], end)
        return
    options = Arclength(first=FIRST_STEP, parameter_scale=request.span)
    continuation = Continuation(past, request.stops(surveyor.scenario), options)
    start, last = _first(surveyor, request, done, leg), past[-1]
    is_mirrored = meets_mirror_image(start)
    for point in continuation:
        end = surveyor.end_of(point)
        if end is not None:
            inside, outside = first_change(last, point, lambda place: surveyor.end_of(place) is not None)
            yield from surveyor.between(last, point, inside.arclength)
            end = surveyor.end_of(outside) or end
            # The last shape that does not pass through itself is, to the accuracy of the bisection, the first that touches.
            surveyor.outcome = end = Outcome.SELF_CONTACT if end is Outcome.SELF_INTERSECTING else end
            yield surveyor.end(inside, outside, end)
            return
        if (passed := passed_start(start, last, point)) is not None:
            yield from surveyor.between(last, point, passed)
            surveyor.outcome = Outcome.CLOSED
            again = replace(start, arclength=passed, step=point.step)
            yield surveyor.end(again, again, Outcome.CLOSED)
            return
        for special in surveyor.between(last, point):
            if is_mirrored and meets_mirror_image(point_on(surveyor.scenario, request.course, special)[1]):
                surveyor.outcome = Outcome.REJOINED
                yield replace(special, ends=Outcome.REJOINED.value)
                return
            yield special
        surveyor.outcome = request.ending(point.parameter) if point.label == "end" else Outcome.MAX_STEPS
        yield surveyor.step(point, surveyor.outcome if point.label == "end" else None)
        last = point
    if continuation.outcome is not Outcome.REACHED_STOP:
        surveyor.outcome = continuation.outcome or Outcome.MAX_STEPS
    if surveyor.outcome is Outcome.BRANCH_STALLED:
        yield surveyor.end(last, last, surveyor.outcome)


def _first(surveyor: Surveyor, request: Request, done: Sequence[BranchPoint], leg: int) -> Point:
    """Where a leg starts."""
    stored = next(point for point in done if point.label == START)
    _, start = point_on(surveyor.scenario, request.course, stored)
    return start.reversed() if leg else start


def _past(surveyor: Surveyor, request: Request, done: Sequence[BranchPoint], leg: int) -> list[Point]:
    """The last steps of a leg as points, those on equal meshes on one problem."""
    start = next(point for point in done if point.label == START)
    steps = [point for point in done if point.leg == leg and point.is_step and point.label != START]
    chosen = [start, *steps][-MEMORY:]
    problem, points = surveyor.course.problem(surveyor.scenario), []
    for point in chosen:
        if not np.array_equal(problem.base.mesh, point.frame.mesh):
            mesh = Engine.of(surveyor.scenario).problem.on_mesh(point.frame.mesh)
            problem = surveyor.course.problem(surveyor.scenario, mesh)
        points.append(point_of(problem, point))
    if leg and chosen[0] is start:
        options = Arclength(first=FIRST_STEP, parameter_scale=request.span)
        first = start_point(points[0].problem, points[0].x, points[0].p, 0, options=options, tangent=-points[0].tangent)
        assert isinstance(first, Point)
        points[0] = first
    return points
