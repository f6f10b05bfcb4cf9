"""The leading growth rates of a stationary state, and how many of them grow.

All eigenvalues in a disc around a shift to their right are found (numerics/spectrum.py). The disc must hold the rectangle
from the last rate wanted (or from zero) to the shift, as high as the shift on both sides of the real axis, and the shift
must stay well above what was found: `Spectrum.disc` says what is certain. Independently, the sign of det(J + s B) changes at
each real rate of odd multiplicity, so that two signs must agree with the number of real rates found between them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array, Flags
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractLinearisation, AbstractSmoothProblem
from shapespace.numerics.spectrum import CONVERGED, SETTLED, ComplexArray, Krylov, Pencil, Ritz

ALIGNED = 1e-3
"""A mode counts as even or odd, or as a known direction, where it is so up to this relative difference."""
VERIFIED = 1e-6
"""Largest relative defect of a returned mode."""
PROBE = 16
"""Dimension of the space that only looks for the largest rates, from far to their right."""
DIMENSION_STEP = 4
"""The space grows by this where its residuals do not tell by how much. They fall from about three steps per wanted rate on."""
FAR = 1e3
"""Where the search starts without a known shift; problems are dimensionless and of order one."""
FARTHEST = 1e9
"""Rates beyond this are not looked for."""
SPARE = 1.5
"""Of the lowest shift that will do, the one to start from at a neighbour, whose rates may be larger."""
ROUGH = 0.1
"""Ritz values with an estimated relative residual below this tell the scale of the rates."""


@dataclass(frozen=True)
class Spectral:
    """Options. count: leading rates wanted. accuracy: of the modes; state_error: of the state, where it is known to be larger.

    Rates that these, both relative, may shift to zero are neutral.
    """

    count: int = 6
    accuracy: float = 1e-9
    state_error: float = 0.0
    max_dimension: int = 120
    max_attempts: int = 6

    def __post_init__(self) -> None:
        if not 1 <= self.count <= self.max_dimension // 3:
            raise ValueError(
                f"count must lie in 1..{self.max_dimension // 3}, a third of max_dimension; got {self.count}."
            )


class Disc(NamedTuple):
    """All eigenvalues within `radius` of the real `centre` were found."""

    centre: float
    radius: float


@dataclass(frozen=True)
class Spectrum:
    """Leading growth rates, largest real part first, pairs together with the positive imaginary part first.

    rates (m,), modes (m, n) of unit size in the problem's weights; errors (m,): estimated errors of the rates, from the
    defects of their modes, the accuracy of the state and the rates' condition. parities: 'symmetric', 'antisymmetric' or
    None. neutral: index -> name ('' where none is known) of rates that vanish within their errors. n_unstable: rates that
    grow, neutral ones not counted, also those beyond the leading ones; None unless the outcome is CONVERGED. next_shift:
    to start from at a neighbouring state. applications: of S; factorisations: of J + s B.
    """

    outcome: Outcome
    rates: ComplexArray
    modes: ComplexArray
    errors: Array
    parities: tuple[str | None, ...]
    neutral: Mapping[int, str]
    n_unstable: int | None
    disc: Disc
    next_shift: float
    applications: int
    factorisations: int

    @property
    def converged(self) -> bool:
        """True where the rates are what was asked for."""
        return self.outcome is Outcome.CONVERGED


class _Pairs(NamedTuple):
    """What one disc holds: all rates in it and their errors (j,); of the leading ones their places, modes and defects."""

    disc: Disc
    rates: ComplexArray
    errors: Array
    leading: list[int]
    modes: ComplexArray
    defects: Array

    @property
    def neutral(self) -> Flags:
        """Rates that vanish within their errors."""
        return np.abs(self.rates) <= self.errors


def solve_spectrum(
    problem: AbstractSmoothProblem,
    x: Array,
    p: Array,
    options: Spectral = Spectral(),
    *,
    near: Spectrum | None = None,
    rest: AbstractLinearisation | None = None,
    symmetries: Mapping[str, Array] | None = None,
    conserved: Mapping[str, Array] | None = None,
) -> Spectrum:
    """The leading rates s of (J + s B) dx = 0 at a state x with dq/dt = 0.

    near: the spectrum of a neighbouring state, which tells where to look; without it a probe from far to the right finds
    the scale of the rates. rest: factors of J at x, where they are known. symmetries: directions (n,) by name along which
    states stay solutions; conserved: gradients (n,) by name of quantities that no motion changes. They only name neutral
    rates: all are found without them.
    """
    search = _Search(problem, x, p, options, rest)
    shift = near.next_shift if near is not None and near.converged else search.first_shift()
    last = None
    for attempt in range(options.max_attempts):
        if np.isinf(shift):
            return search.spectrum(Outcome.NO_RATES, None, {}, None)
        pairs, shift = search.pairs_from(shift, attempt)
        if pairs is None:
            continue
        last = pairs
        if pairs.defects.max(initial=0.0) <= VERIFIED and search.agrees(pairs):
            names = _names(pairs, search.weights, symmetries or {}, conserved or {})
            growing = (pairs.rates.real > 0.0) & ~pairs.neutral
            return search.spectrum(Outcome.CONVERGED, pairs, names, int(np.count_nonzero(growing)))
        shift = 2.0 * pairs.disc.centre
    return search.spectrum(Outcome.EIGENVALUES_UNCONVERGED, last, {}, None)


@dataclass
class _Search:
    """One spectrum's work: what was factorised where, and the signs of the determinant met there."""

    problem: AbstractSmoothProblem
    x: Array
    p: Array
    options: Spectral
    rest: AbstractLinearisation | None

    def __post_init__(self) -> None:
        self.applications = 0
        self.factorisations = 0
        self.actions = self.problem.actions(self.x, self.p)
        self.weights = self.problem.weights(self.x)
        self.signs: dict[float, float] = {}

    def pencil(self, shift: float) -> Pencil:
        """Factorised at a shift, and its sign noted; a shift that meets a rate gives way to the right."""
        for _ in range(self.options.max_attempts):
            pencil = Pencil(self.actions, shift, self.weights)
            self.factorisations += 1
            if not pencil.linearisation.is_singular:
                break
            shift = 1.1 * shift
        self.signs[pencil.shift] = pencil.linearisation.sign
        return pencil

    def first_shift(self) -> float:
        """To the right of the largest rates, found from so far to their right that they stand out.

        Infinite where no rate is finite: a flat disc's deflections dissipate nothing to first order.
        """
        far = FAR
        while True:
            krylov = Krylov(self.pencil(far), PROBE, seed=0)
            if _is_rateless(krylov):
                return np.inf
            krylov.extend(PROBE)
            self.applications += krylov.applications
            shift = _shift_by(krylov.ritz())
            if shift < 0.5 * far or far >= FARTHEST:
                return shift
            far *= 10.0

    def pairs_from(self, shift: float, attempt: int) -> tuple[_Pairs | None, float]:
        """Verified pairs if the disc around this shift could be made large enough, and the shift to try otherwise.

        Infinite where no rate is finite.
        """
        count, most = self.options.count, self.options.max_dimension
        krylov = Krylov(self.pencil(shift), most, attempt)
        if _is_rateless(krylov):
            return None, np.inf
        shift, dimension = krylov.pencil.shift, 4 * count
        while True:
            krylov.extend(dimension)
            ritz = krylov.ritz()
            settled = ritz.settled
            inside, residuals = ritz.rates[:settled], ritz.residuals[:settled]
            radius = np.inf if krylov.is_invariant else float(abs(shift - inside[-1])) if len(inside) else 0.0
            leading, disc = _leading(inside, count), Disc(shift, radius)
            worst = max(residuals[leading].max(initial=0.0), residuals[inside.real > 0.0].max(initial=0.0))
            is_enough = worst <= CONVERGED and _is_covered(inside[leading], disc, count)
            if is_enough or krylov.is_invariant or krylov.dimension == most:
                break
            dimension += _steps_left(worst, dimension - 3 * count)
        self.applications += krylov.applications
        if not is_enough:
            new = _shift_by(ritz)
            return None, new if abs(new / shift - 1.0) > 0.2 else 0.5 * shift
        lowest = _lowest_shift(inside[leading])
        if shift < lowest and np.isfinite(radius):
            return None, 1.2 * lowest
        return self._verified(krylov, ritz, leading, disc), shift

    def _verified(self, krylov: Krylov, ritz: Ritz, leading: list[int], disc: Disc) -> _Pairs:
        """Each leading pair after one inverse iteration, with the defect it had before; a second one where that is large."""
        pencil, settled = krylov.pencil, ritz.settled
        rates = ritz.rates[:settled]
        modes = krylov.modes(ritz.coefficients[:, leading])
        defects = np.zeros(len(leading))
        for i, rate in enumerate(rates[leading]):
            if rate.imag < 0.0:
                modes[i], defects[i] = modes[i - 1].conjugate(), defects[i - 1]
                continue
            for _ in range(2):
                defect = pencil.defect(complex(rate), modes[i])
                self.applications += 1 + int(rate.imag != 0.0)
                defects[i] = pencil.size(defect) / pencil.size(modes[i])
                modes[i] -= defect
                if defects[i] <= self.options.accuracy:
                    break
            squares = modes[i].real ** 2 + modes[i].imag ** 2
            largest = modes[i][squares.argmax()]
            # Of unit size, its largest entry positive.
            modes[i] *= largest.conjugate() / abs(largest) / np.sqrt(self.weights @ squares)
        accuracy = np.maximum(ritz.residuals[:settled], max(self.options.accuracy, self.options.state_error))
        accuracy[leading] = np.maximum(accuracy[leading], defects)
        errors = np.abs(pencil.shift - rates) * krylov.conditions(ritz)[:settled] * accuracy
        return _Pairs(disc, rates, errors, leading, modes, defects)

    def agrees(self, pairs: _Pairs) -> bool:
        """Between any two shifts the determinant changes sign as often as real rates were found there."""
        real = pairs.rates[pairs.rates.imag == 0.0].real
        # One sign from above the rates that may be zero and below those that grow; from zero where none may.
        vanishing = float(pairs.errors[pairs.neutral].max(initial=0.0))
        growing = float(real[real > vanishing].min(initial=1e-2 * pairs.disc.centre))
        if self.rest is not None and vanishing == 0.0:
            self.signs[0.0] = self.rest.sign
        else:
            self.pencil(np.sqrt(vanishing * growing))
        shifts = sorted(self.signs)
        return all(
            self.signs[a] * self.signs[b] == (-1.0) ** np.count_nonzero((real > a) & (real < b))
            for a, b in pairwise(shifts)
        )

    def spectrum(
        self, outcome: Outcome, pairs: _Pairs | None, names: Mapping[int, str], unstable: int | None
    ) -> Spectrum:
        """The record of this search."""
        if pairs is None:
            none = np.zeros(0)
            modes = np.zeros((0, len(self.x)), np.complex128)
            pairs = _Pairs(Disc(0.0, 0.0), none.astype(np.complex128), none, [], modes, none)
        rates = pairs.rates[pairs.leading]
        return Spectrum(
            outcome=outcome,
            rates=rates,
            modes=pairs.modes,
            errors=pairs.errors[pairs.leading],
            parities=_parities(self.problem, self.x, self.weights, rates, pairs.modes),
            neutral=names,
            n_unstable=unstable,
            disc=pairs.disc,
            next_shift=SPARE * _lowest_shift(rates),
            applications=self.applications,
            factorisations=self.factorisations,
        )


