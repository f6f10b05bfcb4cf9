"""Leading growth rates of boundary value problems: exact rates, the dense pencil, convergence, and honest failures."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import brentq

from shapespace.analysis.stability import Spectral, Spectrum, solve_spectrum
from shapespace.base.arrays import Array, Traced
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractLinearisation, Actions, Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.mesh import uniform_mesh
from shapespace.numerics.newton import Newton, solve_root
from shapespace.numerics.system import AbstractSystem
from shapespace.study.verification.classic import at_rest, bratu, chafee_infante, start_from

NONE = np.zeros(0)


class Linear(AbstractSystem):
    """y_t = D y'' + A(u) y + m, y = 0 at both ends, for any number of fields; slopes are fields too.

    with_algebraic: A y enters as an algebraic field equal to it. with_multiplier: m is a scalar that keeps the integral
    of the first field, else zero. p: D.
    """

    reaction: Callable[[Traced], Traced] = eqx.field(static=True)
    fields: tuple[str, ...] = eqx.field(static=True)
    algebraic: tuple[str, ...] = eqx.field(static=True, default=())
    scalars: tuple[str, ...] = eqx.field(static=True, default=())
    parameters: tuple[str, ...] = eqx.field(static=True, default=("diffusivity",))

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        n = len(self.fields) // 2
        reaction = self.reaction(u) @ y[:n]
        multiplier = s if self.scalars else jnp.zeros(1)
        force = a if self.algebraic else reaction
        rows = [dy[:n] - y[n:], p[0] * dy[n:] + force + multiplier - dq]
        return jnp.concatenate([*rows, a - reaction] if self.algebraic else rows)

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[: len(self.fields) // 2]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        n = len(self.fields) // 2
        return jnp.concatenate([y0[:n], y1[:n]])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return y[:1] if self.scalars else jnp.zeros((0,))

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.zeros(len(self.scalars))


def linear(reaction: Callable[[Traced], Traced], n: int, elements: int = 20, degree: int = 4, **kinds: tuple[str, ...]):
    """A linear problem of n rates."""
    names = tuple(f"{kind}{i}" for kind in ("y", "slope") for i in range(n))
    system = Linear(reaction, names, **kinds)
    return CollocationProblem(system, uniform_mesh(elements), degree, 1e-8)


def spectrum_at_rest(problem: CollocationProblem, p: float = 1.0, **options: int) -> Spectrum:
    """Of the zero state."""
    return solve_spectrum(problem, at_rest(problem), np.array([p]), Spectral(**options))


def bratu_state(problem: CollocationProblem, guess: float) -> Array:
    """lam = 1: u = 2 log(cosh(t)/cosh(t (1 - 2 x))), cosh(t)/t = sqrt(8), polished by Newton."""
    t = brentq(lambda t: np.cosh(t) - np.sqrt(8.0) * t, *((0.1, 1.0) if guess < 1.0 else (1.0, 5.0)))
    value = lambda u: 2.0 * np.log(np.cosh(t) / np.cosh(t * (1.0 - 2.0 * u)))
    slope = lambda u: 4.0 * t * np.tanh(t * (1.0 - 2.0 * u))
    bend = lambda u: -np.exp(value(u))
    x = start_from(
        problem,
        lambda u: np.stack([value(u), slope(u)], axis=1),
        lambda u: np.stack([slope(u), bend(u)], axis=1),
    )
    p = np.array([1.0])
    root = solve_root(problem, x, p, REST, Newton())
    assert root.outcome is Outcome.CONVERGED
    return root.x


@pytest.mark.parametrize(("guess", "leading", "unstable"), [(0.5, -8.73971097, 0), (2.0, 28.87309109, 1)])
def test_bratu_states(guess: float, leading: float, unstable: int):
    """Row 1 of the benchmark table, to all its digits."""
    problem = bratu(elements=40)
    found = solve_spectrum(problem, bratu_state(problem, guess), np.array([1.0]))
    assert found.converged
    assert abs(found.rates[0] - leading) < 6e-9, found.rates[0]
    assert found.n_unstable == unstable
    assert len(found.rates) == 6
    assert (np.diff(found.rates.real) < 0.0).all()
    assert np.isclose(problem.weights(bratu_state(problem, guess)) @ np.abs(found.modes[0]) ** 2, 1.0)


@pytest.mark.parametrize("lam", [0.3, 2.5, 4.0, 10.0, 60.0])
def test_chafee_infante_at_zero(lam: float):
    """s = lam - n^2: as many unstable as n < sqrt(lam), one neutral at a pitchfork, all modes odd under y -> -y."""
    problem = chafee_infante(elements=40)
    found = spectrum_at_rest(problem, lam)
    exact = lam - np.arange(1, 7) ** 2
    assert found.converged
    np.testing.assert_allclose(found.rates, exact, atol=1e-8)
    assert (np.abs(found.rates - exact) <= found.errors).all()
    assert found.n_unstable == sum(n * n < lam for n in range(1, 20))
    assert found.neutral == ({1: ""} if lam == 4.0 else {})
    assert set(found.parities) == {"antisymmetric"}


def test_algebraic_fields_change_nothing():
    """a = 3 y as an unknown of its own: s = 3 - (n pi)^2."""
    reaction = lambda u: jnp.full((1, 1), 3.0)
    found = spectrum_at_rest(linear(reaction, 1, algebraic=("a",)))
    assert found.converged
    np.testing.assert_allclose(found.rates, 3.0 - (np.pi * np.arange(1, 7)) ** 2, atol=1e-8)


def test_a_constraint_with_its_multiplier():
    """Index 2: the integral of y stays, so y is sin(2 n pi u), or even with tan(k/2) = k/2; s = -k^2."""
    reaction = lambda u: jnp.zeros((1, 1))
    found = spectrum_at_rest(linear(reaction, 1, elements=40, scalars=("m",)))
    even = [2.0 * brentq(lambda t: np.sin(t) - t * np.cos(t), n * np.pi, (n + 0.5) * np.pi) for n in (1, 2, 3)]
    exact = -(np.sort(np.append(even, 2.0 * np.pi * np.arange(1, 4))) ** 2)
    assert found.converged
    np.testing.assert_allclose(found.rates, exact, rtol=1e-9)
    assert found.n_unstable == 0


@pytest.mark.parametrize(("growth", "turning"), [(-5.0, 2.0), (20.0, 30.0), (100.0, 4000.0)])
def test_oscillating_pairs(growth: float, turning: float):
    """A rotation of two fields: s = growth - (n pi)^2 +- i turning, also far from the real axis."""
    rotation = jnp.array([[growth, -turning], [turning, growth]])
    found = spectrum_at_rest(linear(lambda u: rotation, 2, elements=40))
    exact = growth - (np.pi * np.repeat(np.arange(1, 4), 2)) ** 2 + 1j * turning * np.tile([1.0, -1.0], 3)
    assert found.converged
    np.testing.assert_allclose(found.rates, exact, rtol=1e-9)
    assert found.n_unstable == sum(2 for n in range(1, 10) if growth > (np.pi * n) ** 2)
    np.testing.assert_allclose(found.modes[1], found.modes[0].conjugate())
    assert found.disc.radius**2 >= found.disc.centre**2 + turning**2


def test_pairs_are_not_parted():
    """Five rates wanted of three pairs: six come."""
    rotation = jnp.array([[0.0, -7.0], [7.0, 0.0]])
    assert len(spectrum_at_rest(linear(lambda u: rotation, 2), count=5).rates) == 6


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_order_of_convergence(degree: int):
    """The error of a rate falls as width^(2 degree), the order at element ends."""
    exact = 10.0 - 9.0
    errors = [
        abs(spectrum_at_rest(chafee_infante(elements, degree), 10.0).rates[2] - exact)
        for elements in ((6, 12) if degree == 4 else (8, 16))
    ]
    order = np.log2(errors[0] / errors[1])
    assert abs(order - 2 * degree) < 0.35, f"order {order:.2f} from {errors}"


def test_higher_degrees_converge():
    """At the same mesh each degree gains at least a factor of ten."""
    errors = [abs(spectrum_at_rest(chafee_infante(8, degree), 10.0).rates[2] - 1.0) for degree in (2, 3, 4, 5)]
    assert (np.array(errors[1:]) < 0.1 * np.array(errors[:-1])).all(), errors


def dense_rates(problem: CollocationProblem, x: Array, p: Array) -> Array:
    """All finite eigenvalues of the dense pencil, by QZ."""
    unit = np.eye(len(x))
    actions = problem.actions(x, p)
    products = (actions.jacobian, actions.mass)
    jacobian, mass = (np.stack([product(column) for column in unit], axis=1) for product in products)
    alpha, beta = scipy.linalg.eigvals(jacobian, -mass, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-7 * np.abs(alpha)
    return alpha[finite] / beta[finite]


@pytest.mark.parametrize("seed", range(8))
def test_random_problems_agree_with_the_dense_pencil(seed: int):
    """Two coupled fields with random coefficients along u, some with algebraic fields, some with a multiplier."""
    random = np.random.default_rng(seed)
    constant, wave = random.standard_normal((2, 2, 2)) * [[[30.0]], [[20.0]]]
    kinds: dict[str, tuple[str, ...]] = {}
    if seed % 2:
        kinds["algebraic"] = ("a0", "a1")
    if seed % 3 == 0:
        kinds["scalars"] = ("m",)
    problem = linear(lambda u: jnp.asarray(constant) + jnp.asarray(wave) * jnp.cos(3.0 * u), 2, 6, 3, **kinds)
    found = spectrum_at_rest(problem)
    x, p = np.zeros(found.modes.shape[1]), np.ones(1)
    dense = dense_rates(problem, x, p)
    assert found.converged
    inside = np.abs(dense - found.disc.centre) <= found.disc.radius * (1.0 + 1e-9)
    assert np.count_nonzero(inside) >= len(found.rates)
    order = np.lexsort((-dense.imag, -np.round(dense.real, 7)))
    np.testing.assert_allclose(found.rates, dense[order][: len(found.rates)], rtol=1e-7, atol=1e-7)
    assert found.n_unstable == np.count_nonzero(dense.real > 0.0)


def test_infinite_eigenvalues_are_gone_after_two_applications():
    """S^2 has no nilpotent part left: S^3 has the same rank, which is the number of finite eigenvalues."""
    problem = linear(lambda u: jnp.zeros((1, 1)), 1, elements=2, degree=2, algebraic=("a",), scalars=("m",))
    x, p = np.zeros(2 * 3 + 2 * 2 * 2 + 2 * 2 + 1), np.ones(1)
    rate = Rate.of_growth(problem.stored(x, p), 10.0)
    factors = problem.linearise(x, p, rate)[1]
    mass = problem.actions(x, p).mass
    s = np.stack([factors.solve(mass(column)) for column in np.eye(len(x))], axis=1)
    ranks = [np.linalg.matrix_rank(np.linalg.matrix_power(s, k), tol=1e-9) for k in (1, 2, 3)]
    assert ranks[0] > ranks[1] == ranks[2] == len(dense_rates(problem, x, p))


def test_a_neighbour_tells_where_to_look():
    problem = chafee_infante()
    x = at_rest(problem)
    first = solve_spectrum(problem, x, np.array([10.0]))
    p = np.array([10.5])
    rest = problem.linearise(x, p, REST)[1]
    second = solve_spectrum(problem, x, p, near=first, rest=rest)
    assert second.converged
    assert second.n_unstable == 3
    assert second.factorisations == 1
    assert second.applications < first.applications
    again = solve_spectrum(problem, x, p, near=first, rest=rest)
    np.testing.assert_array_equal(again.rates, second.rates)


def test_neutral_rates_get_their_names():
    """y_t = y'' with no flux keeps its integral; y_t = y'' + 4 pi^2 y on periodic ends is a rotation's family."""
    from shapespace.study.verification.classic import SecondOrder

    system = SecondOrder(lambda x, y, p: p[0] * (y - y), parameters=("unused",), neumann=(True, True))
    problem = CollocationProblem(system, uniform_mesh(20), 4, 1e-8)
    x, p = at_rest(problem), np.array([1.0])
    one = start_from(problem, lambda u: np.stack([0 * u + 1, 0 * u], 1), lambda u: np.stack([0 * u, 0 * u], 1))
    amount = problem.weights(x) * one
    known = solve_spectrum(problem, x, p, conserved={"amount": amount}, symmetries={"wrong": np.roll(one, 1)})
    assert known.neutral == {0: "amount"}
    assert known.n_unstable == 0
    np.testing.assert_allclose(known.rates, -((np.pi * np.arange(6)) ** 2), atol=1e-7)
    shifted = solve_spectrum(problem, x, p, symmetries={"raise": 3.0 * one})
    assert shifted.neutral == {0: "raise"}
    assert solve_spectrum(problem, x, p).neutral == {0: ""}


