"""Surfaces for the tests: engines whose meshes stay, runs of theirs, and their fields by name."""

from dataclasses import replace

import numpy as np

from shapespace.analysis.evolution import Evolution, Moment, Stepping
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.newton import Newton
from shapespace.numerics.state import State
from shapespace.study.engine import Engine
from shapespace.study.scenario import scenario


class FixedMesh(CollocationProblem):
    """A problem that keeps its mesh: discrete balances then hold from step to step without interpolation."""

    def adapted(self, x: Array) -> "FixedMesh":
        return self


def make_engine(name: str, **overrides: object) -> Engine:
    """The engine of a built-in scenario on a mesh that stays, 20 elements of 4 points unless told otherwise."""
    engine = Engine.of(scenario(name, **{"elements": 20, "degree": 4, **overrides}))
    made = engine.problem
    return replace(engine, problem=FixedMesh(made.system, made.mesh, made.degree, made.tolerance))


def start_of(engine: Engine, state: State | None = None) -> Moment:
    """The initial state, or another state at time 0."""
    return Moment(0.0, engine.problem, engine.problem.pack(state or engine.initial_state()))


def march(
    engine: Engine, until: float, *, state: State | None = None, newton: Newton = Newton(), **stepping: float
) -> tuple[list[Moment], Outcome | None]:
    """All moments from the start on, and why they ended; never stationary unless `stationary_rate` is given."""
    options = Stepping(**{"stationary_rate": 0.0, **stepping})
    past = start_of(engine, state)
    evolution = Evolution([past], engine.p, until, options, newton)
    return [past, *evolution], evolution.outcome


def fields_at(engine: Engine, x: Array, u: Array) -> dict[str, Array]:
    """Differential fields at u (m,), by name."""
    values = engine.problem.unpack(x).values(u)
    return {name: values[:, i] for i, name in enumerate(engine.system.fields)}


def stage_fields(engine: Engine, x: Array) -> dict[str, Array]:
    """Differential fields at the Gauss points, (N, k), and the scalars, by name."""
    state = engine.problem.unpack(x)
    values = state.stage_values()
    fields = {name: values[..., i] for i, name in enumerate(engine.system.fields)}
    return fields | dict(zip(engine.system.scalars, state.scalars, strict=True))


def integral(engine: Engine, values: Array) -> float:
    """Gauss quadrature over u of values (N, k) at the Gauss points."""
    rule = gauss_rule(engine.problem.degree)
    return float(np.einsum("e,j,ej->", np.diff(engine.problem.mesh), rule.weights, values))


def resting(engine: Engine, x: Array) -> Rate:
    """dq/dt = 0."""
    return Rate(0.0, np.zeros_like(engine.problem.stored(x, engine.p)))
