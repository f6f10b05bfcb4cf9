"""Where a branch begins: at a named state, at a stored one, or at the start of another branch through a branch point."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shapespace.analysis.beside import branch_point_near
from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point, metric
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.analysis.tracing import side_branches
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_request import Request
from shapespace.study.course import Course
from shapespace.study.engine import Engine, state_of
from shapespace.study.keyed import HeldProblem, KeyedProblem
from shapespace.study.paths import MAX_POINTS, StateName, state_names
from shapespace.study.scenario import Scenario
from shapespace.study.settling import key_values
from shapespace.study.starts import Start
from shapespace.study.steady import Steady, steady, steady_near

FIRST_STEP = 0.02


class End(NamedTuple):
    """Why a computation is over, and what is to be said of a start that failed."""

    outcome: Outcome
    detail: str = ""


def first_point(scenario: Scenario, request: Request, known: Start | None) -> tuple[Point, str] | End:
    """The first point, its tangent towards the stop or along the chosen side, and the name of the state it is."""
    if known is None:
        name, found = _named(scenario, request)
    elif (first := _stored_start(scenario, request, known)) is not None:
        return first if isinstance(first, End) else (first, known.text)
    else:
        name, found = known.text, steady_near(scenario, known)
    if not found.outcome.is_success:
        return End(found.outcome, f"No state to start from: {found.nearest}")
    first = _begun(_start_at(found, request))
    if isinstance(first, Point) and request.free is not None and first.parameter != request.start:
        first = _moved(first, request)
    return first if isinstance(first, End) else (first, name)


def _stored_start(scenario: Scenario, request: Request, known: Start) -> Point | End | None:
    """The stored point itself, if it is one of a branch in this key of this very scenario."""
    options = Arclength(first=FIRST_STEP, parameter_scale=request.span)
    if request.side:
        return _side(scenario, request, known)
    if known.point is None or not is_on(known, request) or not _is_at(known, scenario):
        return None
    problem, place = point_on(scenario, request.course, known.point)
    rising = place.tangent[-1] * request.direction
    tangent = place.tangent if rising >= 0.0 else -place.tangent
    return _begun(start_point(problem, place.x, place.p, 0, request.direction, options, tangent))


def _side(scenario: Scenario, request: Request, known: Start) -> Point | End:
    """The start of the other branch through a stored branch point, found again where the scenario is another one."""
    assert known.point is not None
    problem, place = point_on(known.scenario, request.course, known.point)
    singular, along = _singular(known.point, problem, place), known.point.tangent
    if not _is_at(known, scenario):
        again = _found_again(scenario, request, known, singular)
        if isinstance(again, Outcome):
            curve = "follow it to these parameters with `shapespace curve`, and start from a point of that"
            return End(again, f"The {known.point.kind} of {known.text} was not found at these parameters: {curve}.")
        # The other one of the two directions is the other one there as well.
        overlap = np.abs(singular.directions @ (metric(problem, place.joined) * along))
        singular, along = again, again.directions[int(np.argmax(overlap))]
    return side_branches(singular, along, FIRST_STEP)[0 if request.side > 0 else 1]


def _found_again(
    scenario: Scenario, request: Request, known: Start, singular: SingularPoint
) -> SingularPoint | Outcome:
    """The branch point at another scenario's parameters or discretisation, its directions in the order and sense known."""
    old = singular.problem
    base, x = Engine.of(scenario).placed(state_of(known.frame))
    problem = request.course.problem(scenario, base)
    x = x if request.free is None else np.append(x, singular.x[-1])
    X, along = np.append(x, singular.parameter), np.append(np.zeros_like(x), 1.0)
    found = branch_point_near(problem, X, singular.p, 0, along, request.span)
    if isinstance(found, Outcome) or known.scenario.numerics.degree != scenario.numerics.degree:
        return found
    weights = metric(problem, X)
    before = np.stack([np.append(old.carried(one[:-1], problem), one[-1]) for one in singular.directions])
    overlaps = (before * weights) @ found.directions.T
    order = [0, 1] if abs(overlaps[0, 0] * overlaps[1, 1]) > abs(overlaps[0, 1] * overlaps[1, 0]) else [1, 0]
    senses = np.sign([overlaps[i, order[i]] for i in (0, 1)])
    return replace(found, directions=found.directions[order] * senses[:, None])


def _begun(first: Point | Outcome) -> Point | End:
    return End(first, "The start has no single direction to go on in.") if isinstance(first, Outcome) else first


def _named(scenario: Scenario, request: Request) -> tuple[str, Steady]:
    """The state of this name; without a name the default one where there is one, else the trivial one. With its name."""
    state = request.state
    # States with a ring lead on from the sphere at rest, not from the swimmer that is the default without one.
    rests = request.course.moved == "ring_amplitude" and scenario.values()["ring_amplitude"] == 0.0
    name = state or (StateName.TRIVIAL if rests else StateName.DEFAULT)
    found = steady(scenario, state=name)
    if state is None and not found.outcome.is_success and StateName.TRIVIAL in state_names(scenario.kind):
        resting = steady(scenario, state=StateName.TRIVIAL)
        if resting.outcome.is_success:
            return str(StateName.TRIVIAL), resting
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


def _moved(first: Point, request: Request) -> Point | End:
    """The first point, from a state whose observable has another value, along the branch to where it has that of the start."""
    if np.isnan(first.parameter):
        return End(Outcome.NO_STATE, f"The state there has no {request.key}: give one that has as --from STORE:LABEL.")
    stops = [Stop(Parameter(0), request.start, "end", ends=True)]
    options = Arclength(first=FIRST_STEP, parameter_scale=abs(request.start - first.parameter), max_points=MAX_POINTS)
    branch = Continuation([first], stops, options)
    *_, last = [first, *branch]
    if branch.outcome is not Outcome.REACHED_STOP:
        met = f"{request.key} = {first.parameter:.8g} of the state there could be brought to {last.parameter:.8g} only."
        return End(Outcome.NOT_REACHED, f"No state with {request.key} = {request.start:g} to start from: {met}")
    turned = last.tangent[-1] * request.direction < 0.0
    return replace(last.reversed() if turned else last, arclength=0.0, step=FIRST_STEP, label="start")


def is_on(known: Start, request: Request) -> bool:
    """Whether a stored state is one of a branch in what this one varies."""
    return known.key == request.key and request.course.moved in known.keys


def _is_at(known: Start, scenario: Scenario) -> bool:
    """Whether a stored state is one of this very scenario, discretisation included."""
    return known.scenario.parameters == scenario.parameters and known.scenario.numerics == scenario.numerics


def point_on(scenario: Scenario, course: Course, point: BranchPoint) -> tuple[KeyedProblem | HeldProblem, Point]:
    """A stored point as one to go on from."""
    problem = course.problem(scenario, Engine.of(scenario).problem.on_mesh(point.frame.mesh))
    return problem, point_of(problem, point)


def point_of(problem: KeyedProblem | HeldProblem, point: BranchPoint) -> Point:
    """A stored point as one of a problem on its mesh."""
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
