"""Damped Newton: how it ends, how little it differentiates, and the Jacobians that surfaces hand to it."""

from collections.abc import Callable

import numpy as np
import pytest
from tests.dense import NO_PARAMETERS, DenseLinearisation, DenseProblem, at_rest
from tests.surfaces import make_engine, march

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.numerics.newton import Newton, Root, solve_root
from shapespace.study.engine import Engine


def find(function: Callable[[Array], Array], *start: float, **options: float) -> Root:
    """Solve function(x) = 0."""
    problem = DenseProblem(lambda x, dq, p: function(x))
    x = np.array(start)
    return solve_root(problem, x, NO_PARAMETERS, at_rest(len(x)), Newton(**options))


def coupled(x: Array) -> Array:
    """Roots at (1, 2) and elsewhere."""
    return np.array([x[0] ** 2 * x[1] - 2.0, np.exp(x[0] - 1.0) + x[1] - 3.0])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-10])
def test_converges_well_within_its_tolerance(tolerance: float):
    root = find(coupled, 1.3, 1.6, tolerance=tolerance)
    error = np.abs(root.x - [1.0, 2.0]).max()
    assert root.outcome is Outcome.CONVERGED
    assert root.correction <= tolerance
    assert error <= tolerance, f"error {error:.1e} at tolerance {tolerance:.0e}"
    assert root.linearisation is not None


@pytest.mark.parametrize(
    ("function", "start", "solution"),
    [
        (np.arctan, 20.0, 0.0),
        (np.log, 8.0, 1.0),
        (lambda x: x / np.sqrt(1.0 + x * x), 5.0, 0.0),
        (lambda x: np.exp(x) - 1.0, -9.0, 0.0),
    ],
    ids=["arctan", "log", "saturating", "exp"],
)
def test_damping_saves_starts_from_which_full_steps_fail(
    function: Callable[[Array], Array], start: float, solution: float
):
    """Full Newton steps diverge from these starts, or leave the function's domain where it is NaN."""
    root = find(function, start, max_iterations=60)
    assert root.outcome is Outcome.CONVERGED, root
    assert abs(root.x[0] - solution) < 1e-8


def test_an_undefined_start_is_not_finite():
    root = find(np.log, -1.0)
    assert root.outcome is Outcome.NOT_FINITE, root
    assert root.linearisation is None


def test_a_free_unknown_is_singular():
    root = find(lambda x: np.array([x[0] + x[1] - 1.0, 2.0 * x[0] + 2.0 * x[1] - 3.0]), 0.2, 0.3)
    assert root.outcome is Outcome.SINGULAR, root


def test_a_function_without_root_diverges():
    """x^2 + 1: the natural monotonicity test cannot be passed for ever."""
    root = find(lambda x: x**2 + 1.0, 0.3, max_iterations=200)
    assert root.outcome is Outcome.DIVERGED, root
    assert root.x[0] == pytest.approx(0.0, abs=0.1)


def test_a_root_at_infinity_uses_up_the_iterations():
    root = find(np.exp, 0.0, max_iterations=12)
    assert root.outcome is Outcome.MAX_ITERATIONS, root
    assert root.iterations == 12


def test_convergence_is_quadratic_in_jacobians():
    """From 0.3 away, 1e-12 takes few Jacobians even where none is reused."""
    root = find(coupled, 1.3, 1.6, tolerance=1e-12, reuse_contraction=1e-12)
    assert root.outcome is Outcome.CONVERGED
    assert root.jacobians <= 5, root


def test_factors_of_a_near_state_are_used_and_of_a_far_one_replaced():
    problem = DenseProblem(lambda x, dq, p: coupled(x))
    start, rest = np.array([1.01, 1.99]), at_rest(2)
    near = problem.linearise(np.array([1.0, 2.0]), NO_PARAMETERS, rest)[1]
    far = problem.linearise(np.array([3.0, -2.0]), NO_PARAMETERS, rest)[1]
    problem.calls[0] = 0
    root = solve_root(problem, start, NO_PARAMETERS, rest, Newton(), near)
    assert (root.outcome, root.jacobians, problem.calls[0]) == (Outcome.CONVERGED, 0, 0), root
    root = solve_root(problem, start, NO_PARAMETERS, rest, Newton(), far)
    assert root.outcome is Outcome.CONVERGED, root
    assert root.jacobians == problem.calls[0] > 0
    assert np.abs(root.x - [1.0, 2.0]).max() < 1e-8