def _steps_left(residual: float, steps: int) -> int:
    """After how many steps a residual, which has fallen from one in so many, is expected to be that of a converged pair."""
    if residual <= CONVERGED:
        return DIMENSION_STEP
    share = np.log(residual / CONVERGED) / -np.log(min(residual, SETTLED))
    return int(np.clip(np.ceil(share * steps), 1, 2 * DIMENSION_STEP))


def _is_rateless(krylov: Krylov) -> bool:
    """Whether a space is empty before anything was applied to its start: no finite rates are there."""
    return krylov.is_invariant and krylov.dimension == 0


def _leading(rates: ComplexArray, count: int) -> list[int]:
    """Indices of the `count` rates of largest real part, one more where that parted a pair."""
    order = np.lexsort((-rates.imag, np.abs(rates.imag), -rates.real))
    parts_a_pair = len(order) > count and rates[order[count - 1]].imag > 0.0
    found: list[int] = order[: count + int(parts_a_pair)].tolist()
    return found


def _is_covered(leading: ComplexArray, disc: Disc, count: int) -> bool:
    """Whether the disc holds all rates with real parts from the last one's (or zero) to the shift, as high as the shift."""
    if np.isinf(disc.radius):
        return True
    if len(leading) < count:
        return False
    return bool(disc.radius >= np.hypot(disc.centre - min(leading.real.min(), 0.0), disc.centre))


