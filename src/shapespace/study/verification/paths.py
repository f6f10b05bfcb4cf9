"""Branches and searches of classic problems: what lies on the way, or why there is none."""

from collections.abc import Sequence

import numpy as np

from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.deflation import Deflation, Guess, Trial, images, perturbed, search
from shapespace.analysis.extended import AbstractMeasure, Parameter
from shapespace.analysis.stability import Spectral, solve_spectrum
from shapespace.analysis.stationary import Stationary, solve_stationary
from shapespace.analysis.tracing import Located, Missed, traced
from shapespace.base.arrays import Array
from shapespace.base.problem import AbstractContinuableProblem, AbstractSmoothProblem
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.state import State
from shapespace.study.verification.states import Absent

STEPS = Arclength(first=0.1, max_points=600)


class OwnParameter(AbstractMeasure):
    """The parameter in which a singular point was found, the last entry of its X."""

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        return float(x[-1])

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        row = np.zeros_like(x)
        row[-1] = 1.0
        return row, np.zeros_like(p)


def begin(problem: CollocationProblem, x: Array, p: Sequence[float], index: int = 0, direction: float = 1.0) -> Point:
    """The solution nearest to x as the first point of a branch in p[index]."""
    found = solve_stationary(problem, x, np.array(p, dtype=float))
    start = (
        start_point(found.problem, found.x, found.p, index, direction) if found.outcome.is_success else found.outcome
    )
    if not isinstance(start, Point):
        raise Absent(f"there is no state to start from: {start}.")
    return start


def follow(
    start: Point, end: float, count: int | None = None, options: Arclength = STEPS
) -> tuple[list[Point], list[Located]]:
    """All points and singular points up to a value of the parameter, or up to so many singular points."""
    branch = Continuation([start], [Stop(Parameter(start.index), end, "end", ends=True)], options)
    points: list[Point] = []
    located: list[Located] = []
    for one in traced(branch):
        if isinstance(one, Missed):
            raise Absent(f"a {one.bracket.kind} near {one.bracket.after.parameter:.6g} was not located: {one.outcome}.")
        if isinstance(one, Located):
            located.append(one)
        else:
            points.append(one)
        if len(located) == count:
            return points, located
    if count is not None:
        raise Absent(f"{len(located)} of {count} singular points found; the branch ended so: {branch.outcome}.")
    return points, located


def singular(start: Point, kind: Kind, count: int, options: Arclength = STEPS) -> list[SingularPoint]:
    """The first singular points on a branch, which must be of one kind."""
    _, located = follow(start, 100.0, count, options)
    if kinds := [one.point.kind for one in located if one.point.kind is not kind]:
        raise Absent(f"a {kinds[0]} was found in place of a {kind}.")
    return [one.point for one in located]


def state_at(point: Point | SingularPoint) -> State:
    """The solution of a point."""
    assert isinstance(point.problem, CollocationProblem)
    return point.problem.unpack(point.x)


def by_modes(trial: Trial, amplitudes: Sequence[float] = (0.3,)) -> list[Guess]:
    """Guesses from a solution, moved along its leading modes."""
    one = trial.found
    assert isinstance(one.problem, AbstractSmoothProblem)
    spectrum = solve_spectrum(one.problem, one.x, one.p, Spectral(count=3))
    return perturbed(one, spectrum, f"solution {trial.number}", amplitudes)


def solutions(guesses: Sequence[Guess], p: Array) -> list[Stationary]:
    """What a search by deflation finds from some guesses and from all that it finds."""
    return [trial.found for trial in search(guesses, p, by_modes, options=Deflation(power=4.0)) if trial.is_new]


def with_images(found: Sequence[Stationary]) -> int:
    """How many solutions there are if mirror images count."""
    total = 0
    for one in found:
        assert isinstance(one.problem, CollocationProblem)
        total += len(images(one, one.problem))
    return total
