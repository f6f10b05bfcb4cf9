"""A branch of stationary surfaces beside AUTO-07p: guided division at Pe = 450 (Fig. 7b), ring amplitude 0 to 4.2.

Both start from the sphere on 60 elements of 4 Gauss points with the mesh moved along, and locate the folds. Ours locates
the branch points too; AUTO looks for none (peer_auto.py says why) and is compared with ours locating folds alone, each with
its longest steps and with steps that make as many points as its. Then ours with the leading growth rates at every point, which
AUTO does not offer for boundary value problems, 100 points of Bratu's problem beside PyCont-Lite, and 40 points of the fold
curve of Chan's problem with its cusp.

Times are processor time on one core, everything compiled, the best of five.
Run from the root: python -m benchmarks.bench_branch   (about three minutes)
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, TypeVar

from benchmarks.timing import machine, use_one_core

use_one_core()

import time

import numpy as np
from benchmarks import peer_pycont
from benchmarks.peer_auto import MISSING, STEPS, auto_directory, run_auto

from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point, brackets
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.curves import Special, own_parameter, start_curve, traced_curve
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stability import Spectrum, solve_spectrum
from shapespace.analysis.stationary import solve_stationary
from shapespace.analysis.tracing import Located, Missed, singular_points, traced
from shapespace.base.arrays import Array
from shapespace.base.problem import AbstractSmoothProblem
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem
from shapespace.study.scenario import scenario
from shapespace.study.verification.classic import at_rest, bratu, chan

KEY, END = "ring_amplitude", 4.2
MESH_TOLERANCE = 1e-4
"""Met by 60 elements all along the branch, so that ours has as many as AUTO."""
DENSE = 0.069
"""Largest step that makes as many points as AUTO has with its shorter ones."""
CHAN_CUSP = (4.1909181064, 0.0282060679)
"""(a, b); references/continuation.md, row 5."""
BRATU_FOLD = 3.513830719125161
"""Exact; study/verification/classic.py."""

Made = TypeVar("Made")


class Branch(NamedTuple):
    """points: all of them, the start included; n_failed: spectra that did not converge; outcome: why the branch ended."""

    points: list[Point]
    located: list[SingularPoint]
    n_missed: int
    n_failed: int
    outcome: str

    @property
    def folds(self) -> list[tuple[float, float]]:
        """(parameter, its estimated error) of the folds in the order met."""
        return [(point.parameter, point.parameter_error) for point in self.located if point.kind is Kind.FOLD]


Trace = Callable[[Continuation], Iterable[Point | Located | Missed]]


def with_folds(branch: Continuation) -> Iterator[Point | Located | Missed]:
    """The points of a branch with its folds, as AUTO gives them."""
    last = branch.past[-1]
    for point in branch:
        if any(bracket.kind == "fold" for bracket in brackets(last, point)):
            yield from singular_points(last, point)
        yield point
        last = point


def followed(
    problem: AbstractSmoothProblem,
    x: Array,
    options: Arclength,
    *stops: Stop,
    trace: Trace = traced,
    spectra: bool = False,
) -> Branch:
    """The branch from the state near x at parameter 0, with what `trace` locates and its growth rates if wanted."""
    found = solve_stationary(problem, x, np.zeros(1))
    start = start_point(found.problem, found.x, found.p, 0, options=options)
    assert isinstance(start, Point)
    branch = Continuation([start], stops, options)
    met = [start, *trace(branch)]
    points = [one for one in met if isinstance(one, Point)]
    n_failed = _failed_spectra(points) if spectra else 0
    located = [one.point for one in met if isinstance(one, Located)]
    n_missed = len(met) - len(points) - len(located)
    return Branch(points, located, n_missed, n_failed, str(branch.outcome))


def _failed_spectra(points: Sequence[Point]) -> int:
    """Solve for the leading growth rates of each point, helped by those of the one before; how many did not converge."""
    near: Spectrum | None = None
    n_failed = 0
    for point in points:
        assert isinstance(point.problem, AbstractSmoothProblem)
        near = solve_spectrum(point.problem, point.x, point.p, near=near)
        n_failed += not near.converged
    return n_failed


def guided_division(trace: Trace = traced, spectra: bool = False, largest: float = Arclength.largest) -> Branch:
    """Ours from the sphere to the end."""
    base = scenario("guided-division", elements=60, degree=4, mesh_tolerance=MESH_TOLERANCE, initial_ring_amplitude=0.0)
    engine, problem = Engine.of(base.with_overrides({KEY: 0.0})), KeyedProblem.of(base, (KEY,))
    x = problem.base.pack(engine.initial_state())
    options = Arclength(first=0.05, largest=largest, parameter_scale=END)
    return followed(problem, x, options, Stop(Parameter(0), END, "end", True), trace=trace, spectra=spectra)


def bratu_branch() -> Branch:
    """100 points from y = 0 over the fold, in steps short enough to end on the upper branch before lambda = 0."""
    problem = bratu()
    return followed(problem, at_rest(problem), Arclength(first=0.05, largest=0.05, max_points=99))


def chan_fold() -> SingularPoint:
    """The first fold at b = 0.01, to begin the curve at."""
    problem = chan()
    found = solve_stationary(problem, at_rest(problem), np.array([0.0, 0.01]))
    start = start_point(found.problem, found.x, found.p, 0)
    assert isinstance(start, Point)
    return next(one.point for one in traced(Continuation([start])) if isinstance(one, Located))


def fold_curve(fold: SingularPoint) -> list[Point | Special]:
    """40 points in (a, b), special points located with their errors."""
    options = Arclength(first=0.02, largest=0.05, parameter_scale=0.02, max_points=39)
    start = start_curve(fold, 1, options=options)
    assert isinstance(start, Point)
    return [
        start,
        *(one for one in traced_curve(Continuation([start], (), options)) if isinstance(one, Point | Special)),
    ]


def timed(work: Callable[[], Made]) -> tuple[Made, float]:
    """What is made and the best of five processor times, when everything is compiled."""
    made, seconds = work(), []
    for _ in range(5):
        start = time.process_time()
        made = work()
        seconds.append(time.process_time() - start)
    return made, min(seconds)


def line(name: str, points: int, seconds: float) -> str:
    """One row of the table."""
    return f"{name:34s} {points:4d} points  {seconds:6.2f} s  {1e3 * seconds / points:6.1f} ms a point"


def print_ours(largest: float) -> tuple[Branch, float]:
    """Print our branch: with its singular points, its folds alone, nothing located, and growth rates. The one with folds."""
    made, seconds = timed(partial(guided_division, largest=largest))
    print(line(f"ours, largest step {largest:g}", len(made.points), seconds), f" ends: {made.outcome}")
    for fold, error in made.folds:
        print(f"    fold {fold:.9f}, estimated error {error:.0e}")
    sizes = [point.problem.base.elements for point in made.points if isinstance(point.problem, KeyedProblem)]
    others = len(made.located) - len(made.folds)
    print(f"    also located: {others} branch points; missed: {made.n_missed}; elements <= {max(sizes)}")
    folds, seconds_folds = timed(partial(guided_division, trace=with_folds, largest=largest))
    print(line("ours, folds alone located", len(folds.points), seconds_folds))
    bare, seconds_bare = timed(partial(guided_division, trace=iter, largest=largest))
    print(line("ours, nothing located", len(bare.points), seconds_bare))
    full, seconds_full = timed(partial(guided_division, spectra=True, largest=largest))
    print(
        line("ours, with leading growth rates", len(full.points), seconds_full),
        f" {seconds_full / seconds:.2f} times the time without; failed: {full.n_failed}",
    )
    return folds, seconds_folds


def print_auto(ours: Branch, seconds: float, step: float) -> None:
    """Print AUTO's branch beside ours, or that it is not here."""
    directory = auto_directory()
    if directory is None:
        print(MISSING)
        return
    last = ours.points[-1]
    assert isinstance(last.problem, KeyedProblem)
    mine = np.array([last.parameter, *last.problem.base.unpack(last.x).scalars[:2]])
    run = min((run_auto(directory, step) for _ in range(5)), key=lambda run: run.seconds)
    print(line(f"AUTO-07p, DSMAX {step}", run.points, run.seconds))
    ratio = (len(ours.points) / seconds) / (run.points / run.seconds)
    print(f"    points per second, ours to AUTO's: {ratio:.2f}; whole branches per second: {run.seconds / seconds:.2f}")
    for theirs, (fold, _) in zip(run.folds, ours.folds, strict=True):
        print(f"    fold {theirs:.9f}, AUTO's less ours {theirs - fold:+.1e}")
    print(f"    end: relative differences of (Delta_c, h, p) {np.abs(np.array(run.end) / mine - 1.0)}")


