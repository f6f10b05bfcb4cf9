"""Ways to the stationary states that have names: along a branch to a value of its parameter."""

from enum import StrEnum

import numpy as np

from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stationary import Stationary, solve_stationary
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.newton import Newton

NEWTON = Newton(tolerance=1e-10)
MAX_POINTS = 400
"""Of the way from the reference to a scenario's parameters."""


class StateName(StrEnum):
    """Which stationary state of a scenario: the one it is named for, the resting one, or a family of vesicles."""

    DEFAULT = "default"
    TRIVIAL = "trivial"
    PROLATE = "prolate"
    OBLATE = "oblate"
    STOMATOCYTE = "stomatocyte"


_VESICLES = (StateName.PROLATE, StateName.OBLATE, StateName.STOMATOCYTE)


def own_states(model: str) -> tuple[StateName, ...]:
    """The different states that a scenario of the model is about."""
    return _VESICLES if model == "vesicle" else (StateName.DEFAULT,)


def state_names(model: str) -> tuple[StateName, ...]:
    """The states of a model that can be asked for by name."""
    return (StateName.DEFAULT, *(_VESICLES if model == "vesicle" else (StateName.TRIVIAL,)))


def read_state_name(text: str, model: str) -> StateName:
    """The state of this name; InputError where the model has none."""
    names = state_names(model)
    if text not in names:
        raise InputError(f"state = {text}: is unknown here; choose one of {', '.join(names)}.")
    return StateName(text)


def steps(span: float) -> Arclength:
    """Options for a way over which the parameter changes by a span."""
    return Arclength(first=0.02, parameter_scale=abs(span), max_points=MAX_POINTS)


def along(first: Point, value: float, options: Arclength, away: float | None = None) -> Stationary:
    """The state where the branch from a point comes to a value of its parameter; NO_STATE where it comes to `away` first."""
    stops = [Stop(Parameter(0), one, "end", ends=True) for one in (value, away) if one is not None]
    branch = Continuation([first], stops, options, NEWTON)
    *_, last = [first, *branch]
    if branch.outcome is Outcome.REACHED_STOP and last.parameter == value:
        return solve_stationary(last.problem, last.x, last.p, NEWTON)
    return given_up(last, Outcome.NO_STATE if branch.outcome is Outcome.REACHED_STOP else Outcome.NOT_REACHED)


def given_up(last: Point | Stationary, outcome: Outcome) -> Stationary:
    """The record of a way that ended at a point without the state that was looked for."""
    residual = float(np.abs(last.problem.residual(last.x, last.p, REST)).max())
    return Stationary(last.problem, last.x, last.p, outcome, np.nan, residual, 0, False)
