"""Deflation: other solutions beside known ones, modulo the symmetry, on any mesh, with a record of every start tried."""

import jax.numpy as jnp
import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.deflation import (
    DeflatedProblem,
    Deflation,
    Guess,
    images,
    is_same,
    search,
    solve_deflated,
)
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.analysis.tracing import Located, traced
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.verification.classic import at_rest, bratu, carrier, middle
from shapespace.study.verification.paths import by_modes, solutions, with_images


def test_row_6_counts_of_carriers_solutions():
    """At least 2, 4, 4, 6 and 8, mirror images counted, from y = 0 alone."""
    problem = carrier(40)
    guess = Guess("y = 0", problem, at_rest(problem))
    for eps, count in ((0.5, 2), (0.4, 4), (0.3, 4), (0.26, 6), (0.22, 8)):
        found = solutions([guess], np.array([eps]))
        assert with_images(found) >= count, f"eps = {eps}"
        assert all(one.settled and one.residual < 1e-8 for one in found)


def test_row_6_the_isolated_pair():
    """Deflated continuation from eps = 0.3 to 0.26 meets the pair that no branch leads to; its fold is at 0.2852253820."""
    problem, p = carrier(40), np.array([0.26])
    before = solutions([Guess("y = 0", problem, at_rest(problem))], np.array([0.3]))
    carried = [step_to(one, p) for one in before]
    guesses = [Guess(f"solution {i} at eps = 0.3", problem, problem_x(one, problem)) for i, one in enumerate(carried)]
    found = solutions(guesses, p)
    isolated = [one for one in found if not any(is_same(one, other) for other in carried)]
    assert len(isolated) >= 2
    folds = [fold for one in isolated if (fold := _fold_above(one)) is not None]
    assert len(folds) >= 2
    np.testing.assert_allclose(folds, 0.2852253820, rtol=0.0, atol=1e-9)


def problem_x(one: Stationary, problem: CollocationProblem) -> Array:
    return one.problem.carried(one.x, problem)


def _fold_above(one: Stationary) -> float | None:
    """The first fold as eps rises to 0.3."""
    start = start_point(one.problem, one.x, one.p, 0, 1.0)
    assert not isinstance(start, Outcome)
    for located in traced(Continuation([start], [Stop(Parameter(0), 0.3, "end", True)], Arclength(first=0.05))):
        if isinstance(located, Located) and located.point.kind is Kind.FOLD:
            assert abs(located.point.parameter - 0.2852253820) <= located.point.parameter_error + 1e-10
            return located.point.parameter
    return None


def test_every_start_is_on_record():
    """Bratu's lower and upper solution; each start with what became of it, and how a search goes on after a part."""
    problem, p = bratu(), np.ones(1)
    guess = Guess("u = 0", problem, at_rest(problem))
    further = lambda trial: by_modes(trial, (0.3, 1.0))
    trials = list(search([guess], p, further))
    assert [trial.name for trial in trials[:3]] == ["u = 0", "u = 0", "solution 0 +0.3 mode 1"]
    found = [trial for trial in trials if trial.is_new]
    assert [trial.number for trial in found] == [0, 1]
    assert not any(trial.found.outcome.is_success for trial in trials if not trial.is_new)
    tops = [middle(trial.found.problem, trial.found.x) for trial in found]
    np.testing.assert_allclose(tops, [0.140539214400472, 4.091467246189261], atol=1e-8)
    again = list(search([guess], p, further, trials[:4]))
    assert [(one.name, one.number, one.found.outcome) for one in again] == [
        (one.name, one.number, one.found.outcome) for one in trials[4:]
    ]


