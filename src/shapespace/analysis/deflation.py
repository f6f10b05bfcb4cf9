"""Other solutions beside known ones: Newton's method on F with the known ones deflated, modulo the problem's symmetry.

The roots of M(x) F(x; p) are those of F but the known ones x_i, where Newton's iteration is driven away (Farrell, Birkisson
and Funke, SIAM J. Sci. Comput. 37 (2015) A2026):

    M(x) = prod_i (1/d_i(x)^power + shift),   d_i(x)^2 = sum_j w_j (x_j - x_ij)^2

with the problem's weights w, so that nothing depends on the mesh. Mirror images of known solutions are deflated with them; a
continuous symmetry must be fixed by the problem itself, by a phase condition. As F (grad ln M)^T has rank one, every solve
with the deflated Jacobian is one with the plain one (Sherman and Morrison).

What is found depends on the starts, so that every one tried is part of the result. A symmetric start leads to symmetric states
only; states perturbed by their leading modes lead elsewhere. Deflated continuation needs nothing more: what known solutions
become at other parameters are starts of a search there.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shapespace.analysis.stability import Spectrum
from shapespace.analysis.stationary import Stationary, solve_stationary
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import (
    REST,
    AbstractContinuableProblem,
    AbstractLinearisation,
    AbstractProblem,
    AbstractSmoothProblem,
    Rate,
)
from shapespace.numerics.newton import Newton, solve_root

SEARCH_NEWTON = Newton(tolerance=1e-6, max_iterations=60, min_damping=1e-3)
"""Patience of a deflated search; what it finds is converged by `solve_stationary`."""
NEAR = 0.1
"""Solutions that are farther apart than this, in the problem's weights, differ; of nearer ones Newton's method decides."""
AMPLITUDES = (0.1, 0.3, 1.0)
"""Perturbations of a known solution, in the problem's weights."""
LEADING = 4
"""Modes that perturb a known solution."""
SYMMETRIC = 1e-3
"""A state that is no farther than this from its mirror image is its own."""
SAME = 1e-5
"""Solutions on one discretisation that are no farther apart than this are the same."""


@dataclass(frozen=True)
class Deflation:
    """Options. power: of the distance from a known solution; shift: of M far from all of them."""

    power: float = 2.0
    shift: float = 1.0

    def __post_init__(self) -> None:
        if not (self.power >= 1.0 and self.shift > 0.0):
            raise ValueError(f"power must be >= 1 and shift > 0; got {self.power} and {self.shift}.")


class Pole(NamedTuple):
    """A deflated state (n,) with the weights (n,) that measure distances from it."""

    x: Array
    weights: Array


@dataclass(frozen=True)
class DeflatedProblem(AbstractProblem):
    """M(x) F(x; p) = 0 on the discretisation of `problem`."""

    problem: AbstractSmoothProblem
    poles: tuple[Pole, ...]
    options: Deflation = Deflation()

    @classmethod
    def of(
        cls, problem: AbstractSmoothProblem, known: Iterable[Stationary], options: Deflation = Deflation()
    ) -> "DeflatedProblem":
        """Without known solutions and their mirror images."""
        states = [image for one in known for image in images(one, problem)]
        return cls(problem, tuple(Pole(x, problem.weights(x)) for x in states), options)

    def factor(self, x: Array) -> tuple[float, Array]:
        """M, and the gradient of ln M (n,); not finite at a known solution."""
        logarithm, gradient, (power, shift) = 0.0, np.zeros_like(x), (self.options.power, self.options.shift)
        for pole in self.poles:
            way = pole.weights * (x - pole.x)
            squared = float(way @ (x - pole.x))
            if squared == 0.0:
                return np.inf, np.full_like(x, np.nan)
            logarithm += np.log(squared ** (-0.5 * power) + shift)
            gradient -= power / (squared * (1.0 + shift * squared ** (0.5 * power))) * way
        return float(np.exp(logarithm)), gradient

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        return self.factor(x)[0] * self.problem.residual(x, p, rate)

    def linearise(self, x: Array, p: Array, rate: Rate) -> tuple[Array, AbstractLinearisation]:
        residual, plain = self.problem.linearise(x, p, rate)
        factor, gradient = self.factor(x)
        if plain.is_singular or not np.isfinite(factor):
            return factor * residual, plain
        return factor * residual, _Deflated(plain, factor, gradient, plain.solve(residual))

    def stored(self, x: Array, p: Array) -> Array:
        return self.problem.stored(x, p)

    def norm(self, dx: Array, x: Array) -> float:
        return self.problem.norm(dx, x)

    def stored_norm(self, dq: Array, q: Array) -> float:
        return self.problem.stored_norm(dq, q)


class _Deflated(AbstractLinearisation):
    """M (J + F grad(ln M)^T), factorised by the factors of J."""

    def __init__(self, plain: AbstractLinearisation, factor: float, gradient: Array, step: Array) -> None:
        self._plain, self._factor, self._gradient, self._step = plain, factor, gradient, step
        self._pivot = 1.0 + float(gradient @ step)

    @property
    def is_singular(self) -> bool:
        return not abs(self._pivot) > 0.0

    @property
    def sign(self) -> float:
        return self._plain.sign * float(np.sign(self._pivot))

    def solve(self, residual: Array) -> Array:
        plain = self._plain.solve(residual) / self._factor
        return plain - self._step * (float(self._gradient @ plain) / self._pivot)


