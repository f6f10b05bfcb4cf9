"""Stationary vesicles by name, along branches in the reduced volume that begin beside the sphere.

There the only soft mode is l = 2, whose two signs are the prolates and the oblates. Where the oblates, ever flatter, yield to
an antisymmetric mode, a branch of cups leaves them; it rises in v to a fold, beyond which are the stomatocytes.
"""

import numpy as np

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stationary import Stationary, solve_stationary
from shapespace.analysis.tracing import Located, Missed, side_branches, traced
from shapespace.base.outcome import Outcome
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem
from shapespace.study.paths import NEWTON, StateName, along, given_up, steps
from shapespace.study.scenario import Scenario

KEY = "reduced_volume"
NEAR_SPHERE = 0.99
"""Where branches begin: nearer to v = 1 the equations become singular, farther from it a spheroid is too rough a guess."""
FLATTEST = 0.1
"""How far down oblates are followed to where they yield."""


def solve_vesicle(scenario: Scenario, name: StateName) -> tuple[Stationary, str]:
    """The state of this name, a prolate by default, and in words what was met on the way where there is none."""
    goal = float(scenario.values()[KEY])
    is_cup = name is StateName.STOMATOCYTE
    near = NEAR_SPHERE if is_cup else max(goal, NEAR_SPHERE)
    start = _spheroidal(scenario.with_overrides({KEY: near}), name in (StateName.OBLATE, StateName.STOMATOCYTE))
    if near == goal or not start.outcome.is_success:
        return start, ""
    span = near - goal
    first = start_point(start.problem, start.x, start.p, 0, -1.0, steps(span))
    if not isinstance(first, Point):
        return start, f"The branch from {KEY} = {near:g} has no direction there."
    return _cup(first, goal) if is_cup else (along(first, goal, steps(span)), "")


def _spheroidal(scenario: Scenario, oblate: bool) -> Stationary:
    """The state next to a spheroid."""
    case = scenario.with_overrides({"initial_oblate": oblate, "initial_leaning": 0.0})
    problem, state = KeyedProblem.of(case, (KEY,)), Engine.of(case).initial_state()
    return solve_stationary(problem, problem.base.pack(state), np.array([float(case.values()[KEY])]), NEWTON)


def _cup(oblate: Point, goal: float) -> tuple[Stationary, str]:
    """The state with the volume of the goal beyond the fold of the cups that leave the oblates."""
    stop = Stop(Parameter(0), FLATTEST, "end", ends=True)
    branch = Continuation([oblate], [stop], steps(1.0), NEWTON)
    last = oblate
    for one in traced(branch):
        if isinstance(one, Missed):
            told = f"A branch point of the oblates below {KEY} = {last.parameter:.8g} was not located."
            return given_up(last, one.outcome), told
        if isinstance(one, Located) and one.point.kind is Kind.PITCHFORK:
            return _beyond_fold(side_branches(one.point, one.bracket.after.tangent, 0.02)[0], goal)
        last = one if isinstance(one, Point) else last
    return given_up(last, Outcome.NO_STATE), f"The oblates yield to no cup down to {KEY} = {last.parameter:.3g}."


def _beyond_fold(first: Point, goal: float) -> tuple[Stationary, str]:
    """Where the branch of cups comes down to the goal, having risen before."""
    branch = Continuation([first], [Stop(Parameter(0), goal)], steps(1.0), NEWTON)
    last, top = first, first.parameter
    for last in branch:
        falls, top = last.tangent[-1] < 0.0, max(top, last.parameter)
        if falls and last.label == "user":
            return solve_stationary(last.problem, last.x, last.p, NEWTON), ""
        if falls and last.parameter < goal:
            detail = f"Cups leave the oblates at {KEY} = {first.parameter:.6g} and reach up to {top:.3g} only."
            return given_up(last, Outcome.NO_STATE), detail
    return given_up(last, Outcome.NOT_REACHED), ""
