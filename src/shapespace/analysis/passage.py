"""What lies between two neighbouring points of a branch: any place, the start again, where something changes, Hopf points."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from shapespace.analysis.bifurcation import SAFETY
from shapespace.analysis.branch import Point, hermite, metric, orthogonal_plane
from shapespace.analysis.stability import Spectrum
from shapespace.base.arrays import Array
from shapespace.base.problem import REST, AbstractContinuableProblem, AbstractSmoothProblem
from shapespace.numerics.newton import Newton, solve_root

PLACE = Newton(tolerance=1e-10)
BISECTIONS = 16
"""Halvings of the way between two points."""
HOPF_STEPS = 12
BESIDE = 1e-2
"""A branch that passes its start no farther off than this, relative to the step, passes through it,"""
SAME = 1e-4
"""or than this in the metric, as states carried to another discretisation are no more exact."""
AT_END = 1e-6
"""Shares of a step by which a place beyond an end of it is the end."""
ALONG = 0.9
"""Least cosine between the tangents there: a branch may cross its start another way."""
MIRRORED = 1e-6
"""A state this near to its mirror image, in the norm of the problem, is symmetric."""
ON_AXIS = 1e-9
"""A pair's real part below this, relative to its frequency, is zero: as exact as spectra are."""

SpectrumOf = Callable[[Point], Spectrum]


def point_between(before: Point, after: Point, share: float) -> Point | None:
    """The point of the branch at this share of the arclength, on the discretisation of the end; None where Newton fails.

    Its tangent is that of the cubic through both ends.
    """
    problem, start = after.problem, before.on(after.problem)
    length = after.arclength - start.arclength
    cubic = hermite(start.joined, start.tangent, after.joined, after.tangent, length)
    guess, along = (np.asarray(polyval(share * length, part)) for part in (cubic, polyder(cubic)))
    weights = metric(problem, guess)
    tangent = along / np.sqrt(weights @ along**2)
    plane = orthogonal_plane(after, weights * tangent, guess)
    root = solve_root(plane, guess, after.p, REST, PLACE)
    if not root.outcome.is_success:
        return None
    x, p = plane.split(root.x, after.p)
    return Point(problem, x, p, after.index, tangent, start.arclength + share * length, step=after.step)


def find_zero(at: Callable[[float], float], bracket: float) -> float | None:
    """A zero between 0 and 1 by the Illinois method, to a bracket of this length; None where it is not found."""
    low, high = (0.0, at(0.0)), (1.0, at(1.0))
    scale = max(abs(low[1]), abs(high[1]))
    if not (low[1] * high[1] <= 0.0 and scale > 0.0):
        return None
    for _ in range(60):
        share = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
        value = at(share)
        if np.isnan(value):
            return None
        low, high = (high if value * high[1] < 0.0 else (low[0], 0.5 * low[1])), (share, value)
        if abs(high[0] - low[0]) <= bracket or abs(value) <= 1e-12 * scale:
            return share
    return None


def first_change(before: Point, after: Point, holds: Callable[[Point], bool]) -> tuple[Point, Point]:
    """Two close points between which something starts to hold that holds at the end and not at the start."""
    low, high = before, after
    a, b = 0.0, 1.0
    for _ in range(BISECTIONS):
        place = point_between(before, after, 0.5 * (a + b))
        if place is None:
            break
        if holds(place):
            high, b = place, 0.5 * (a + b)
        else:
            low, a = place, 0.5 * (a + b)
    return low, high


def passed_start(start: Point, before: Point, after: Point) -> float | None:
    """The arclength at which a branch passes its start again, in the same direction, between two later neighbours, if so."""
    last, weights = before.on(after.problem), metric(after.problem, after.joined)
    chord = after.joined - last.joined
    size = float(weights @ chord**2)
    # Mostly the parameter alone tells that the start is elsewhere.
    if last.arclength == start.arclength or weights[-1] * (start.parameter - last.parameter) ** 2 > 2.0 * size:
        return None
    first, length = start.on(after.problem), after.arclength - last.arclength
    share = float(weights @ (chord * (first.joined - last.joined))) / size
    if not -AT_END <= share <= 1.0 + AT_END:
        return None
    # By the cubic, as a start where branches meet is no place to solve for.
    cubic = hermite(last.joined, last.tangent, after.joined, after.tangent, length)
    place, along = (np.asarray(polyval(share * length, part)) for part in (cubic, polyder(cubic)))
    along = along / np.sqrt(weights @ along**2)
    gap = first.joined - place
    ahead = float(weights @ (gap * along))
    miss, cosine = np.sqrt(weights @ (gap - ahead * along) ** 2), weights @ (along * first.tangent)
    if miss > max(BESIDE * np.sqrt(size), SAME) or cosine < ALONG * np.sqrt(weights @ first.tangent**2):
        return None
    return float(last.arclength + share * length + ahead)


