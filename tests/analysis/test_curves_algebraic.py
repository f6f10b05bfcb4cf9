"""Special points of curves in closed form, on algebraic problems of one to three unknowns."""

from collections.abc import Callable
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis import curves
from shapespace.analysis.bifurcation import SingularPoint, locate_branch_point, locate_fold
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop
from shapespace.analysis.curves import (
    CurveKind,
    Special,
    is_unfolded,
    own_parameter,
    parameters_at,
    start_curve,
    traced_curve,
)
from shapespace.analysis.extended import Parameter
from shapespace.analysis.passage import passed_start
from shapespace.base.arrays import Traced

Law = Callable[[Traced, Traced], Traced]


def fold(law: Law, x: list[float], p: list[float], tangent: list[float]) -> SingularPoint:
    found = locate_fold(AlgebraicProblem(law, len(x)), 0, np.array(x), np.array(p), np.array(tangent))
    assert isinstance(found, SingularPoint)
    return found


def fork(law: Law, x: list[float], p: list[float], tangent: list[float]) -> SingularPoint:
    found = locate_branch_point(AlgebraicProblem(law, len(x)), 0, np.array(x), np.array(p), np.array(tangent))
    assert isinstance(found, SingularPoint)
    return found


def follow(start: SingularPoint, direction: float, end: float) -> tuple[list[Special], list[Point]]:
    """The special points and the points of the curve, from p[1] to its end."""
    options = Arclength(first=0.05)
    first = start_curve(start, 1, direction, options)
    assert isinstance(first, Point)
    curve = Continuation([first], [Stop(Parameter(1), end, "end", True)], options)
    met = list(traced_curve(curve))
    assert curve.outcome == "reached-stop"
    points = [first, *(one for one in met if isinstance(one, Point))]
    specials = [one for one in met if isinstance(one, Special)]
    assert len(points) + len(specials) == len(met) + 1
    return specials, points


def check(special: Special, kind: CurveKind, x: list[float], p: list[float], within: float = 1e-7) -> None:
    assert special.kind is kind
    assert parameters_at(special.point) == pytest.approx(p, abs=within)
    assert special.point.x[: len(x)] == pytest.approx(x, abs=1e-5)


def test_a_cusp():
    """x' = a + b x - x^3: folds at a = +-2 (b/3)^(3/2) meet at the origin."""
    law = lambda x, p: jnp.stack([p[0] + p[1] * x[0] - x[0] ** 3])
    (cusp,), points = follow(fold(law, [0.9], [-1.9, 3.0], [1.0]), -1.0, 3.0)
    check(cusp, CurveKind.CUSP, [0.0], [0.0, 0.0])
    assert own_parameter(points[-1]) == pytest.approx(2.0, abs=1e-9)
    for point in points:
        a, b = parameters_at(point)
        assert 27.0 * a**2 == pytest.approx(4.0 * b**3, abs=1e-6)


@pytest.mark.parametrize("miss", [0.0, 1e-9, -1e-9])
def test_a_curve_that_starts_at_a_cusp_does_not_look_for_it_again(miss: float):
    law = lambda x, p: jnp.stack([p[0] + p[1] * x[0] - x[0] ** 3])
    start = replace(fold(law, [0.9], [-1.9, 3.0], [1.0]), x=np.array([miss]), p=np.zeros(2))
    for direction in (1.0, -1.0):
        specials, points = follow(start, direction, 3.0)
        assert not specials
        assert abs(own_parameter(points[-1])) == pytest.approx(2.0, abs=1e-9)


def test_bogdanov_and_takens():
    """x' = y, y' = a + b x + x^2 + x y: on the folds a = b^2/4, x = -b/2, the trace x + 0 vanishes at the origin."""
    law = lambda x, p: jnp.stack([x[1], p[0] + p[1] * x[0] + x[0] ** 2 + x[0] * x[1]])
    (found,), _ = follow(fold(law, [-0.6, 0.0], [0.3, 1.0], [1.0, 0.0]), -1.0, -1.0)
    check(found, CurveKind.BOGDANOV_TAKENS, [0.0, 0.0], [0.0, 0.0])


def test_where_a_fold_curve_runs_along_its_own_parameter():
    """x' = x^2 + a^2 - b: folds b = a^2, which turn in b where two branches are born."""
    law = lambda x, p: jnp.stack([x[0] ** 2 + p[0] ** 2 - p[1]])
    (turn,), points = follow(fold(law, [0.05], [1.05, 1.0], [1.0]), -1.0, 1.0)
    check(turn, CurveKind.TURN, [0.0], [0.0, 0.0])
    assert own_parameter(points[-1]) == pytest.approx(-1.0, abs=1e-9)


