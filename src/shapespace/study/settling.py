"""The stationary state next to a given one, at its own parameters or stepped to others; also from folds and branch points."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from shapespace.analysis.bifurcation import Kind, solve_singular
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.passage import is_symmetric
from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.state import State
from shapespace.study.engine import Engine, state_of
from shapespace.study.frame import Frame
from shapespace.study.keyed import KeyedProblem
from shapespace.study.keys import MAIN_KEYS, MODELS
from shapespace.study.paths import NEWTON
from shapespace.study.scenario import Scenario
from shapespace.study.starts import Start

AT_REST = 1e-9
"""A stored singular state with a smaller residual solves the equations, for all that no system tells it from its neighbours."""
STEPS = Arclength(first=0.02)
"""Along the branch from a singular state to a regular one."""


def key_values(scenario: Scenario, keys: Sequence[str]) -> Array:
    """Values of keys, in the scenario's units."""
    values = scenario.values()
    return np.array([float(values[key]) for key in keys])


def settle(scenario: Scenario, state: State, keys: tuple[str, ...] = ()) -> Stationary:
    """The stationary state of the scenario next to a given state, by Newton's method, as one of a problem in these keys."""
    keys = keys or (MAIN_KEYS[scenario.kind],)
    problem = KeyedProblem.of(scenario, keys)
    base, x = Engine.of(scenario).placed(state)
    return solve_stationary(replace(problem, base=base), x, key_values(scenario, keys), NEWTON)


def as_it_is(scenario: Scenario, frame: Frame) -> Stationary:
    """A stored solution of the scenario on its own mesh, without a search."""
    problem = KeyedProblem.of(scenario, (MAIN_KEYS[scenario.kind],))
    problem = replace(problem, base=problem.base.on_mesh(frame.mesh))
    x, p = problem.base.pack(state_of(frame)), key_values(scenario, problem.keys)
    residual = float(np.abs(problem.residual(x, p, REST)).max())
    return Stationary(problem, x, p, Outcome.CONVERGED, 0.0, residual, 0, settled=True)


def settle_near(scenario: Scenario, start: Start) -> tuple[Stationary, str]:
    """What a stored state becomes at the scenario's parameters: settled at its own ones first, then by stepping.

    A fold or branch point is left along its branch first, one way and then the other. A state that merges on the way with one
    that is its own mirror image is not there any more. With the reason in words, where there is one.
    """
    if not _differing(scenario, start.scenario):
        return _singular_at(scenario, start) or settle(scenario, state_of(start.frame)), ""
    first = None
    for origin, state in _regular(scenario, start):
        keys = _differing(scenario, origin)
        settled = settle(origin, state, keys)
        found, told = step_to(settled, key_values(scenario, keys)), ""
        if found.outcome.is_success:
            found = solve_stationary(found.problem, found.x, found.p, NEWTON)
        if (
            found.outcome.is_success
            and is_symmetric(found.problem, found.x)
            and not is_symmetric(settled.problem, settled.x)
        ):
            found, told = replace(found, outcome=Outcome.NOT_REACHED), "On the way it merged with a symmetric state."
        if found.outcome.is_success:
            return found, ""
        first = first or (found, told)
    assert first is not None
    return first


def _differing(scenario: Scenario, other: Scenario) -> tuple[str, ...]:
    """Parameters that have other values there, by the keys that the scenario gives them as."""
    mine, theirs = scenario.parameters.model_dump(), other.parameters.model_dump()
    twins = MODELS[scenario.model].twins
    given = {twins[key].sets: key for key, _ in scenario.given if key in twins}
    return tuple(given.get(key, key) for key, value in mine.items() if theirs[key] != value)


def _regular(scenario: Scenario, start: Start) -> Iterator[tuple[Scenario, State]]:
    """The stored state with its scenario; where it is singular, states on either side of it on its branch with theirs."""
    theirs = start.scenario.values()
    origin = scenario.with_overrides({key: theirs[key] for key in _differing(scenario, start.scenario)})
    place = _singular_point(origin, start)
    if place is None:
        yield origin, state_of(start.frame)
        return
    assert start.key is not None
    for tangent in (place.tangent, -place.tangent):
        first = start_point(place.problem, place.x, place.p, 0, options=STEPS, tangent=tangent)
        for one in islice(Continuation([first], options=STEPS), 1) if isinstance(first, Point) else ():
            assert isinstance(one.problem, KeyedProblem)
            yield origin.with_overrides({start.key: one.parameter}), one.problem.base.unpack(one.x)


def _singular_point(scenario: Scenario, start: Start) -> Point | None:
    """A stored fold or branch point with the tangent of its branch in its key; None for other states, and on other meshes."""
    point = start.point
    if (
        point is None
        or start.key is None
        or start.key not in start.keys
        or point.kind not in (*Kind,)
        or start.scenario.numerics != scenario.numerics
    ):
        return None
    problem = KeyedProblem.of(scenario, (start.key,))
    problem = replace(problem, base=problem.base.on_mesh(point.frame.mesh))
    x, p = problem.base.pack(state_of(point.frame)), np.array([point.parameter])
    return Point(problem, x, p, 0, point.tangent, label=point.kind)


def _singular_at(scenario: Scenario, start: Start) -> Stationary | None:
    """A stored fold or branch point as the solution of its defining system; None for other states, and on other meshes.

    Where that system is singular as well, as at a cusp, it is taken as it is.
    """
    place = _singular_point(scenario, start)
    if place is None:
        return None
    assert start.point is not None
    assert isinstance(place.problem, KeyedProblem)
    problem, x, p = place.problem, place.x, place.p
    kernel = place.tangent[None, :-1] if start.point.kind == Kind.FOLD else start.point.directions
    root = solve_singular(problem, 0, x, p, kernel)
    correction = 0.0
    if root.outcome.is_success:
        x, p, correction = root.x[: len(x)], root.x[len(x) : len(x) + 1], root.correction
    residual = float(np.abs(problem.residual(x, p, REST)).max())
    if not root.outcome.is_success and residual > AT_REST:
        return None
    settled = problem.adapted(x) is problem
    return Stationary(problem, x, p, Outcome.CONVERGED, correction, residual, root.iterations, settled)
