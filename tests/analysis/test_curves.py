"""Curves of folds and pitchforks in two parameters (references/continuation.md, rows 4 and 5; the elliptic sine)."""

import jax.numpy as jnp
import numpy as np

from shapespace.analysis.bifurcation import Kind, SingularPoint, locate_branch_point
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.curves import CurveKind, Special, own_parameter, parameters_at, start_curve, traced_curve
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stationary import solve_stationary
from shapespace.analysis.tracing import Located, traced
from shapespace.base.outcome import Outcome
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.mesh import uniform_mesh
from shapespace.numerics.newton import Newton
from shapespace.numerics.system import Symmetry
from shapespace.study.verification.classic import SecondOrder, at_rest, chan, mean_free
from shapespace.study.verification.paths import OwnParameter


def folds(problem: CollocationProblem, p: list[float], end: float) -> list[SingularPoint]:
    found = solve_stationary(problem, at_rest(problem), np.array(p))
    start = start_point(found.problem, found.x, found.p, 0)
    assert isinstance(start, Point)
    branch = Continuation([start], [Stop(Parameter(0), end, "end", True)], Arclength(first=0.1))
    return [one.point for one in traced(branch) if isinstance(one, Located)]


def test_the_fold_curve_of_an_integral_condition():
    """Row 4: the fold from p1 = 11.92 at p2 = 0 comes to p1 = 3 at p2 = 7.909158283."""
    start = start_curve(folds(mean_free(), [3.0, 0.0], 3.0)[0], 1, options=Arclength(first=0.1))
    assert isinstance(start, Point)
    curve = Continuation([start], [Stop(OwnParameter(), 3.0, "end", True)], Arclength(first=0.1))
    *_, last = curve
    assert curve.outcome is Outcome.REACHED_STOP
    assert abs(parameters_at(last)[0] - 3.0) < 1e-9
    assert abs(last.parameter - 7.909158283) < 1e-9


def test_the_cusp_of_chan():
    """Row 5: from one fold at b = 0.01 through the cusp (4.1909181064, 0.0282060679) back to the other fold."""
    first, second = folds(chan(), [0.0, 0.01], 6.0)
    options = Arclength(first=0.02, largest=0.05, parameter_scale=0.02)
    start = start_curve(first, 1, options=options)
    assert isinstance(start, Point)
    curve = Continuation([start], [Stop(Parameter(1), 0.01, "end", True)], options)
    cusps: list[Special] = []
    last = start
    for one in traced_curve(curve):
        if isinstance(one, Special):
            cusps.append(one)
        elif isinstance(one, Point):
            last = one
    assert curve.outcome is Outcome.REACHED_STOP
    assert abs(parameters_at(last)[0] - second.parameter) < 1e-8
    assert len(cusps) == 1
    assert cusps[0].kind is CurveKind.CUSP
    # The references are rounded in the last digit given.
    assert abs(own_parameter(cusps[0].point) - 4.1909181064) < cusps[0].errors[0] + 5e-11
    assert abs(cusps[0].point.parameter - 0.0282060679) < cusps[0].errors[1] + 5e-11
    assert max(cusps[0].errors) < 1e-8


def test_a_curve_of_pitchforks():
    """y'' + lam (a y - y^3) = 0 on (0, pi): pitchforks at lam a = 1, followed in a; the unfolding stays zero."""
    mirror = Symmetry(False, (-1.0, -1.0), (0.0, 0.0))
    system = SecondOrder(
        lambda x, y, p: p[0] * (p[1] * y - y**3) + 0.0 * jnp.sin(x),
        parameters=("lam", "a"),
        length=float(np.pi),
        mirror=mirror,
    )
    problem = CollocationProblem(system, uniform_mesh(20), 4, 1e-8)
    x = at_rest(problem)
    point = locate_branch_point(problem, 0, x, np.array([1.02, 1.0]), np.append(x, 1.02))
    assert isinstance(point, SingularPoint)
    assert point.kind is Kind.PITCHFORK
    start = start_curve(point, 1)
    assert isinstance(start, Point)
    for point_on in Continuation([start], [Stop(Parameter(1), 2.5, "end", True)], newton=Newton(tolerance=1e-11)):
        lam, a = parameters_at(point_on)
        assert abs(lam * a - 1.0) < 1e-9
        assert abs(point_on.x[-1]) < 1e-9
    assert point_on.parameter == 2.5
