"""Branches of stationary states: followed in one key of a scenario, with special points, stability and physical ends."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import MEMORY, Arclength, Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.analysis.passage import first_change, meets_mirror_image, passed_start
from shapespace.analysis.tracing import side_branches
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_request import Request
from shapespace.study.branch_store import START, Branch, BranchStore, collected
from shapespace.study.course import Course
from shapespace.study.engine import Engine, state_of
from shapespace.study.keyed import HeldProblem, KeyedProblem
from shapespace.study.landmarks import Surveyor, physical_end
from shapespace.study.paths import MAX_POINTS, StateName, state_names
from shapespace.study.records import holds_store
from shapespace.study.scenario import Scenario
from shapespace.study.settling import key_values
from shapespace.study.starts import Start, find_start
from shapespace.study.steady import Steady, steady, steady_near

FIRST_STEP = 0.02
ENDS = (
    Outcome.REACHED_STOP,
    Outcome.CLOSED,
    Outcome.REJOINED,
    Outcome.NECK_CLOSED,
    Outcome.SELF_CONTACT,
    Outcome.SELF_INTERSECTING,
)
"""A leg that came to one of these is complete."""


class _End(NamedTuple):
    """Why a computation is over, and what is to be said of a start that failed."""

    outcome: Outcome
    detail: str = ""


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

        detail = ""
        if store.outcome not in ENDS:
            end = _follow(scenario, request, known, points, keep, progress)
            store.finish(end.outcome)
            detail = end.detail
        return replace(collected(scenario, key, free, points, store.outcome, store.path), detail=detail)


def _first_value(scenario: Scenario, course: Course, start: float | None, known: Start | None) -> float:
    course.check(scenario)
    if start is not None:
        return float(start)
    if known is not None and known.key == course.key and known.point is not None:
        return known.point.parameter
    if course.free is not None:
        raise InputError(f"--vary {course.key}: is an observable; give the value to start at as --start.")
    return float(key_values(scenario, (course.key,))[0])


def _checked(scenario: Scenario, request: Request, known: Start | None) -> Scenario:
    """The scenario at the start; InputError where a value, or the stored start, is not possible."""
    for value in {request.stop, *request.values, *request.bounds} if request.free is None else ():
        scenario.with_overrides({request.key: value})
    request.stops(scenario)  # an InputError where an observable is none
    if request.side:
        point = known.point if known is not None else None
        if point is None or known is None or not _is_on(known, request) or point.kind not in {*Kind} - {Kind.FOLD}:
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
) -> _End:
    """Compute what is missing of a branch of which the points `done` are there; `keep` lengthens them."""
    surveyor = Surveyor(scenario, request.course, request.stability, done)

    def record(point: BranchPoint) -> None:
        keep(point)
        if progress is not None:
            progress(point, len(done))

    outcome = Outcome.REACHED_STOP
    for leg in (0, 1) if request.both else (0,):
        if not done:
            first = _start(scenario, request, known)
            if isinstance(first, _End):
                return first
            record(surveyor.start(*first))
        ended = next((Outcome(point.ends) for point in done if point.leg == leg and point.ends), None)
        # A leg that gave up is tried again by a resumed call, unless the other one follows it in the store.
        if ended is None or (ended not in ENDS and not any(point.leg > leg for point in done)):
            past = _past(surveyor, done, leg)
            for point in _leg(surveyor, request, past, leg, done):
                record(point)
            ended = surveyor.outcome
        outcome = ended if outcome.is_success else outcome
        if ended is Outcome.CLOSED:
            break
    return _End(outcome)


def _leg(
    surveyor: Surveyor, request: Request, past: list[Point], leg: int, done: Sequence[BranchPoint]
) -> Iterator[BranchPoint]:
    """New records of one leg: special points before the point after them; in the end `surveyor.outcome` says why."""
    surveyor.begin(leg, done)
    if (end := physical_end(past[-1])) is not None:
        surveyor.outcome = end
        yield surveyor.end(past[-1], past[-1], end)
        return
    options = Arclength(first=FIRST_STEP, parameter_scale=request.span)
    continuation = Continuation(past, request.stops(surveyor.scenario), options)
    start, last = _first(surveyor, request, done, leg), past[-1]
    is_mirrored = meets_mirror_image(start)
    for point in continuation:
        end = physical_end(point)
        if end is not None:
            inside, outside = first_change(last, point, lambda place: physical_end(place) is not None)
            yield from surveyor.between(last, point, inside.arclength)
            end = physical_end(outside) or end
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
            if is_mirrored and meets_mirror_image(_placed(surveyor.scenario, request.course, special)[1]):
                surveyor.outcome = Outcome.REJOINED
                yield replace(special, ends=Outcome.REJOINED.value)
                return
            yield special
        yield surveyor.step(point)
        last = point
    surveyor.outcome = continuation.outcome or Outcome.MAX_STEPS
    if surveyor.outcome is Outcome.BRANCH_STALLED:
        yield surveyor.end(last, last, surveyor.outcome)


def _start(scenario: Scenario, request: Request, known: Start | None) -> tuple[Point, str] | _End:
    """The first point, its tangent towards the stop or along the chosen side, and the name of the state it is."""
    if known is None:
        name, found = _named(scenario, request)
    elif (first := _stored_start(scenario, request, known)) is not None:
        return first if isinstance(first, _End) else (first, known.text)
    else:
        name, found = known.text, steady_near(scenario, known)
    if not found.outcome.is_success:
        return _End(found.outcome, f"No state to start from: {found.nearest}")
    first = _begun(_start_at(found, request))
    if isinstance(first, Point) and request.free is not None and first.parameter != request.start:
        first = _moved(first, request)
    return first if isinstance(first, _End) else (first, name)


def _stored_start(scenario: Scenario, request: Request, known: Start) -> Point | _End | None:
    """The stored point itself, if it is one of a branch in this key of this very scenario."""
    options = Arclength(first=FIRST_STEP, parameter_scale=request.span)
    if known.point is None or not _is_on(known, request) or not _is_at(known, scenario):
        return None
    problem, place = _placed(scenario, request.course, known.point)
    if request.side:
        return side_branches(_singular(known.point, problem, place), known.point.tangent, FIRST_STEP)[
            0 if request.side > 0 else 1
        ]
    rising = place.tangent[-1] * request.direction
    tangent = place.tangent if rising >= 0.0 else -place.tangent
    return _begun(start_point(problem, place.x, place.p, 0, request.direction, options, tangent))


def _begun(first: Point | Outcome) -> Point | _End:
    return _End(first, "The start has no single direction to go on in.") if isinstance(first, Outcome) else first


def _named(scenario: Scenario, request: Request) -> tuple[str, Steady]:
    """The state of this name; without a name the default one where there is one, else the trivial one. With its name."""
    state = request.state
    # States with a ring lead on from the sphere at rest, not from the swimmer that is the default without one.
    rests = request.course.moved == "ring_amplitude" and scenario.values()["ring_amplitude"] == 0.0
    name = state or (StateName.TRIVIAL if rests else StateName.DEFAULT)
    found = steady(scenario, state=name)
    if state is None and not found.outcome.is_success and StateName.TRIVIAL in state_names(scenario.kind):
        name = StateName.TRIVIAL
        found = steady(scenario, state=name)
    return str(name), found


def _start_at(found: Steady, request: Request) -> Point | Outcome:
    """The first point at a solution."""
    options = Arclength(first=FIRST_STEP, parameter_scale=request.span)
    problem, x, value = request.course.problem(found.scenario, found.problem.base), found.found.x, request.start
    if isinstance(problem, HeldProblem):
        x = np.append(x, float(key_values(found.scenario, (request.course.moved,))[0]))
        value = problem.measure.value(problem, x, np.zeros(1))
    direction = float(np.sign(request.start - value)) or request.direction
    return start_point(problem, x, np.array([value]), 0, direction, options)


def _moved(first: Point, request: Request) -> Point | _End:
    """The first point, from a state whose observable has another value, along the branch to where it has that of the start."""
    stops = [Stop(Parameter(0), request.start, "end", ends=True)]
    options = Arclength(first=FIRST_STEP, parameter_scale=abs(request.start - first.parameter), max_points=MAX_POINTS)
    branch = Continuation([first], stops, options)
    *_, last = [first, *branch]
    if branch.outcome is not Outcome.REACHED_STOP:
        met = f"{request.key} = {first.parameter:.8g} of the state there could be brought to {last.parameter:.8g} only."
        return _End(Outcome.NOT_REACHED, f"No state with {request.key} = {request.start:g} to start from: {met}")
    turned = last.tangent[-1] * request.direction < 0.0
    return replace(last.reversed() if turned else last, arclength=0.0, step=FIRST_STEP, label="start")


def _is_on(known: Start, request: Request) -> bool:
    """Whether a stored state is one of a branch in what this one varies."""
    return known.key == request.key and request.course.moved in known.keys


def _is_at(known: Start, scenario: Scenario) -> bool:
    """Whether a stored state is one of this very scenario, discretisation included."""
    return known.scenario.parameters == scenario.parameters and known.scenario.numerics == scenario.numerics


def _placed(scenario: Scenario, course: Course, point: BranchPoint) -> tuple[KeyedProblem | HeldProblem, Point]:
    """A stored point as one to go on from."""
    problem = course.problem(scenario, Engine.of(scenario).problem.on_mesh(point.frame.mesh))
    return problem, _point(problem, point)


def _point(problem: KeyedProblem | HeldProblem, point: BranchPoint) -> Point:
    x = problem.base.pack(state_of(point.frame))
    if point.freed is not None:
        x = np.append(x, point.freed)
    return Point(
        problem,
        x,
        np.array([point.parameter]),
        0,
        point.tangent,
        point.arclength,
        point.step,
        point.test,
        label=point.label,
    )


def _singular(point: BranchPoint, problem: KeyedProblem | HeldProblem, place: Point) -> SingularPoint:
    return SingularPoint(
        Kind(point.kind), problem, 0, place.x, place.p, point.parameter_error, point.directions, point.directions
    )


def _first(surveyor: Surveyor, request: Request, done: Sequence[BranchPoint], leg: int) -> Point:
    """Where a leg starts."""
    stored = next(point for point in done if point.label == START)
    _, start = _placed(surveyor.scenario, request.course, stored)
    return start.reversed() if leg else start


def _past(surveyor: Surveyor, done: Sequence[BranchPoint], leg: int) -> list[Point]:
    """The last steps of a leg as points, those on equal meshes on one problem."""
    start = next(point for point in done if point.label == START)
    steps = [point for point in done if point.leg == leg and point.is_step and point.label != START]
    chosen = [start, *steps][-MEMORY:]
    problem, points = surveyor.course.problem(surveyor.scenario), []
    for point in chosen:
        if not np.array_equal(problem.base.mesh, point.frame.mesh):
            mesh = Engine.of(surveyor.scenario).problem.on_mesh(point.frame.mesh)
            problem = surveyor.course.problem(surveyor.scenario, mesh)
        place = _point(problem, point)
        points.append(place.reversed() if leg and point is start else place)
    return points
