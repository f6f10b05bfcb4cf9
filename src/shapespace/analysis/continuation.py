"""Pseudo-arclength continuation of F(x; p) = 0 at rest in one parameter, with controlled steps and exact stops."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from shapespace.analysis.beside import beside_branch_point
from shapespace.analysis.branch import (
    Direction,
    Point,
    direction_at,
    hermite,
    metric,
    orthogonal_plane,
    real_roots,
    test_on,
)
from shapespace.analysis.extended import AbstractMeasure, ExtendedProblem, Given, Parameter
from shapespace.analysis.stationary import STEP_NEWTON
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractContinuableProblem
from shapespace.numerics.newton import Newton, solve_root

MEMORY = 4
"""Points that decide how a branch goes on: the last, and an earlier one at a distance fit for extrapolation."""
MAX_GROWTH = 3.0
"""Largest ratio of successive steps."""
AT_VALUE = 1e-9
"""A measure within this of a value, relative to it (or one), is there."""
WORST_MISS = 20.0
"""How many times the wanted error of prediction a corrector may move a point: farther away may lie another branch."""


@dataclass(frozen=True)
class Arclength:
    """Options of steps along a branch, in its mesh-independent `metric`.

    first, smallest, largest: step lengths. prediction: wanted distance of the corrector, in the problem's norm. turn: largest
    angle between tangents of neighbours [rad]. crossing: largest step through a branch point, which tells a crossing of
    branches from two that pass each other at a distance not much smaller. parameter_scale: change of the parameter that
    counts as one; 0 stands for max(|parameter|, 1).
    """

    first: float = 0.01
    smallest: float = 1e-7
    largest: float = 0.2
    prediction: float = 3e-3
    turn: float = 0.4
    crossing: float = 2e-3
    parameter_scale: float = 0.0
    max_points: int = 1000

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest <= self.first <= self.largest:
            raise ValueError(
                f"steps must satisfy 0 < smallest <= first <= largest; got {self.smallest}, {self.first}, {self.largest}."
            )
        if not 0.0 < self.turn < 0.5 * np.pi:
            raise ValueError(f"turn must lie in (0, pi/2); got {self.turn}.")


@dataclass(frozen=True)
class Stop:
    """A value of a measure at which a branch has an exact point with this label, and where it ends if `ends`."""

    measure: AbstractMeasure
    value: float
    label: str = "user"
    ends: bool = False


Event = Callable[[Point], Outcome | None]
"""Looks at an accepted point; an outcome ends the branch there."""


def start_point(
    problem: AbstractContinuableProblem,
    x: Array,
    p: Array,
    index: int,
    direction: float = 1.0,
    options: Arclength = Arclength(),
    tangent: Array | None = None,
) -> Point | Outcome:
    """The first point of a branch at a solution x, from which the parameter rises (direction 1) or falls (-1).

    tangent (n + 1,): where several branches meet, that of the one to follow. Without it the one of them that changes least as
    the parameter does; SINGULAR where there is none.
    """
    point = Point(problem, x, p, index, np.append(np.zeros_like(x), 1.0), step=options.first, label="start")
    weights, X = metric(problem, point.joined, options.parameter_scale), point.joined
    along = direction * point.tangent if tangent is None else tangent
    beside = beside_branch_point(problem, X, p, index, along, options.parameter_scale)
    if beside is not None:
        return replace(point, x=beside.X[:-1], tangent=beside.tangent, test=beside.test)
    # At a fold no plane of constant parameter will do, but almost any other.
    generic = np.random.default_rng(0).standard_normal(len(X))
    for guess in (point.tangent, generic) if tangent is None else (tangent,):
        plane = orthogonal_plane(point, weights * guess, X)
        found = direction_at(plane, X, p)
        if found is not None:
            unit = found.tangent / np.sqrt(weights @ found.tangent**2)
            turned = tangent is None and unit[-1] * direction < 0.0
            unit = -unit if turned else unit
            again = direction_at(orthogonal_plane(point, weights * unit, X), X, p)
            return replace(point, tangent=unit, test=float("nan") if again is None else again.test)
    if tangent is None:
        return Outcome.SINGULAR
    return replace(point, tangent=tangent / np.sqrt(weights @ tangent**2))


@dataclass
class Continuation:
    """Iterate to get the points of a branch one after another; then `outcome` says why they ended.

    past: the start, or the last MEMORY points of an earlier continuation (oldest first), to go on as if never interrupted.
    Each point is converged on its own discretisation; the next one is computed on the one that the problem asks for there.
    """

    past: Sequence[Point]
    stops: Sequence[Stop] = ()
    options: Arclength = Arclength()
    newton: Newton = STEP_NEWTON
    events: Sequence[Event] = ()
    outcome: Outcome | None = None

    def __iter__(self) -> Iterator[Point]:
        """New points, not including those of the past."""
        past = list(self.past)[-MEMORY:]
        for _ in range(self.options.max_points):
            accepted = self._advance(past)
            if accepted is None:
                self.outcome = Outcome.BRANCH_STALLED
                return
            accepted = replace(accepted, problem=accepted.problem.renewed(accepted.x, accepted.p))
            past = [*past, accepted][-MEMORY:]
            yield accepted
            self.outcome = self._ending(accepted)
            if self.outcome is not None:
                return
        self.outcome = Outcome.MAX_STEPS

    def _ending(self, point: Point) -> Outcome | None:
        """Why to end at this point, if anything says so."""
        for event in self.events:
            if (outcome := event(point)) is not None:
                return outcome
        if any(stop.ends and stop.label == point.label and _is_at(stop, point) for stop in self.stops):
            return Outcome.REACHED_STOP
        return None

    def _advance(self, past: Sequence[Point]) -> Point | None:
        """Try steps until one is accepted; None where they become too small."""
        problem = past[-1].problem.adapted(past[-1].x)
        assert isinstance(problem, AbstractContinuableProblem)
        now = past[-1].on(problem)
        now = replace(now, test=test_on(now, problem))
        trial = _Trial(past[:-1], now, self.options, self.newton)
        step = past[-1].step
        while step >= self.options.smallest:
            ahead = trial.step(step)
            if isinstance(ahead, _Crossed):
                step = ahead.before
                continue
            accepted = None if ahead is None else self._stopped(trial, ahead)
            if accepted is not None:
                return accepted
            step *= 0.5
        return None

    def _stopped(self, trial: "_Trial", end: Point) -> Point | None:
        """The end of a step, or the first stop on the way to it; None where there is one that Newton does not find."""
        crossings = [(s, stop) for stop in self.stops if (s := _crossing(stop, trial.now, end)) is not None]
        return trial.stop(end, *min(crossings, key=lambda crossing: crossing[0])) if crossings else end


class _Crossed(NamedTuple):
    """Arclength ahead to a branch point, and to a place shortly before it, from where a short step crosses it."""

    at: float
    before: float


class _Trial:
    """Steps of any length from the point `now` on its discretisation. past: points before it, on any."""

    def __init__(self, past: Sequence[Point], now: Point, options: Arclength, newton: Newton) -> None:
        self.past, self.now, self.options, self.newton = past, now, options, newton
        self.crossed: _Crossed | None = None
        self.beyond: list[tuple[float, float]] = []
        self.X = self.now.joined
        self.metric = metric(self.now.problem, self.X, options.parameter_scale)
        self.row = self.metric * self.now.tangent

    def predicted(self, step: float) -> tuple[Array, int]:
        """X ahead, and the order of its error: by the cubic through an earlier point, or by the tangent."""
        now = self.now
        for earlier in reversed(self.past):
            length = now.arclength - earlier.arclength
            if length >= 0.2 * step:
                there = earlier.on(now.problem)
                cubic = hermite(there.joined, there.tangent, self.X, now.tangent, length)
                return np.asarray(polyval(length + step, cubic)), 4
        return self.X + step * now.tangent, 2

    def step(self, step: float) -> Point | _Crossed | None:
        """The point ahead; None where Newton fails or may have left the branch, or where too much lies between."""
        options = self.options
        guess, order = self.predicted(step)
        plane = orthogonal_plane(self.now, self.row, guess)
        root = solve_root(plane, guess, self.now.p, REST, self.newton)
        if root.outcome is not Outcome.CONVERGED:
            return None
        error = plane.norm(root.x - guess, root.x) / options.prediction
        if error > WORST_MISS:
            return None
        found = direction_at(plane, root.x, self.now.p, root.linearisation)
        if found is None:
            return None
        point = self._point(root.x, found)
        lengths = np.sqrt((self.row @ self.now.tangent) * (self.metric @ point.tangent**2))
        turn = float(np.arccos(np.minimum(self.row @ point.tangent / lengths, 1.0))) / options.turn
        if not turn <= 1.0 or _hides_folds(self.now, point):
            return None
        if step > options.crossing and self.now.test * point.test < 0.0:
            return self._crossed(step, point)
        if step > options.crossing and self._hides_branch_points(step, point):
            return None
        factor = min(0.9 * max(error, 1e-12) ** (-1.0 / order), 0.5 / max(turn, 1e-12))
        if root.jacobians > 2:
            factor = min(factor, 0.7)
        # Where short steps crossed a branch point, those before it say what the branch allows.
        growth = max(MAX_GROWTH * step, self._longest_step)
        following = min(max(factor, 0.2) * step, growth, options.largest)
        if self.crossed is not None:
            following = min(following, max(self.crossed.at - step, 0.0) + 0.5 * options.crossing)
        return replace(point, step=following, iterations=root.iterations, jacobians=root.jacobians)

    @property
    def _longest_step(self) -> float:
        """Largest distance of neighbours among the points up to here."""
        return max((b.arclength - a.arclength for a, b in pairwise([*self.past, self.now])), default=0.0)

    def _crossed(self, step: float, end: Point) -> _Crossed:
        """Where the branch point lies that a step has crossed: by the parabola through the last two such steps."""
        self.beyond = [*self.beyond, (step, end.test)][-2:]
        lengths, values = np.array([(0.0, self.now.test), *self.beyond]).T
        course = np.linalg.solve(np.vander(lengths / step, increasing=True), values / self.now.test)
        at = step * float(real_roots(course, 0.0, 1.0)[0])
        self.crossed = _Crossed(at, max(at - 0.4 * self.options.crossing, self.options.crossing, 0.05 * step))
        return self.crossed

    def _hides_branch_points(self, step: float, end: Point) -> bool:
        """Whether the test function, as a parabola through the point before, this one and the end, dips below zero between."""
        before = self.past[-1] if self.past else None
        if before is None or len(before.x) != len(self.now.x) or not before.test * self.now.test > 0.0:
            return False
        back = before.arclength - self.now.arclength
        # 1 + b s + a s^2 through all three, in units of its value here.
        behind, ahead = (before.test / self.now.test - 1.0) / back, (end.test / self.now.test - 1.0) / step
        a = (ahead - behind) / (step - back)
        b = ahead - a * step
        return a > 0.0 and 0.0 < -b < 2.0 * a * step and b * b > 4.0 * a

    def stop(self, end: Point, s: float, stop: Stop) -> Point | None:
        """The exact point of a stop near arclength s on the way to an end; None where Newton fails or ends far off."""
        now = self.now
        cubic = hermite(self.X, now.tangent, end.joined, end.tangent, end.arclength - now.arclength)
        guess, is_key = np.asarray(polyval(s, cubic)), stop.measure == Parameter(now.index)
        if is_key:
            guess[-1] = stop.value
            scale, along = self.options.parameter_scale, np.asarray(polyval(s, polyder(cubic)))
            beside = beside_branch_point(now.problem, guess, now.p, now.index, along, scale)
            if beside is not None:
                point = self._point(beside.X, Direction(beside.tangent, beside.test))
                return replace(point, step=end.step, label=stop.label)
        fixed = ExtendedProblem(now.problem, (now.index,), (Given(stop.measure, stop.value),))
        root = solve_root(fixed, guess, now.p, REST, self.newton)
        if root.outcome is not Outcome.CONVERGED:
            return None
        X = root.x
        if fixed.norm(X - guess, X) > WORST_MISS * self.options.prediction:
            return None
        if is_key:
            X[-1] = stop.value
        found = direction_at(orthogonal_plane(now, self.row, X), X, now.p)
        if found is None:
            return None
        point = self._point(X, found)
        return replace(point, step=end.step, iterations=root.iterations, jacobians=root.jacobians, label=stop.label)

    def _point(self, X: Array, found: Direction) -> Point:
        """A point at X, its arclength by the chord in the metrics of both of its ends."""
        p = self.now.p.copy()
        p[self.now.index] = X[-1]
        there = metric(self.now.problem, X, self.options.parameter_scale)
        chord = (X - self.X) ** 2
        length = 0.5 * (np.sqrt(self.metric @ chord) + np.sqrt(there @ chord))
        unit = found.tangent / np.sqrt(there @ found.tangent**2)
        arclength = self.now.arclength + float(length)
        return Point(self.now.problem, X[:-1], p, self.now.index, unit, arclength, test=found.test)


def _hides_folds(start: Point, end: Point) -> bool:
    """Whether the parameter, as a cubic in arclength, turns twice between two points, by more than errors explain."""
    length = end.arclength - start.arclength
    # With t from -1 to 1, twice its derivative is a + b t + c t^2.
    first, last = float(start.tangent[-1]) * length, float(end.tangent[-1]) * length
    rise = end.parameter - start.parameter
    b, c = 0.5 * (last - first), 0.75 * (first + last - 2.0 * rise)
    a = 0.5 * (first + last) - c
    root = b * b - 4.0 * a * c
    if root <= 0.0 or abs(b) >= 2.0 * abs(c) or (a + c) * c <= abs(b * c):
        return False
    # Between its two turns the cubic changes by |c| (t2 - t1)^3/6, and dt = 2 ds/length.
    return root**1.5 / (12.0 * c * c) > AT_VALUE * max(abs(start.parameter), 1.0)


def _course(measure: AbstractMeasure, start: Point, end: Point) -> Array:
    """The measure from start to end as a cubic (4,) in arclength from the start; a line where it is NaN at one end."""
    ends, length = [], end.arclength - start.arclength
    for point in (start, end):
        row, parameters = measure.gradient(point.problem, point.x, point.p)
        slope = row @ point.tangent[:-1] + parameters[point.index] * point.tangent[-1]
        ends += [np.array(measure.value(point.problem, point.x, point.p)), np.array(slope)]
    if np.isnan(ends[0]):
        return np.array([ends[2] - length * ends[3], ends[3], 0.0, 0.0])
    if np.isnan(ends[2]):
        return np.array([ends[0], ends[1], 0.0, 0.0])
    return hermite(ends[0], ends[1], ends[2], ends[3], length)


def _crossing(stop: Stop, start: Point, end: Point) -> float | None:
    """Arclength from the start to where a measure first takes the stop's value, at most that of the end; None if never."""
    length = end.arclength - start.arclength
    if _is_at(stop, end):
        return length
    cubic = _course(stop.measure, start, end)
    if np.isnan(cubic).any():
        return None
    cubic[0] -= stop.value
    # A start at the value is no crossing, though round-off puts a root just ahead of it.
    roots = real_roots(cubic, 1e-3 * length if _is_at(stop, start) else 0.0, length)
    return float(roots[0]) if len(roots) else None


def _is_at(stop: Stop, point: Point) -> bool:
    value = stop.measure.value(point.problem, point.x, point.p)
    return abs(value - stop.value) <= AT_VALUE * max(abs(stop.value), 1.0)