def print_pycont(points: int, seconds: float) -> None:
    """Print what PyCont-Lite does on Bratu's problem, or that it is not here."""
    run = peer_pycont.run_pycont(points // 2, 0.3)
    if run is None:
        print(peer_pycont.MISSING)
        return
    print(line(f"PyCont-Lite, {peer_pycont.CELLS} cells", run.points, run.seconds))
    ratio = (points / seconds) / (run.points / run.seconds)
    print(
        f"    fold {run.fold:.12f}, error {abs(run.fold - BRATU_FOLD):.0e}; points per second, ours to its: {ratio:.0f}"
    )


def main() -> None:
    """Print the table."""
    print(machine())
    for largest, theirs in zip((DENSE, Arclength.largest), STEPS, strict=True):
        ours, seconds = print_ours(largest)
        print_auto(ours, seconds, theirs)
    made, seconds = timed(bratu_branch)
    ((fold, error),) = made.folds
    print(line("Bratu, 20 elements", len(made.points), seconds))
    print(f"    fold {fold:.12f}, estimated error {error:.0e}, error {abs(fold - BRATU_FOLD):.0e}")
    print_pycont(len(made.points), seconds)
    curve, seconds = timed(partial(fold_curve, chan_fold()))
    (cusp,) = (one for one in curve if isinstance(one, Special))
    print(line("fold curve of Chan, 20 elements", len(curve) - 1, seconds))
    at = np.array([own_parameter(cusp.point), cusp.point.parameter])
    print(f"    cusp {at}, estimated errors {np.array(cusp.errors)}, errors {np.abs(at - CHAN_CUSP)}")


if __name__ == "__main__":
    main()
