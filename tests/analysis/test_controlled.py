"""Branches under control: a measure prescribed, a parameter free; folds straightened, rates of the controlled system."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.controlled import ControlledProblem
from shapespace.analysis.extended import AbstractMeasure, Parameter
from shapespace.analysis.stability import Spectral, solve_spectrum
from shapespace.analysis.stationary import solve_stationary
from shapespace.analysis.tracing import traced
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractContinuableProblem, Rate
from shapespace.study.verification.classic import at_rest, bratu

TRANSFER = np.array([[-1.0, 0.3], [0.0, -3.0]])
INPUT = np.array([1.0, 2.0])


@dataclass(frozen=True)
class Entry(AbstractMeasure):
    """x[place]^power."""

    place: int
    power: int = 1

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        return float(x[self.place] ** self.power)

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        row = np.zeros_like(x)
        row[self.place] = self.power * x[self.place] ** (self.power - 1)
        return row, np.zeros_like(p)


def exact_bratu(slope: float) -> float:
    """lambda with y'(0) = slope: lambda = theta^2/(2 cosh^2(theta/4)), y'(0) = theta tanh(theta/4)."""
    theta = brentq(lambda t: t * np.tanh(t / 4.0) - slope, 1e-6, 50.0, xtol=1e-14)
    return float(theta**2 / (2.0 * np.cosh(theta / 4.0) ** 2))


def test_a_prescribed_slope_leads_straight_past_the_fold_of_bratu():
    """Row 1: at the fold lambda* = 3.5138 y'(0) is 4; in y'(0) the branch never turns, and lambda answers exactly."""
    inner = bratu()
    found = solve_stationary(inner, at_rest(inner), np.array([1.0]))
    problem = ControlledProblem(found.problem, 0, Entry(1))
    x = np.append(found.x, 1.0)
    start = start_point(problem, x, np.array([found.x[1]]), 0, 1.0, Arclength(parameter_scale=8.0))
    assert isinstance(start, Point)
    wanted = (2.0, 4.0, 6.0)
    stops = [Stop(Parameter(0), value) for value in wanted] + [Stop(Parameter(0), 8.0, "end", ends=True)]
    branch = Continuation([start], stops, Arclength(parameter_scale=8.0))
    points = list(traced(branch))
    assert branch.outcome is Outcome.REACHED_STOP
    assert all(isinstance(one, Point) for one in points), "a fold or branch point where there is none"
    stopped = {one.parameter: float(one.x[-1]) for one in points if isinstance(one, Point) and one.label}
    for value in (*wanted, 8.0):
        assert stopped[value] == pytest.approx(exact_bratu(value), abs=1e-8)
    assert stopped[4.0] == pytest.approx(3.513830719125161, abs=1e-8)


def test_rates_under_control_are_the_zeros_of_the_transfer_function():
    """dx/dt = A x + b p with x_1 held: s is where e_1 (s - A)^-1 b vanishes, here one number."""
    inner = AlgebraicProblem(lambda x, p: jnp.asarray(TRANSFER) @ x + jnp.asarray(INPUT) * p[0], 2)
    problem = ControlledProblem(inner, 0, Entry(0))
    spectrum = solve_spectrum(problem, np.zeros(3), np.zeros(1), Spectral(count=1))
    # (s + 3) b_1 + A_12 b_2 = 0.
    exact = -3.0 - TRANSFER[0, 1] * INPUT[1] / INPUT[0]
    assert spectrum.converged
    assert [rate.real for rate in spectrum.rates] == pytest.approx([exact], abs=1e-9)
    assert spectrum.n_unstable == 0


def test_derivatives_agree_with_differences():
    inner = AlgebraicProblem(lambda x, p: jnp.stack([jnp.sin(x[0]) * x[1] + p[0], x[1] ** 2 * p[0] - x[0]]), 2)
    problem = ControlledProblem(inner, 0, Entry(1, power=3))
    random = np.random.default_rng(1)
    x, one, other = random.standard_normal((3, 3))
    p, dp, ep = random.standard_normal((3, 1))
    rest, step = REST, 1e-6

    def residual(t: float) -> Array:
        return problem.residual(x + t * one, p + t * dp, Rate(0.0, np.zeros(2)))

    first = (residual(step) - residual(-step)) / (2.0 * step)
    np.testing.assert_allclose(problem.derivative(x, p, one, dp), first, atol=1e-8)
    ends = [problem.derivative(x + t * other, p + t * ep, one, dp) for t in (step, -step)]
    second = (ends[0] - ends[1]) / (2.0 * step)
    np.testing.assert_allclose(problem.second_derivative(x, p, one, dp, other, ep), second, atol=1e-6)
    target, linearisation = problem.linearise(x, p, rest)
    np.testing.assert_allclose(problem.derivative(x, p, linearisation.solve(target), np.zeros(1)), target, atol=1e-10)
