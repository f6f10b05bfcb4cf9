"""Which collocation degree: error of the stationary neck radius against the time of a Newton iteration.

Divided surface of guided division (Fig. 6), stationary, re-solved for each degree and element count on a mesh
equidistributed for that degree; the reference has degree 6 and 320 elements. Best of each time class wins.
Run: python benchmarks/bench_degree.py   (about two minutes, most of it compilation)
"""

from dataclasses import replace
from functools import partial

from benchmarks.timing import machine, milliseconds, use_one_core

use_one_core()

import numpy as np

from shapespace.analysis.evolution import Evolution, Moment, Stepping
from shapespace.base.problem import Rate
from shapespace.numerics.adaptation import discretisation_error, highest_derivative
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.mesh import equidistribute, symmetrise
from shapespace.numerics.newton import Newton, solve_root
from shapespace.numerics.state import State, state_from_functions
from shapespace.study.engine import Engine
from shapespace.study.scenario import scenario


def at_degree(state: State, degree: int, mesh: np.ndarray) -> State:
    """The state represented with another degree on another mesh."""
    empty = state_from_functions(
        mesh, degree, state.values(mesh), np.zeros((len(mesh) - 1, degree, state.nodes.shape[1])),
        np.zeros((len(mesh) - 1, degree, 0)), state.scalars,
    )  # fmt: skip
    points = empty.stage_points
    slopes = state.derivatives(points.ravel()).reshape(*points.shape, -1)
    return state_from_functions(mesh, degree, state.values(mesh), slopes, empty.algebraic, state.scalars)


def stationary(engine: Engine, state: State) -> tuple[State, CollocationProblem, np.ndarray]:
    """The stationary state at the state's own degree and mesh."""
    problem = replace(engine.problem, mesh=state.mesh, degree=state.rule.degree)
    x = problem.pack(state)
    rest = Rate(0.0, np.zeros_like(problem.stored(x, engine.p)))
    root = solve_root(problem, x, engine.p, rest, Newton(tolerance=1e-9))
    if not root.outcome.is_success:
        raise RuntimeError(f"degree {problem.degree}, {problem.elements} elements: {root.outcome}")
    return problem.unpack(root.x), problem, root.x


def main() -> None:
    """Print error, estimate and time for each degree and size."""
    engine = Engine.of(scenario("guided-division", degree=4, elements=60))
    start = Moment(0.0, engine.problem, engine.problem.pack(engine.initial_state()))
    *_, last = Evolution([start], engine.p, 2.0, Stepping())
    assert isinstance(last.problem, CollocationProblem)
    divided = last.problem.unpack(last.x)

    def solve(degree: int, elements: int) -> tuple[State, CollocationProblem, np.ndarray]:
        density = highest_derivative(divided) ** (1.0 / (degree + 1))
        mesh = symmetrise(equidistribute(divided.mesh, density, elements))
        return stationary(engine, at_degree(divided, degree, mesh))

    half = np.array([0.5])
    exact = solve(6, 320)[0].values(half)[0, 0]
    print(machine())
    print(f"neck radius {exact:.12f} (degree 6, 320 elements)")
    print(f"{'degree':>7s}{'elements':>9s}{'neck error':>12s}{'field error':>12s}{'ms/iteration':>14s}")
    for degree in (2, 3, 4, 5, 6):
        for elements in (40, 80, 160):
            state, problem, x = solve(degree, elements)
            rest = Rate(0.0, np.zeros_like(problem.stored(x, engine.p)))
            best, _ = milliseconds(partial(problem.linearise, x, engine.p, rest), 30)
            error = abs(state.values(half)[0, 0] / exact - 1.0)
            print(f"{degree:7d}{elements:9d}{error:12.1e}{discretisation_error(state):12.1e}{best:14.2f}")


if __name__ == "__main__":
    main()