def is_symmetric(problem: AbstractContinuableProblem, x: Array) -> bool | None:
    """Whether a state is its own mirror image; None where states have none."""
    image = problem.reflected(x) if isinstance(problem, AbstractSmoothProblem) else None
    return None if image is None else problem.norm(image - x, x) < MIRRORED


def meets_mirror_image(point: Point) -> bool:
    """Whether a branch that goes through this point is, beyond it, the mirror image of itself before it."""
    problem, x = point.problem, point.x
    if not isinstance(problem, AbstractSmoothProblem) or not is_symmetric(problem, x):
        return False
    image, weights = problem.reflected(point.tangent[:-1], increment=True), metric(problem, point.joined)
    if image is None:
        return False
    along = point.tangent
    overlap = weights @ (along * np.append(image, along[-1]))
    return bool(overlap < -ALONG * (weights @ along**2))


@dataclass(frozen=True)
class Hopf:
    """A point where a pair of rates crosses the imaginary axis. frequency: of the pair, > 0."""

    point: Point
    spectrum: Spectrum
    frequency: float
    parameter_error: float


def growing_pairs(spectrum: Spectrum) -> int:
    """How many of the leading pairs of complex rates grow."""
    return int(np.count_nonzero((spectrum.rates.imag > 0.0) & (spectrum.rates.real > 0.0)))


def locate_hopf(before: Point, after: Point, spectra: tuple[Spectrum, Spectrum], of: SpectrumOf) -> Hopf | None:
    """Where a pair crosses the axis between two points with different numbers of growing pairs; None where it is not found.

    By regula falsi on the real part of the pair next to the axis, halving where that moves one end only.
    """
    a, b = 0.0, 1.0
    fa, fb = (_nearest_axis(spectrum).real for spectrum in spectra)
    count = growing_pairs(spectra[0])
    share, found, kept = 0.5, None, 0
    for _ in range(HOPF_STEPS):
        if fa * fb < 0.0 and abs(kept) < 2:
            share = float(np.clip((a * fb - b * fa) / (fb - fa), a + 0.05 * (b - a), b - 0.05 * (b - a)))
        else:
            share, kept = 0.5 * (a + b), 0
        point = point_between(before, after, share)
        spectrum = None if point is None else of(point)
        if point is None or spectrum is None or not spectrum.converged:
            return None
        pair = _nearest_axis(spectrum)
        if pair.imag == 0.0:
            return None
        found = (point, spectrum, pair)
        if abs(pair.real) <= ON_AXIS * abs(pair.imag):
            break
        if growing_pairs(spectrum) == count:
            a, fa, kept = share, pair.real, min(kept, 0) - 1
        else:
            b, fb, kept = share, pair.real, max(kept, 0) + 1
    if found is None or abs(found[2].real) > 1e-5 * abs(found[2].imag):
        return None
    point, spectrum, pair = found
    slope = (fb - fa) / (b - a) / max(abs(after.parameter - before.parameter), 1e-300)
    return Hopf(point, spectrum, float(pair.imag), _error(point, pair, slope, of))


def _nearest_axis(spectrum: Spectrum) -> complex:
    """Of the pairs the one closest to the imaginary axis; zero where there is none."""
    pairs = spectrum.rates[spectrum.rates.imag > 0.0]
    return complex(pairs[np.argmin(np.abs(pairs.real))]) if len(pairs) else 0.0j


def _error(point: Point, pair: complex, slope: float, of: SpectrumOf) -> float:
    """How far the parameter is off where the pair's real part is, here or on a mesh twice as fine."""
    assert isinstance(point.problem, AbstractSmoothProblem)
    finer, left = point.problem.refined(), abs(pair.real)
    if finer is not None:
        x = point.problem.carried(point.x, finer)
        root = solve_root(finer, x, point.p, REST, PLACE)
        spectrum = of(replace(point, problem=finer, x=root.x))
        if not (root.outcome.is_success and spectrum.converged):
            return float("nan")
        left += SAFETY * abs(_nearest_axis(spectrum).real - pair.real)
    return float(left / abs(slope)) if slope else float("nan")