def _lowest_shift(leading: ComplexArray) -> float:
    """Twice as far right as the largest rate, twice as high as any pair, and not tiny against rates that decay."""
    right, height = leading.real.max(initial=0.0), np.abs(leading.imag).max(initial=0.0)
    return float(max(2.0 * right, 2.0 * height, 0.1 * np.abs(leading).max(initial=0.0), 1.0))


def _shift_by(ritz: Ritz) -> float:
    """A shift by the first of the rates, known roughly; round-off leaves others beyond all that are looked for."""
    is_rough = (ritz.residuals < ROUGH) & (np.abs(ritz.rates) <= FARTHEST)
    rough = ritz.rates[is_rough] if is_rough.any() else ritz.rates
    first = rough[_leading(rough, 3)]
    return max(1.2 * _lowest_shift(first), 0.5 * float(np.abs(first).max(initial=0.0)))


def _parities(
    problem: AbstractSmoothProblem, x: Array, weights: Array, rates: ComplexArray, modes: ComplexArray
) -> tuple[str | None, ...]:
    """How the modes of a symmetric state behave under the symmetry."""
    image = problem.reflected(x)
    if image is None or weights @ (image - x) ** 2 > ALIGNED**2 * (weights @ x**2):
        return (None,) * len(modes)

    def parity(mode: ComplexArray) -> str | None:
        one = mode.real if weights @ mode.real**2 >= weights @ mode.imag**2 else mode.imag
        other = problem.reflected(np.ascontiguousarray(one), increment=True)
        assert other is not None
        for name, sign in (("symmetric", 1.0), ("antisymmetric", -1.0)):
            if weights @ (other - sign * one) ** 2 <= ALIGNED**2 * (weights @ one**2):
                return name
        return None

    found: list[str | None] = []
    for rate, mode in zip(rates, modes, strict=True):
        # The second mode of a pair is the conjugate of the first.
        found.append(found[-1] if rate.imag < 0.0 else parity(mode))
    return tuple(found)


def _names(
    pairs: _Pairs, weights: Array, symmetries: Mapping[str, Array], conserved: Mapping[str, Array]
) -> dict[int, str]:
    """Names of the neutral rates among the leading ones.

    A symmetry's direction lies in the space of neutral modes. A conserved quantity changes along neutral modes alone: a
    motion e^(st) dx that changes it is none.
    """
    modes, neutral = pairs.modes, pairs.neutral[pairs.leading]
    names = {int(i): "" for i in np.flatnonzero(neutral)}
    root = np.sqrt(weights)
    for name, direction in symmetries.items():
        free = [i for i, known in names.items() if not known]
        columns, target = (root * modes[free].real).T, root * direction
        parts, *_ = np.linalg.lstsq(columns, target)
        if np.linalg.norm(columns @ parts - target) <= ALIGNED * np.linalg.norm(target):
            names[free[int(np.argmax(np.abs(parts)))]] = name
    for name, gradient in conserved.items():
        free = [i for i, known in names.items() if not known]
        changes = np.abs(modes @ gradient)
        if free and ALIGNED * changes[free].max() > changes[~neutral].max(initial=0.0):
            names[free[int(np.argmax(changes[free]))]] = name
    return names