def images(one: Stationary, problem: AbstractSmoothProblem) -> list[Array]:
    """A solution on a discretisation of its problem, and its mirror image where that is another state."""
    assert isinstance(one.problem, AbstractSmoothProblem)
    mirrored = one.problem.reflected(one.x)
    is_mirrored = mirrored is not None and distance(one.problem, one.x, mirrored) > SYMMETRIC
    states = [one.x, mirrored] if mirrored is not None and is_mirrored else [one.x]
    return [one.problem.carried(x, problem) for x in states]


def distance(problem: AbstractContinuableProblem, x: Array, other: Array) -> float:
    """Of two states on one discretisation, in the problem's weights."""
    return float(np.sqrt(problem.weights(x) @ (other - x) ** 2))


def is_same(one: Stationary, other: Stationary, newton: Newton = Newton()) -> bool:
    """Whether two solutions at equal parameters are one and the same, or mirror images of each other.

    Where they are near, the other one, or its image, is solved for again on the discretisation of the first.
    """
    problem = one.problem
    assert isinstance(problem, AbstractSmoothProblem)
    for image in images(other, problem):
        if distance(problem, one.x, image) > NEAR:
            continue
        root = solve_root(problem, image, one.p, REST, newton)
        if root.outcome is Outcome.CONVERGED and distance(problem, one.x, root.x) <= SAME:
            return True
    return False


@dataclass(frozen=True)
class Guess:
    """Where a search may start: a state (n,) on a discretisation of the problem, and how it was made, in words."""

    name: str
    problem: AbstractSmoothProblem
    x: Array


@dataclass(frozen=True)
class Trial:
    """A search from one guess. found: CONVERGED for a new solution, REPEATED for a known one, else why Newton's method
    gave up. number: of the solution it came to, counted from zero.
    """

    name: str
    found: Stationary
    number: int | None = None

    @property
    def is_new(self) -> bool:
        """Whether a solution was found that had not been known."""
        return self.found.outcome is Outcome.CONVERGED


def solve_deflated(
    guess: Guess,
    p: Array,
    known: Sequence[Stationary],
    options: Deflation = Deflation(),
    search: Newton = SEARCH_NEWTON,
    newton: Newton = Newton(),
) -> Trial:
    """Search from a guess for a solution at parameters p that is none of the known ones, nor a mirror image of one.

    It is found on the guess's discretisation and then converged without deflation, on one that suits it. From a guess that
    is a known solution nothing leads away.
    """
    problem, x = guess.problem, guess.x
    for number, one in enumerate(known):
        if min(distance(problem, x, image) for image in images(one, problem)) <= SAME:
            return Trial(guess.name, replace(one, outcome=Outcome.REPEATED, iterations=0), number)
    deflated = DeflatedProblem.of(problem, known, options)
    root = solve_root(deflated, x, p, REST, search)
    if root.outcome is not Outcome.CONVERGED:
        residual = float(np.abs(problem.residual(root.x, p, REST)).max())
        found = Stationary(problem, root.x, p, root.outcome, root.correction, residual, root.iterations, False)
        return Trial(guess.name, found)
    found = solve_stationary(problem, root.x, p, newton)
    found = replace(found, iterations=found.iterations + root.iterations)
    if found.outcome is not Outcome.CONVERGED:
        return Trial(guess.name, found)
    for number, one in enumerate(known):
        if is_same(found, one, newton):
            return Trial(guess.name, replace(found, outcome=Outcome.REPEATED), number)
    return Trial(guess.name, found, len(known))


def search(
    guesses: Iterable[Guess],
    p: Array,
    further: Callable[[Trial], Iterable[Guess]],
    done: Sequence[Trial] = (),
    options: Deflation = Deflation(),
    newton: Newton = Newton(),
) -> Iterator[Trial]:
    """All solutions at parameters p that can be reached from the guesses, trial by trial; it ends when no guess is left.

    Each guess is tried until it leads to nothing new. further: guesses that follow from a new solution, tried after those
    that are waiting. done: the first trials of an earlier search with the same guesses, which are not made again.
    """
    known: list[Stationary] = []
    earlier, waiting = iter(done), deque(guesses)
    while waiting:
        guess = waiting[0]
        trial = next(earlier, None)
        if trial is None:
            trial = solve_deflated(guess, p, known, options, newton=newton)
            yield trial
        if trial.is_new:
            known.append(trial.found)
            waiting.extend(further(trial))
        else:
            waiting.popleft()


def perturbed(one: Stationary, spectrum: Spectrum, name: str, amplitudes: Sequence[float] = AMPLITUDES) -> list[Guess]:
    """A solution moved along its leading modes; of a mode that breaks the symmetry one side, as the other is its mirror image."""
    assert isinstance(one.problem, AbstractSmoothProblem)
    modes = list(zip(spectrum.modes.real, spectrum.parities, spectrum.rates.imag, strict=True))[:LEADING]
    return [
        Guess(f"{name} {sign * amplitude:+g} mode {number}", one.problem, one.x + sign * amplitude * mode)
        for amplitude in amplitudes
        for number, (mode, parity, frequency) in enumerate(modes, start=1)
        if frequency >= 0.0
        for sign in ((1.0,) if parity == "antisymmetric" else (1.0, -1.0))
    ]
