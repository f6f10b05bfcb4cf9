"""Folds and branch points of classic problems, and the Jacobian of the systems that define them."""

import jax.numpy as jnp
import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.bifurcation import (
    Kind,
    SingularPoint,
    branch_directions,
    locate_branch_point,
    locate_fold,
)
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.analysis.singular import SingularProblem
from shapespace.analysis.tracing import Located, side_branches, traced
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.newton import Newton, solve_root
from shapespace.study.verification.classic import at_rest, bratu, chafee_infante

BRATU_FOLD = 3.513830719125161
"""8 (x^2 - 1) with x tanh x = 1 (Buckmire)."""


def solved(problem: CollocationProblem, p: Array) -> Array:
    x = at_rest(problem)
    root = solve_root(problem, x, p, REST, Newton(1e-12))
    assert root.outcome is Outcome.CONVERGED
    return root.x


def bratu_fold(elements: int, degree: int) -> SingularPoint:
    problem, p = bratu(elements, degree), np.array([3.4])
    x = solved(problem, p)
    _, linearisation = problem.linearise(x, p, REST)
    mode = linearisation.solve(problem.derivative(x, p, np.zeros_like(x), np.ones(1)))
    point = locate_fold(problem, 0, x, p, mode)
    assert isinstance(point, SingularPoint)
    return point


def test_fold_of_bratu():
    """lambda* and u(1/2) to 1e-9, from a state at lambda = 3.4; the estimated error covers the true one."""
    point = bratu_fold(20, 4)
    assert point.kind is Kind.FOLD
    assert abs(point.parameter - BRATU_FOLD) < 1e-9
    assert abs(point.parameter - BRATU_FOLD) <= point.parameter_error < 1e-8
    middle = point.problem.unpack(point.x).values(np.array([0.5]))[0, 0]
    assert abs(middle - 1.186842168634389) < 1e-6


@pytest.mark.parametrize("degree", [2, 3])
def test_fold_parameter_superconverges(degree: int):
    """The fold's parameter has the order 2k of element ends; reported errors cover the true ones."""
    points = [bratu_fold(elements, degree) for elements in (5, 10, 20)]
    errors = np.array([abs(point.parameter - BRATU_FOLD) for point in points])
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.abs(orders - 2 * degree).max() < 0.3, f"errors {errors}, orders {orders}"
    assert all(error <= point.parameter_error for error, point in zip(errors, points, strict=True))


@pytest.mark.parametrize(("n", "start"), [(1, 1.1), (2, 3.8), (3, 9.3)])
def test_pitchforks_of_chafee_and_infante(n: int, start: float):
    """lambda = n^2 exactly; one branch is the trivial one, the other leaves with sin(n x) at constant lambda."""
    problem = chafee_infante(40)
    x = at_rest(problem)
    point = locate_branch_point(problem, 0, x, np.array([start]), np.append(x, 1.0))
    assert isinstance(point, SingularPoint)
    assert point.kind is Kind.PITCHFORK
    assert abs(point.parameter - n**2) <= point.parameter_error < 1e-9
    trivial, side = sorted(point.directions, key=lambda d: -abs(d[-1]))
    assert abs(trivial[:-1]).max() < 1e-8 * abs(trivial[-1])
    u = np.linspace(0.0, 1.0, 7)
    mode = problem.unpack(side[:-1]).values(u)[:, 0]
    sine = np.sin(n * np.pi * u)
    amplitude = (mode @ sine) / (sine @ sine)
    np.testing.assert_allclose(mode, amplitude * sine, atol=1e-6 * abs(amplitude))


def test_branches_that_a_symmetry_exchanges():
    """x_0 x_1 = 0 on lambda = x_0^2 + x_1^2: both turn where they cross, which has no other name; it is one point, not two."""
    problem = AlgebraicProblem(lambda x, p: jnp.stack([x[0] * x[1], p[0] - x[0] ** 2 - x[1] ** 2]), 2)
    first = start_point(problem, np.array([1.0, 0.0]), np.ones(1), 0, -1.0)
    assert isinstance(first, Point)
    (found,) = (one for one in traced(Continuation([first], [Stop(Parameter(0), 0.5)])) if isinstance(one, Located))
    point = found.point
    assert point.kind is Kind.BRANCH_POINT
    np.testing.assert_allclose([*point.x, point.parameter], 0.0, atol=1e-9)
    for side in side_branches(point, first.tangent, 0.1):
        branch = Continuation([side], [Stop(Parameter(0), 0.25, ends=True)])
        *_, end = branch
        np.testing.assert_allclose(np.abs(end.x), [0.0, 0.5], atol=1e-8)


@pytest.mark.parametrize("is_fold", [True, False])
def test_the_defining_jacobian_is_the_derivative(is_fold: bool):
    """J dX at the singular point against central differences of the residual, along random smooth increments."""
    if is_fold:
        point = bratu_fold(5, 3)
        system = SingularProblem(point.problem, 0, point.kernel)
        big_x = np.append(point.x, point.p)
    else:
        problem = chafee_infante(5, 3)
        x = at_rest(problem)
        point = locate_branch_point(problem, 0, x, np.array([1.1]), np.append(x, 1.0))
        assert isinstance(point, SingularPoint)
        system = SingularProblem(problem, 0, point.kernel)
        big_x = np.append(point.x, [point.parameter, 0.0])
    rest = REST
    residual, linearisation = system.linearise(big_x, point.p, rate=rest)
    assert np.abs(residual).max() < 1e-9
    rng = np.random.default_rng(0)
    for _ in range(3):
        rhs = rng.standard_normal(len(big_x))
        step = linearisation.solve(rhs)
        size = 1e-5 / np.abs(step).max()
        ahead, behind = (system.residual(big_x + sign * size * step, point.p, rest) for sign in (1.0, -1.0))
        np.testing.assert_allclose((ahead - behind) / (2.0 * size), rhs, atol=2e-5 * np.abs(rhs).max())


def test_branch_directions_solve_their_quadratic():
    """tau^T A tau = 0 for random indefinite forms, also where an axis is a solution; none for definite ones."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        a, b, c = rng.standard_normal(3)
        form = np.array([[a, b], [b, c]])
        directions = branch_directions(form)
        assert len(directions) == (2 if b * b > a * c else 0)
        for tau in directions:
            assert abs(tau @ form @ tau) < 1e-12
    exact = branch_directions(np.array([[0.0, 1.0], [1.0, 0.0]]))
    np.testing.assert_allclose(np.sort(np.abs(exact).ravel()), [0.0, 0.0, 1.0, 1.0])


def test_no_singular_point_is_an_outcome():
    """From a state far from any singular point of a linear problem there is nothing to find."""
    problem = chafee_infante(10)
    x = at_rest(problem)
    mode = np.random.default_rng(0).standard_normal(len(x))
    point = locate_fold(problem, 0, x, np.array([0.5]), mode)
    assert isinstance(point, Outcome)
    assert not point.is_success
