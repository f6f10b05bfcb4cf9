"""Folds and branch points of classic boundary value problems by the continuation that branches of surfaces use."""

from collections.abc import Iterator, Sequence

import numpy as np

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stationary import solve_stationary
from shapespace.analysis.tracing import Located, Missed, traced
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.verification.classic import at_rest, bratu, chafee_infante, chan, gelfand, mean_free
from shapespace.study.verification.record import Row
from shapespace.study.verification.states import Absent

SHOOTING = "shooting of order 8, two tolerances"
BRATU_FOLD = 3.513830719125161
"""8 (x^2 - 1), x tanh x = 1."""


def folds() -> Iterator[Row]:
    """Bratu, Joseph & Lundgren, AUTO's demo with an integral condition, Chan."""
    (fold,) = _singular(bratu(), [0.0], Kind.FOLD, 1)
    yield Row("Bratu's problem: fold", fold, BRATU_FOLD, "closed form; AUTO demo exp: 3.51383", 1e-9)
    values = (3.321992118, 1.664156190, 2.108541102)
    for number, (fold, exact) in enumerate(
        zip(_singular(gelfand(), [0.0], Kind.FOLD, 3), values, strict=True), start=1
    ):
        yield Row(
            f"Gelfand's problem in a ball: fold {number}", fold, exact, f"Joseph & Lundgren 1973; {SHOOTING}", 1e-9
        )
    (fold,) = _singular(mean_free(), [3.0, 0.0], Kind.FOLD, 1)
    yield Row("integral condition: fold", fold, 11.923790201, f"AUTO demo int: 11.9238; {SHOOTING}", 1e-9)
    for number, (fold, exact) in enumerate(
        zip(_singular(chan(), [0.5, 0.01], Kind.FOLD, 2), (4.041401867, 3.155897933), strict=True), start=1
    ):
        yield Row(f"Chan's problem: fold {number}", fold, exact, f"tutorials of LOCA; {SHOOTING}", 1e-9)


def branch_points() -> Iterator[Row]:
    """Chafee and Infante: the trivial state yields at n^2."""
    for number, fork in enumerate(_singular(chafee_infante(40), [0.5], Kind.PITCHFORK, 3), start=1):
        yield Row(f"Chafee & Infante's problem: pitchfork {number}", fork, float(number**2), "closed form", 1e-9)


def _singular(problem: CollocationProblem, p: Sequence[float], kind: Kind, count: int) -> list[float]:
    """Parameters of the first points of a kind on the branch from x = 0 upwards in p[0]."""
    start = solve_stationary(problem, at_rest(problem), np.array(p))
    first = start_point(start.problem, start.x, start.p, 0) if start.outcome.is_success else start.outcome
    if not isinstance(first, Point):
        raise Absent(f"there is no state to start from: {first}.")
    found: list[float] = []
    branch = Continuation([first], [Stop(Parameter(0), 100.0, "end", ends=True)], Arclength(first=0.1, max_points=400))
    for one in traced(branch):
        if isinstance(one, Missed):
            raise Absent(f"a {one.bracket.kind} near {one.bracket.after.parameter:.6g} was not located: {one.outcome}.")
        if isinstance(one, Located) and one.point.kind is kind:
            found.append(one.point.parameter)
        if len(found) == count:
            return found
    raise Absent(f"{len(found)} of {count} {kind} points found; the branch ended so: {branch.outcome}.")
