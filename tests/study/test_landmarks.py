"""Physical ends of branches: shapes that cross themselves or the axis, and necks that have closed."""

from collections.abc import Callable

import numpy as np
import pytest

from shapespace.analysis.branch import Point
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.numerics.state import state_from_functions
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem
from shapespace.study.landmarks import physical_end
from shapespace.study.scenario import scenario

Shape = Callable[[Array], tuple[Array, Array]]


def point_of(shape: Shape) -> Point:
    """A closed surface with this outline (r, z) of u."""
    case = scenario("guided-division", elements=20)
    problem, engine = KeyedProblem.of(case, ("peclet",)), Engine.of(case)
    state = engine.initial_state()
    stages = state.stage_points
    step = 1e-6
    values, slopes = state.nodes.copy(), state.slopes.copy()
    for name, place in (("r", 0), ("z", 1)):
        column = engine.system.fields.index(name)
        values[:, column] = shape(state.mesh)[place]
        slopes[..., column] = (shape(stages + step)[place] - shape(stages - step)[place]) / (2.0 * step)
    made = state_from_functions(state.mesh, 4, values, slopes, state.algebraic, state.scalars)
    x = problem.base.pack(made)
    return Point(problem, x, np.array([450.0]), 0, np.append(np.zeros_like(x), 1.0))


def sphere(u: Array) -> tuple[Array, Array]:
    return np.sin(np.pi * u), np.cos(np.pi * u)


def dumbbell(neck: float) -> Shape:
    return lambda u: (np.sin(np.pi * u) * (neck + np.cos(np.pi * u) ** 2), 2.0 * np.cos(np.pi * u))


def overlapping(u: Array) -> tuple[Array, Array]:
    """Two lobes that bend back over the neck until they meet."""
    return np.sin(np.pi * u) * (0.2 + np.cos(np.pi * u) ** 2), np.cos(np.pi * u) - 0.9 * np.cos(np.pi * u) ** 3 * 2.0


@pytest.mark.parametrize(
    ("shape", "end"),
    [
        (sphere, None),
        (dumbbell(0.1), None),
        (dumbbell(5e-5), Outcome.NECK_CLOSED),
        (dumbbell(-0.05), Outcome.NECK_CLOSED),
        (overlapping, Outcome.SELF_INTERSECTING),
    ],
)
def test_shapes_that_end_a_branch(shape: Shape, end: Outcome | None):
    assert physical_end(point_of(shape)) is end
