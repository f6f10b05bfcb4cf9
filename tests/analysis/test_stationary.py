"""States at rest: from guesses, on meshes that move, from other parameters; and how searches fail."""

import jax.numpy as jnp
import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.extended import AbstractMeasure, Affine, ExtendedProblem, Given, Parameter
from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractContinuableProblem
from shapespace.numerics.adaptation import discretisation_error
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.newton import Newton, solve_root
from shapespace.study.verification.classic import at_rest, bratu, carrier, mean_free, middle

TIGHT = Newton(1e-12)


def solved_bratu(value: float) -> Stationary:
    problem = bratu(10)
    found = solve_stationary(problem, at_rest(problem), np.array([value]))
    assert found.outcome is Outcome.CONVERGED
    return found


def bratu_middle(found: Stationary) -> float:
    assert isinstance(found.problem, CollocationProblem)
    return middle(found.problem, found.x)


def test_lower_branch_of_bratu():
    """u(1/2) at lambda = 1 in closed form (Buckmire)."""
    problem = bratu(10)
    found = solve_stationary(problem, at_rest(problem), np.ones(1), TIGHT)
    assert found.outcome is Outcome.CONVERGED
    assert found.settled
    assert found.correction <= 1e-12
    assert found.residual < 1e-10
    assert abs(bratu_middle(found) - 0.140539214400472) < 1e-9


def test_stepping_to_other_parameters():
    """From lambda = 0.1 to 3.5, close to the fold, and back: the lower branch both times, the exact parameters."""
    start = solved_bratu(0.1)
    near_fold = step_to(start, np.array([3.5]))
    assert near_fold.outcome is Outcome.CONVERGED
    assert near_fold.p == 3.5
    assert bratu_middle(near_fold) < 1.186842168634389
    back = step_to(near_fold, np.array([0.1]))
    assert bratu_middle(back) == pytest.approx(bratu_middle(start), abs=1e-10)


def test_parameters_without_a_state_are_not_reached():
    """Bratu's problem has no solution beyond its fold: the last state before it, its parameters and advice come back."""
    found = step_to(solved_bratu(1.0), np.array([4.0]))
    assert found.outcome is Outcome.NOT_REACHED
    assert not found.outcome.is_success
    assert "fold" in found.outcome.advice
    assert 3.5 < found.p[0] < 3.513830719125161
    again = solve_stationary(found.problem, found.x, found.p)
    assert again.outcome is Outcome.CONVERGED
    assert again.iterations <= 2


def test_stepping_halves_where_newton_alone_fails():
    """x = tan(p): undamped Newton from tan(-1.5) does not find tan(1.5), steps do; none crosses the pole at pi/2."""
    problem, plain = AlgebraicProblem(lambda x, p: jnp.arctan(x) - p, 1), Newton(min_damping=1.0)
    start = solve_stationary(problem, np.tan([-1.5]), np.array([-1.5]))
    assert not solve_stationary(problem, start.x, np.array([1.5]), plain).outcome.is_success
    found = step_to(start, np.array([1.5]), plain)
    assert found.outcome is Outcome.CONVERGED
    assert found.x[0] == pytest.approx(np.tan(1.5), rel=1e-8)
    assert step_to(start, np.array([1.6])).outcome is Outcome.NOT_REACHED


def test_a_start_that_does_not_converge():
    """x^2 + 1 = 0 has no real root: the best residual and advice are told, and stepping from there does not start."""
    problem = AlgebraicProblem(lambda x, p: x**2 + p, 1)
    found = solve_stationary(problem, np.array([3.0]), np.array([1.0]))
    assert not found.outcome.is_success
    assert not found.settled
    assert "nearer state" in found.outcome.advice
    assert 1.0 <= found.residual < 10.0
    assert step_to(found, np.array([-1.0])) is found


def test_the_mesh_follows_layers():
    """Carrier's problem at eps = 0.05 by steps from 0.5: the mesh settles and meets its tolerance."""
    problem = carrier(20)
    start = solve_stationary(problem, at_rest(problem), np.array([0.5]))
    found = step_to(start, np.array([0.05]))
    assert found.outcome is Outcome.CONVERGED
    assert found.settled
    assert isinstance(found.problem, CollocationProblem)
    assert found.problem.elements > 20
    assert discretisation_error(found.problem.unpack(found.x)) <= found.problem.tolerance


def test_moves_are_bounded():
    """Without moves the first mesh is kept and the result says that it has not settled."""
    problem = carrier(20)
    found = solve_stationary(problem, at_rest(problem), np.array([0.2]), max_moves=0)
    assert found.outcome is Outcome.CONVERGED
    assert found.problem is problem
    assert not found.settled


class Middle(AbstractMeasure):
    """y(1/2) of a collocation problem on a mesh with a node there."""

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        assert isinstance(problem, CollocationProblem)
        return float(problem.unpack(x).nodes[problem.elements // 2, 0])

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        assert isinstance(problem, CollocationProblem)
        row = np.zeros_like(x)
        row[problem.elements // 2 * problem.n] = 1.0
        return row, np.zeros_like(p)


def test_a_given_observable_frees_a_parameter():
    """Bratu with y(1/2) given as that of the upper branch at lambda = 1 (Buckmire): lambda comes out."""
    problem = bratu(40)
    extended = ExtendedProblem(problem, (0,), (Given(Middle(), 4.091467246189261),))
    start = solved_bratu(3.4)
    x = start.problem.carried(start.x, problem)
    root = solve_root(extended, extended.joined(x, start.p), start.p, REST, TIGHT)
    assert root.outcome is Outcome.CONVERGED
    assert root.x[-1] == pytest.approx(1.0, abs=1e-9)


def test_the_extended_jacobian_is_the_derivative():
    """Two free parameters, a plane and an observable: J dX against central differences, J^-1 J dX = dX."""
    problem = mean_free(6, 3)
    rng = np.random.default_rng(0)
    x, p = 0.3 * rng.standard_normal(len(at_rest(problem))), np.array([1.3, 0.2])
    plane = Affine(rng.standard_normal(len(x)), rng.standard_normal(2), 0.7)
    extended = ExtendedProblem(problem, (1, 0), (plane, Given(Parameter(0), 1.0)))
    X, dX = extended.joined(x, p), rng.standard_normal(len(x) + 2)
    np.testing.assert_array_equal(extended.split(X, np.zeros(2))[1], p)
    rate = REST
    ahead, behind = (extended.residual(X + h * dX, p, rate) for h in (1e-5, -1e-5))
    derivative = extended.derivative(X, p, dX)
    np.testing.assert_allclose((ahead - behind) / 2e-5, derivative, atol=1e-7)
    _, linearisation = extended.linearise(X, p, rate)
    np.testing.assert_allclose(linearisation.solve(derivative), dX, atol=1e-9)


def test_conditions_must_match_the_free_parameters():
    with pytest.raises(ValueError, match="equally many"):
        ExtendedProblem(bratu(5), (0,), ())
