"""Products with the matrices of a pencil against derivatives of the residual, on surfaces and on a system with everything."""

import numpy as np
import pytest
from tests.numerics.manufactured import exact_parameters, solve_everything
from tests.surfaces import make_engine

from shapespace.base.arrays import Array
from shapespace.base.problem import Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.mesh import uniform_mesh


def surface(name: str) -> tuple[CollocationProblem, Array, Array]:
    engine = make_engine(name)
    return engine.problem, engine.problem.pack(engine.initial_state()), engine.p


def everything() -> tuple[CollocationProblem, Array, Array]:
    problem, root = solve_everything(uniform_mesh(7), 3)
    return problem, root.x, exact_parameters()


CASES = {name: lambda name=name: surface(name) for name in ("guided-division", "membrane-protrusion")}


@pytest.mark.parametrize("case", [*CASES, "everything"])
def test_products_are_derivatives(case: str):
    """J dx is the derivative at rest; B dx is that of F along dq, the change of q along dx, by central differences."""
    problem, x, p = everything() if case == "everything" else CASES[case]()
    dx = np.random.default_rng(3).standard_normal(len(x)) * 0.1
    actions = problem.actions(x, p)
    derivative = problem.derivative(x, p, dx, np.zeros_like(p))
    np.testing.assert_allclose(actions.jacobian(dx), derivative, rtol=1e-11, atol=1e-11 * np.abs(derivative).max())
    e = 1e-5
    dq = (problem.stored(x + e * dx, p) - problem.stored(x - e * dx, p)) / (2.0 * e)
    by_difference = (problem.residual(x, p, Rate(0.0, e * dq)) - problem.residual(x, p, Rate(0.0, -e * dq))) / (2.0 * e)
    np.testing.assert_allclose(actions.mass(dx), by_difference, rtol=1e-7, atol=1e-7 * np.abs(by_difference).max())
    assert not actions.mass(np.where(actions.moving, 0.0, dx)).any()
    shift = 7.0
    factors = actions.factors(shift)
    np.testing.assert_allclose(factors.solve(actions.jacobian(dx) + shift * actions.mass(dx)), dx, rtol=0.0, atol=1e-9)
    assert factors.sign == problem.linearise(x, p, Rate.of_growth(problem.stored(x, p), shift))[1].sign


def test_the_mass_of_a_surface_acts_on_what_is_stored():
    """Coordinates, the concentration and the scale h; not on angles, curvatures, tensions and velocities."""
    problem, x, p = surface("guided-division")
    moving = problem.unpack(problem.actions(x, p).moving.astype(float))
    expected = [name in ("r", "z", "c") for name in problem.system.fields]
    assert np.array_equal(moving.nodes, np.broadcast_to(expected, moving.nodes.shape))
    assert np.array_equal(moving.slopes, np.broadcast_to(expected, moving.slopes.shape))
    assert np.array_equal(moving.scalars, [name == "h" for name in problem.system.scalars])