def test_a_pitchfork_changes_its_side():
    """x' = a x - x y + b x^3, y' = x^2 - y: the side branch is a = (1 - b) x^2 + ..."""
    law = lambda x, p: jnp.stack([p[0] * x[0] - x[0] * x[1] + p[1] * x[0] ** 3, x[0] ** 2 - x[1]])
    (found,), points = follow(fork(law, [0.0, 0.0], [0.1, 0.0], [0.0, 0.0, 1.0]), 1.0, 2.0)
    check(found, CurveKind.DEGENERATE_PITCHFORK, [0.0, 0.0], [0.0, 1.0])
    assert max(abs(own_parameter(point)) for point in points) < 1e-9


FOLDING: Law = lambda x, p: jnp.stack([x[0] * (p[1] + x[1]) - x[0] ** 3, p[0] - x[1] ** 2 - x[0] ** 2])
"""x' = x (b + y) - x^3, y' = a - y^2 - x^2: a symmetric branch a = y^2 with its fold at a = 0 and a pitchfork at y = -b, a = b^2.

The side branch is y = x^2 - b, a = b^2 + (1 - 2b) x^2 + x^4.
"""


def test_a_pitchfork_passes_a_fold():
    start = fork(FOLDING, [0.0, -1.02], [1.05, 1.0], [0.0, -1.0 / np.sqrt(5.0), 2.0 / np.sqrt(5.0)])
    specials, points = follow(start, -1.0, -1.0)
    degenerate, merging = specials
    check(degenerate, CurveKind.DEGENERATE_PITCHFORK, [0.0, -0.5], [0.25, 0.5])
    check(merging, CurveKind.FOLD_PITCHFORK, [0.0, 0.0], [0.0, 0.0])
    for point in points:
        a, b = parameters_at(point)
        assert a == pytest.approx(b**2, abs=1e-8)


def test_a_fold_meets_the_pitchfork():
    """Along the curve of folds a = 0; without a known symmetry it is a branch point of the curve."""
    specials, _ = follow(fold(FOLDING, [0.0, 0.05], [0.02, 1.0], [0.0, 1.0]), -1.0, -1.0)
    assert [one.kind for one in specials] == [CurveKind.BRANCH_POINT]
    check(specials[0], CurveKind.BRANCH_POINT, [0.0, 0.0], [0.0, 0.0], within=1e-6)


def test_a_transcritical_point_that_unfolds():
    """x' = a x - x^2 + b: branches cross at b = 0 only."""
    law = lambda x, p: jnp.stack([p[0] * x[0] - x[0] ** 2 + p[1]])
    start = fork(law, [0.0], [0.1, 0.0], [0.0, 1.0])
    first = start_curve(start, 1, 1.0, Arclength(first=0.05))
    assert isinstance(first, Point)
    assert not is_unfolded(first)
    curve = Continuation([first], [Stop(Parameter(1), 1.0, "end", True)], Arclength(first=0.05))
    assert is_unfolded(next(iter(curve)))


def test_a_closed_curve():
    """x' = x^2 + a^2 + b^2 - 1: the folds are a circle."""
    law = lambda x, p: jnp.stack([x[0] ** 2 + p[0] ** 2 + p[1] ** 2 - 1.0])
    first = start_curve(fold(law, [0.1], [0.8, 0.6], [1.0]), 1, 1.0, Arclength(first=0.05))
    assert isinstance(first, Point)
    last, length = first, 0.0
    for point in Continuation([first], (), Arclength(first=0.05, max_points=200)):
        length = point.arclength
        if passed_start(first, last, point) is not None:
            break
        last = point
    assert length == pytest.approx(2.0 * np.pi, abs=0.3)


def test_a_zero_is_found_where_there_is_no_value(monkeypatch: pytest.MonkeyPatch):
    """Newton fails at a singular point: what is beside it tells where it is, and elsewhere no value is no zero."""
    monkeypatch.setattr(curves, "point_between", lambda before, after, share: share)

    def failing(within: float) -> curves.Function:
        return lambda share: np.nan if abs(share - 0.512) < within else np.sinh(share - 0.512)

    for within in (1e-9, 1e-3):
        monkeypatch.setattr(curves, "regularity", singular := failing(within))
        assert curves.locate(0.0, 1.0, singular) == pytest.approx(0.512, abs=1e-9)
        assert curves.locate(0.0, 1.0, failing(within)) is None
    monkeypatch.setattr(curves, "regularity", hopeless := failing(1.0))
    assert curves.locate(0.0, 1.0, hopeless) is None