def test_the_error_left_is_a_tenth_of_the_tolerance_with_factors_from_elsewhere():
    """Twice the true slope halves the error at each correction: not good enough where that is all that is left."""
    problem, rest = DenseProblem(lambda x, dq, p: x + x**2), at_rest(1)
    poor = DenseLinearisation(np.array([[2.0]]))
    for start in np.geomspace(1e-9, 1e-7, 9):
        root = solve_root(problem, np.array([start]), NO_PARAMETERS, rest, Newton(1e-8), poor)
        assert root.outcome is Outcome.CONVERGED
        assert abs(root.x[0]) < 1e-9, f"from {start:.1e} to {root.x[0]:.1e}"


def test_round_off_ends_the_iteration():
    """Noise of 1e-9 in F lets corrections shrink no further; a tolerance below asks for no more."""
    problem = DenseProblem(lambda x, dq, p: x**2 - 2.0 + 1e-9 * np.sin(1e17 * np.real(x)))
    for start in (1.0, 1.4142, np.sqrt(2.0)):
        root = solve_root(problem, np.array([start]), NO_PARAMETERS, at_rest(1), Newton(1e-12))
        assert root.outcome is Outcome.CONVERGED, root
        assert abs(root.x[0] - np.sqrt(2.0)) < 1e-9
        assert root.iterations < 12, root


@pytest.mark.parametrize("scales", [(1.0, 1e-12), (1e9, 1e-3)])
def test_iterates_do_not_depend_on_the_scale_of_the_equations(scales: tuple[float, float]):
    plain = find(coupled, 2.5, 0.4)
    scaled = find(lambda x: coupled(x) * np.array(scales), 2.5, 0.4)
    assert scaled.outcome is plain.outcome
    assert scaled.iterations == plain.iterations
    assert np.abs(scaled.x - plain.x).max() < 1e-9


@pytest.mark.parametrize("options", [{"tolerance": 0.0}, {"tolerance": 2.0}, {"min_damping": 0.0}])
def test_options_out_of_range_are_refused(options: dict[str, float]):
    with pytest.raises(ValueError, match="must lie in"):
        Newton(**options)


def moving_surface(name: str) -> tuple[Engine, Array, Rate]:
    """A surface in motion, far from its start."""
    constants = {
        "polar-swimmer": {"seed_amplitude": 0.3, "spontaneous_curvature": 0.5, "ring_amplitude": 0.3},
        "membrane-protrusion": {"pulling_force": 10.0},
    }[name]
    engine = make_engine(name, azimuthal_flow=True, **constants)
    engine.p[engine.system.parameters.index("rotation_rate")] = 0.8
    moments, outcome = march(engine, 0.01, tolerance=1e-3)
    assert outcome is Outcome.REACHED_END
    rate = moments[-1].rate
    assert rate is not None
    return engine, moments[-1].x, rate


@pytest.mark.parametrize("name", ["polar-swimmer", "membrane-protrusion"])
def test_jacobian_of_a_surface(name: str):
    """F(x + e d) - F(x) - e J d falls fourfold as e is halved: for d = J^{-1} w that also tests the factorisation."""
    engine, x, rate = moving_surface(name)
    problem = engine.problem
    residual, linearisation = problem.linearise(x, engine.p, rate)
    np.testing.assert_allclose(residual, problem.residual(x, engine.p, rate), rtol=0.0, atol=1e-12)
    rng = np.random.default_rng(7)
    for trial in range(3):
        w = problem.residual(x + 1e-2 * rng.standard_normal(len(x)) * (np.abs(x) + 0.1), engine.p, rate) - residual
        d = linearisation.solve(w)
        d, w = d / np.abs(d).max(), w / np.abs(d).max()
        sizes = 1e-3 * 0.5 ** np.arange(5)
        rests = [np.linalg.norm(problem.residual(x + e * d, engine.p, rate) - residual - e * w) for e in sizes]
        ratios = np.array(rests[:-1]) / rests[1:]
        assert ((ratios > 3.8) & (ratios < 4.2)).all(), f"direction {trial}: remainders {rests}, ratios {ratios}"
