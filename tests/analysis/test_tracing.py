"""The classic benchmarks (references/continuation.md, rows 1-9): singular points on whole branches, named and located to 1e-9."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.special import ellipk

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength
from shapespace.analysis.tracing import Located, side_branches
from shapespace.base.arrays import Array
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.verification.classic import (
    at_rest,
    bratu,
    carrier,
    chafee_infante,
    chan,
    circle,
    constant,
    elastica,
    gelfand,
    mean_free,
    middle,
    neumann_bratu,
    ring,
)
from shapespace.study.verification.paths import begin, follow


def branch_from(
    problem: CollocationProblem, x: Array, p: Sequence[float], end: float, direction: float = 1.0, **options: float
) -> tuple[list[Point], list[Located]]:
    """All points and singular points up to a value of the first parameter."""
    return follow(begin(problem, x, p, direction=direction), end, options=Arclength(**options))


def check(located: Sequence[Located], exact: Sequence[tuple[Kind, float]], rounding: float = 1e-12) -> None:
    """Kinds and parameters in the order of the branch, to 1e-9; reported errors cover the true ones.

    rounding: of the reference values.
    """
    assert [one.point.kind for one in located] == [kind for kind, _ in exact]
    for one, (kind, value) in zip(located, exact, strict=True):
        error = abs(one.point.parameter - value)
        assert error <= 1e-9 + rounding, f"{kind} at {one.point.parameter!r}, not {value!r}"
        assert error <= one.point.parameter_error + rounding, f"{kind}: {error:.1e} > {one.point.parameter_error:.1e}"


def test_row_1_bratu():
    points, located = branch_from(bratu(), at_rest(bratu()), [1.0], 1.0, first=0.1)
    check(located, [(Kind.FOLD, 3.513830719125161)])
    assert middle(points[-1].problem, points[-1].x) == pytest.approx(4.091467246189261, abs=1e-8)


def test_row_2_gelfand():
    """Infinitely many folds around lambda = 2, in three dimensions with a pole at r = 0."""
    problem = gelfand()
    folds = [3.321992118, 1.664156190, 2.108541102, 1.967465559]
    _, located = follow(begin(problem, at_rest(problem), [0.0]), 100.0, len(folds))
    check(located, [(Kind.FOLD, value) for value in folds], 5e-10)


def test_row_3_branch_points_of_a_constant_state():
    """Exact branch points at u = 1 + n^2 pi^2/10, all pitchforks by reflection or half a period's shift."""
    problem = neumann_bratu(40)
    x = constant(problem, (0.1, 0.0))
    amplitudes = 1.0 + np.arange(1, 3) ** 2 * np.pi**2 / 10.0
    exact = [(Kind.FOLD, np.exp(-1.0)), *((Kind.PITCHFORK, a * np.exp(-a)) for a in amplitudes)]
    _, located = branch_from(problem, x, [0.1 * np.exp(-0.1)], 0.02, first=0.1)
    check(located, exact)


def test_row_4_an_integral_condition():
    _, located = branch_from(mean_free(), at_rest(mean_free()), [3.0, 0.0], 3.0, first=0.1)
    check(located[:1], [(Kind.FOLD, 11.923790201)], 5e-10)


def test_row_5_chan():
    _, located = branch_from(chan(), at_rest(chan()), [0.0, 0.01], 6.0, first=0.1)
    check(located, [(Kind.FOLD, 4.041401867), (Kind.FOLD, 3.155897933)], 5e-10)


def test_row_7_chafee_and_infante():
    """Pitchforks at n^2, and the side branches in elliptic functions: found on both sides, and again on the way back."""
    problem = chafee_infante(40)
    _, located = branch_from(problem, at_rest(problem), [0.5], 10.0, first=0.1)
    check(located, [(Kind.PITCHFORK, 1.0), (Kind.PITCHFORK, 4.0), (Kind.PITCHFORK, 9.0)])
    k = 0.5
    value = (2.0 * float(ellipk(k**2)) / np.pi) ** 2 * (1.0 + k**2)
    tops = []
    for start in side_branches(located[0].point, located[0].bracket.after.tangent, 0.05):
        points, _ = follow(start, value)
        tops.append(middle(points[-1].problem, points[-1].x))
        _, back = follow(points[-1].reversed(), 1.2 * value)
        check(back, [(Kind.PITCHFORK, 1.0)])
    np.testing.assert_allclose(sorted(tops), [-np.sqrt(0.4), np.sqrt(0.4)], atol=1e-8)


def test_row_8_the_elastica():
    """P_n = (n pi)^2 and, on the first branch, P/P_1 = (2 K(sin(alpha/2))/pi)^2 at the end angle alpha."""
    problem = elastica()
    _, located = branch_from(problem, at_rest(problem), [5.0], 45.0, first=0.1)
    check(located, [(Kind.PITCHFORK, np.pi**2), (Kind.PITCHFORK, 4.0 * np.pi**2)])
    start = side_branches(located[0].point, located[0].bracket.after.tangent, 0.05)[0]
    for angle, ratio in ((20.0, 1.015396866), (90.0, 1.393203930), (120.0, 1.884800869)):
        points, _ = follow(start, ratio * np.pi**2)
        end = points[-1]
        assert isinstance(end.problem, CollocationProblem)
        theta = end.problem.unpack(end.x).nodes[0, 0]
        assert abs(theta) == pytest.approx(np.radians(angle), abs=1e-7)


def test_row_6_carrier():
    """From eps = 0.6 down to 0.22: pitchforks at 0.4688625139 and 0.2347252903 on the branches through them."""
    problem = carrier(40)
    points, located = branch_from(problem, at_rest(problem), [0.6], 0.22, -1.0, first=0.05)
    found = [one.point for one in located if one.point.kind is Kind.PITCHFORK]
    known = np.array([0.2347252903, 0.4688625139])
    assert found
    for point in found:
        error = np.abs(known - point.parameter).min()
        assert error < 1e-9
        assert error <= point.parameter_error + 5e-11
    assert points[-1].parameter == 0.22


def test_row_9_the_elastic_ring():
    """The circle buckles at p = n^2 - 1 = 3, 8, 15 (pitchforks of revolution), and two-lobed rings touch at p = 5.24688696.

    Where sides touch nothing is transmitted across the ring but k^2/2 - s at the contact, with k = -1 and s = 1/2 there.
    """
    problem = ring(120)
    _, located = branch_from(problem, circle(problem, 0.5), [0.5], 16.0, first=0.1)
    check(located, [(Kind.PITCHFORK, n**2 - 1.0) for n in (2, 3, 4)])
    touching = 5.24688696
    for start in side_branches(located[0].point, located[0].bracket.after.tangent, 0.05):
        points, special = follow(start, touching)
        assert all(abs(one.point.parameter - 3.0) < 1e-9 for one in special)  # where it starts
        end = points[-1]
        assert isinstance(end.problem, CollocationProblem)
        state = end.problem.unpack(end.x)
        tension, multiplier = state.scalars
        assert abs(multiplier) < 1e-10
        assert tension == pytest.approx(0.5, abs=2e-8)
        assert state.values(np.linspace(0.0, 1.0, 9))[:, 0].min() == pytest.approx(-1.0, abs=2e-8)
