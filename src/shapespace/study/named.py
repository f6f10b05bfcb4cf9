"""Stationary states by their names: from a reference at rest in closed form, by following its branches."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.stationary import Stationary
from shapespace.analysis.tracing import Located, Missed, side_branches, traced
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem
from shapespace.study.paths import MAX_POINTS, NEWTON, StateName, along, given_up, steps
from shapespace.study.scenario import Scenario
from shapespace.study.settling import key_values, settle
from shapespace.study.vesicles import solve_vesicle

RAISED = {"closed-surface": ("ring_amplitude",), "open-membrane": ("spontaneous_curvature", "pulling_force")}
"""Keys that lead from the sphere or the flat disc at rest to a scenario's own state, in this order."""
ONSET = 1e-9
"""A Peclet number within this of the pitchfork, relative to it, is there."""

Named = tuple[Stationary, str]
"""What was found, and in words why it is not the state of the name."""


def named_state(scenario: Scenario, name: StateName) -> Named:
    """The named stationary state of the scenario, from the resting sphere or the flat disc; a vesicle from beside the sphere.

    That reference solves the equations without a ring, a coat and a pull, and is the trivial state there; these are then raised
    one after another along the branch of states that leads on from it, through folds. Without a ring the default is the
    polarized, swimming state on the branch that leaves the sphere at the first pitchfork in the Peclet number.
    """
    check_has_isolated_states(scenario)
    if scenario.kind == "vesicle":
        return solve_vesicle(scenario, name)
    simple, raised = reference(scenario), RAISED[scenario.kind]
    missing = [key for key in raised if scenario.values()[key] != 0.0]
    if name is StateName.DEFAULT and scenario.kind == "closed-surface" and not missing:
        return _polarized(scenario, simple)
    resting = settle(simple, Engine.of(simple).initial_state())
    if name is StateName.DEFAULT:
        return _raised(scenario, simple, resting, raised), ""
    if not missing or not resting.outcome.is_success:
        return resting, ""
    assert isinstance(resting.problem, KeyedProblem)
    problem = replace(KeyedProblem.of(scenario, (missing[0],)), base=resting.problem.base)
    here = replace(resting, problem=problem, p=key_values(scenario, (missing[0],)))
    detail = f"The sphere or flat disc rests only with {' = '.join([*missing, '0'])}."
    return given_up(here, Outcome.NO_STATE), detail


def reference(scenario: Scenario) -> Scenario:
    """The scenario without ring, coat and pull: its initial state, a sphere or a flat disc, is at rest; a spheroid nearly so."""
    if scenario.kind == "vesicle":
        return scenario.with_overrides({"initial_leaning": 0.0})
    if scenario.kind == "closed-surface":
        return scenario.with_overrides(
            {"ring_amplitude": 0.0, "initial_background": 1.0, "initial_ring_amplitude": 0.0, "seed_amplitude": 0.0}
        )
    return scenario.with_overrides({"spontaneous_curvature": 0.0, "pulling_force": 0.0})


def followed(scenario: Scenario, known: Stationary, key: str, value: float) -> Stationary:
    """The state that a known one of the scenario becomes along its branch when one key goes to a value, wherever it turns."""
    assert isinstance(known.problem, KeyedProblem)
    at = key_values(scenario, (key,))
    if at[0] == value:
        return known
    problem = replace(KeyedProblem.of(scenario, (key,)), base=known.problem.base)
    first = start_point(problem, known.x, at, 0, float(np.sign(value - at[0])), steps(value - at[0]))
    return replace(known, outcome=first) if isinstance(first, Outcome) else along(first, value, steps(value - at[0]))


def check_has_isolated_states(scenario: Scenario) -> None:
    """InputError where stationary states come in families."""
    values = scenario.values()
    if scenario.kind == "closed-surface" and values["azimuthal_flow"] and values["friction"] == 0.0:
        raise InputError(
            "friction = 0: with azimuthal_flow = true a surface may also rotate as a whole, at any rate; choose a friction > 0, "
            "or azimuthal_flow = false."
        )
    if scenario.kind == "closed-surface" and values["turnover_rate"] == 0.0:
        raise InputError(
            "turnover_rate = 0: conserves the regulator, so that stationary states come in families that no equation tells "
            "apart; choose a turnover_rate > 0."
        )


def _raised(scenario: Scenario, simple: Scenario, resting: Stationary, keys: Sequence[str]) -> Stationary:
    """Raise keys from zero to their values one after another."""
    found = resting
    for key in keys:
        if not found.outcome.is_success:
            break
        value = float(key_values(scenario, (key,))[0])
        found, simple = followed(simple, found, key, value), simple.with_overrides({key: value})
    return found


def _polarized(scenario: Scenario, sphere: Scenario) -> Named:
    """The swimming state on the branch that leaves the sphere at its first pitchfork in the Peclet number.

    Below the pitchfork that branch leads to a swimmer only if it turns back: it is followed to twice the pitchfork's number,
    above it as far back as zero, where nothing drives a flow.
    """
    goal, still = float(scenario.values()["peclet"]), sphere.with_overrides({"peclet": 0.0})
    resting = settle(still, Engine.of(still).initial_state(), ("peclet",))
    if not resting.outcome.is_success:
        return resting, ""
    first = start_point(resting.problem, resting.x, resting.p, 0, 1.0, steps(1.0))
    assert isinstance(first, Point)
    branch = Continuation([first], (), Arclength(first=0.1, largest=0.2, max_points=MAX_POINTS), NEWTON)
    reached = 0.0
    for one in traced(branch):
        if isinstance(one, Missed):
            told = f"A branch point of the sphere beyond peclet = {reached:.8g} was not located."
            return replace(resting, outcome=one.outcome), told
        if isinstance(one, Located) and one.point.kind is Kind.PITCHFORK:
            fork = one.point.parameter
            side = side_branches(one.point, one.bracket.after.tangent, 0.02)[0]
            away = 2.0 * fork if goal <= fork * (1.0 + ONSET) else 0.0
            found = along(side, goal, steps(max(abs(goal - fork), 0.1 * fork)), away)
            told = (
                f"The sphere polarizes at peclet = {fork:.8g}; the branch from there comes to no swimmer at {goal:g}."
            )
            return found, "" if found.outcome.is_success else told
        reached = one.parameter if isinstance(one, Point) else reached
    return replace(resting, outcome=Outcome.NO_STATE), f"The sphere does not polarize up to peclet = {reached:.3g}."