def test_too_small_a_space_is_said():
    found = spectrum_at_rest(chafee_infante(), 60.0, count=4, max_dimension=12, max_attempts=3)
    assert found.outcome is Outcome.EIGENVALUES_UNCONVERGED
    assert not found.outcome.is_success
    assert "elements" in found.outcome.advice
    assert found.n_unstable is None


@dataclass(frozen=True)
class Liar(AbstractLinearisation):
    """Factors whose determinant has the wrong sign."""

    honest: AbstractLinearisation

    @property
    def is_singular(self) -> bool:
        return self.honest.is_singular

    @property
    def sign(self) -> float:
        return -self.honest.sign

    def solve(self, residual: Array) -> Array:
        return self.honest.solve(residual)


class Contradictory(CollocationProblem):
    """At rest the determinant has the wrong sign, as if a real rate had been missed."""

    def actions(self, x: Array, p: Array) -> Actions:
        honest = super().actions(x, p)
        return honest._replace(factors=lambda s: Liar(honest.factors(s)) if s < 0.1 else honest.factors(s))


def test_a_contradiction_is_said():
    honest = chafee_infante()
    problem = Contradictory(honest.system, honest.mesh, honest.degree, 0)
    found = solve_spectrum(problem, at_rest(problem), np.array([10.0]), Spectral(max_attempts=2))
    assert found.outcome is Outcome.EIGENVALUES_UNCONVERGED
    assert found.n_unstable is None
    assert np.isclose(found.rates[0], 9.0)


def test_options_are_checked():
    with pytest.raises(ValueError, match="count"):
        Spectral(count=0)
    assert replace(Spectral(), count=3).count == 3