def test_a_mirror_image_is_no_other_solution():
    """An asymmetric solution on an uneven mesh of its own is known with its image, and a start there repeats it."""
    problem, p = carrier(40), np.array([0.4])
    found = solutions([Guess("y = 0", problem, at_rest(problem))], p)
    (one,) = (one for one in found if with_images([one]) == 2)
    assert isinstance(one.problem, CollocationProblem)
    uneven = one.problem.on_mesh(np.linspace(0.0, 1.0, 81) ** 1.2)
    image = images(one, uneven)[1]
    mirrored = solve_stationary(uneven, image, p)
    assert mirrored.outcome is Outcome.CONVERGED
    assert is_same(mirrored, one)
    assert is_same(one, mirrored)
    others = [other for other in found if other is not one]
    assert not any(is_same(mirrored, other) for other in others)
    trial = solve_deflated(Guess("image", uneven, mirrored.x), p, others)
    assert trial.is_new
    trial = solve_deflated(Guess("image", uneven, mirrored.x), p, found)
    assert trial.found.outcome is not Outcome.CONVERGED


def test_repeats_are_rejected():
    """With deflation too weak to act, the known solution is found again and called so, with its number."""
    problem, p = bratu(), np.ones(1)
    first = solve_deflated(Guess("u = 0", problem, at_rest(problem)), p, [])
    weak = Deflation(shift=1e30)
    trial = solve_deflated(Guess("u = 0", problem, at_rest(problem)), p, [first.found], weak)
    assert trial.found.outcome is Outcome.REPEATED
    assert trial.number == 0
    assert not trial.is_new


def test_all_roots_of_a_polynomial():
    """(x - 1)(x - 2)(x - 3)(x - 5) = 0 from two starts."""
    problem = AlgebraicProblem(lambda x, p: (x - 1.0) * (x - 2.0) * (x - 3.0) * (x - 5.0) + 0.0 * p, 1)
    found = [
        trial.found.x[0]
        for trial in search([Guess(str(x), problem, np.array([x])) for x in (0.4, 2.2)], np.zeros(1), lambda _: ())
        if trial.is_new
    ]
    np.testing.assert_allclose(sorted(found), [1.0, 2.0, 3.0, 5.0], atol=1e-7)


def test_the_deflated_jacobian_is_the_derivative():
    """(J + F grad(ln M)^T) M against central differences of M F in two unknowns and two known solutions."""
    problem = AlgebraicProblem(lambda x, p: jnp.array([x[0] ** 2 + x[1] ** 2 - 5.0, x[0] * x[1] - 2.0]) + 0.0 * p, 2)
    p = np.zeros(1)
    known = [solve_stationary(problem, np.array(x), p) for x in ((1.1, 2.1), (-2.1, -1.0))]
    deflated = DeflatedProblem.of(problem, known, Deflation(power=3.0, shift=0.5))
    x, rng = np.array([0.4, 1.3]), np.random.default_rng(0)
    rest = REST
    residual, linearisation = deflated.linearise(x, p, rest)
    np.testing.assert_allclose(residual, deflated.residual(x, p, rest))
    for rhs in rng.standard_normal((3, 2)):
        step = linearisation.solve(rhs)
        ahead, behind = (deflated.residual(x + h * step, p, REST) for h in (1e-6, -1e-6))
        np.testing.assert_allclose((ahead - behind) / 2e-6, rhs, rtol=1e-6, atol=1e-8)


def test_the_factor_does_not_depend_on_the_mesh():
    """M at the same function beside the same solution, on meshes of 20 to 80 elements: equal to the trapezoidal rule's error."""
    coarse, p = bratu(20), np.ones(1)
    known = solve_stationary(coarse, at_rest(coarse), p)
    factors = []
    for elements in (20, 40, 80):
        problem = bratu(elements)
        factors.append(DeflatedProblem.of(problem, [known]).factor(at_rest(problem))[0])
    assert abs(factors[1] / factors[2] - 1.0) < 1e-3
    assert 3.0 < (factors[0] - factors[2]) / (factors[1] - factors[2]) < 7.0


@pytest.mark.parametrize(("power", "shift"), [(0.5, 1.0), (2.0, 0.0)])
def test_options_are_checked(power: float, shift: float):
    with pytest.raises(ValueError, match="power must be >= 1"):
        Deflation(power, shift)
