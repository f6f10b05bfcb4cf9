"""Classic boundary value problems by the continuation, the spectra and the searches that branches of surfaces use."""

from collections.abc import Iterator

import numpy as np
from scipy.special import ellipk

from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, Stop
from shapespace.analysis.curves import CurveKind, Special, own_parameter, start_curve, system_of, traced_curve
from shapespace.analysis.deflation import Guess, is_same
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stability import solve_spectrum
from shapespace.analysis.stationary import Stationary, step_to
from shapespace.analysis.tracing import side_branches
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.verification import classic
from shapespace.study.verification.classic import at_rest, constant, middle
from shapespace.study.verification.paths import OwnParameter, begin, follow, singular, solutions, state_at, with_images
from shapespace.study.verification.record import Row
from shapespace.study.verification.states import Absent

FORM = "closed form"
SHOOTING = "shooting of order 8, two tolerances"
CHEBYSHEV = "Chebyshev collocation, two resolutions"
CARRIER = f"Chapman & Farrell, arXiv 1609.08842; {CHEBYSHEV}"
BRATU_FOLD = 3.513830719125161
"""8 (x^2 - 1), x tanh x = 1."""


def bratu() -> Iterator[Row]:
    """The fold, and both states at lam = 1 with their leading rates."""
    problem = classic.bratu(40)
    points, located = follow(begin(problem, at_rest(problem), [1.0]), 1.0)
    fold = located[0].point
    at_fold = state_at(fold)
    yield Row("lam of the fold", fold.parameter, BRATU_FOLD, f"{FORM}; AUTO demo exp: 3.51383", 1e-9)
    yield Row("y'(0) there", float(at_fold.nodes[0, 1]), 4.0, FORM, 1e-6)
    yield Row("y(1/2) there", float(at_fold.values(np.array([0.5]))[0, 0]), 1.186842168634389, FORM, 1e-6)
    known = (("lower", begin(problem, at_rest(problem), [1.0]), 0.140539214400472, -8.73971097),
             ("upper", points[-1], 4.091467246189261, 28.87309109))  # fmt: skip
    for name, point, top, rate in known:
        assert isinstance(point.problem, CollocationProblem)
        found = solve_spectrum(point.problem, point.x, point.p)
        yield Row(f"y(1/2) of the {name} state at lam = 1", middle(point.problem, point.x), top, FORM, 1e-8)
        yield Row(f"leading rate of the {name} state", float(found.rates[0].real), rate, CHEBYSHEV, 1e-8)


def gelfand() -> Iterator[Row]:
    """Five of infinitely many folds in a ball, the maxima at three of them, and the only fold in a disc."""
    source = f"Joseph & Lundgren 1973; {SHOOTING}"
    problem = classic.gelfand()
    found = singular(begin(problem, at_rest(problem), [0.0]), Kind.FOLD, 5)
    known = (3.321992118, 1.664156190, 2.108541102, 1.967465559, 2.009976405)
    for number, (fold, exact) in enumerate(zip(found, known, strict=True), start=1):
        yield Row(f"ball: lam of fold {number}", fold.parameter, exact, source, 1e-9)
    for number, (fold, top) in enumerate(zip(found, (1.607456775, 6.740792420, 11.37650972), strict=False), start=1):
        yield Row(f"ball: y(0) at fold {number}", float(state_at(fold).nodes[0, 0]), top, source, 1e-6)
    problem = classic.gelfand(dimension=2)
    (fold,) = singular(begin(problem, at_rest(problem), [0.0]), Kind.FOLD, 1)
    yield Row("disc: lam of the fold", fold.parameter, 2.0, FORM, 1e-9)
    yield Row("disc: y(0) there", float(state_at(fold).nodes[0, 0]), 2.0 * np.log(2.0), FORM, 1e-6)


def neumann() -> Iterator[Row]:
    """Constant states lose stability to cosines."""
    problem = classic.neumann_bratu(40)
    start = begin(problem, constant(problem, (0.1, 0.0)), [0.1 * np.exp(-0.1)])
    _, located = follow(start, 1e-4, 4)
    kinds = [Kind.FOLD, *3 * [Kind.PITCHFORK]]
    if [one.point.kind for one in located] != kinds:
        raise Absent(f"found {', '.join(one.point.kind for one in located)}, not a fold and three pitchforks.")
    yield Row("lam of the fold", located[0].point.parameter, np.exp(-1.0), FORM, 1e-9)
    for n, one in enumerate(located[1:], start=1):
        top = 1.0 + (n * np.pi) ** 2 / 10.0
        yield Row(f"lam of pitchfork {n}", one.point.parameter, top * np.exp(-top), FORM, 1e-8)


def integral() -> Iterator[Row]:
    """A fold under an integral condition, also followed in a second parameter; and one of a problem that depends on x."""
    problem = classic.mean_free()
    (fold,) = singular(begin(problem, at_rest(problem), [3.0, 0.0]), Kind.FOLD, 1)
    yield Row("p1 of the fold at p2 = 0", fold.parameter, 11.923790201, f"AUTO demo int: 11.9238; {SHOOTING}", 1e-9)
    *_, last = _fold_curve(fold, Stop(OwnParameter(), 3.0, "end", ends=True), Arclength(first=0.1))
    source = f"AUTO demo int: 7.90922; {SHOOTING}"
    yield Row("p2 of the fold at p1 = 3", last.parameter, 7.909158283, source, 1e-9)
    problem = classic.non_autonomous()
    (fold,) = singular(begin(problem, at_rest(problem), [0.0]), Kind.FOLD, 1)
    yield Row("y'' + p exp(x^3 y) = 0: p of the fold", fold.parameter, 14.074498573, f"AUTO demo non; {SHOOTING}", 1e-9)


def chan() -> Iterator[Row]:
    """Two folds, and the cusp at which they meet as b rises."""
    problem = classic.chan()
    found = singular(begin(problem, at_rest(problem), [0.0, 0.01]), Kind.FOLD, 2)
    source = f"tutorials of LOCA and BifurcationKit; {SHOOTING}"
    for number, (fold, exact) in enumerate(zip(found, (4.041401867, 3.155897933), strict=True), start=1):
        yield Row(f"b = 0.01: a of fold {number}", fold.parameter, exact, source, 1e-9)
    curve = _fold_curve(
        found[0], Stop(Parameter(1), 0.01, "end", ends=True), Arclength(first=0.02, largest=0.05, parameter_scale=0.02)
    )
    cusps = [one for one in traced_curve(curve) if isinstance(one, Special) and one.kind is CurveKind.CUSP]
    if len(cusps) != 1:
        raise Absent(f"{len(cusps)} cusps found; the curve ended so: {curve.outcome}.")
    point = cusps[0].point
    yield Row("cusp: a", own_parameter(point), 4.1909181064, SHOOTING, 1e-9)
    yield Row("cusp: b", point.parameter, 0.0282060679, SHOOTING, 1e-8)
    system = system_of(point)
    assert isinstance(system.base, CollocationProblem)
    top = middle(system.base, system.state(point.x)) + point.parameter
    yield Row("cusp: largest T", top, 3.00431, SHOOTING, 2e-6)


def _fold_curve(fold: SingularPoint, stop: Stop, options: Arclength) -> Continuation:
    """Folds from one on, in the second parameter."""
    start = start_curve(fold, 1, options=options)
    if not isinstance(start, Point):
        raise Absent(f"the curve of folds could not be begun: {start}.")
    return Continuation([start], [stop], options)


def chafee_infante() -> Iterator[Row]:
    """The trivial state yields at n^2; what leaves it is known in elliptic functions."""
    problem = classic.chafee_infante(40)
    _, located = follow(begin(problem, at_rest(problem), [0.5]), 100.0, 3)
    for number, one in enumerate(located, start=1):
        yield Row(f"lam of pitchfork {number}", one.point.parameter, float(number**2), FORM, 1e-9)
    k = 0.5
    value = (2.0 * float(ellipk(k**2)) / np.pi) ** 2 * (1.0 + k**2)
    tops = []
    for start in side_branches(located[0].point, located[0].bracket.after.tangent, 0.05):
        points, _ = follow(start, value)
        tops.append(float(state_at(points[-1]).values(np.array([0.5]))[0, 0]))
    for name, top, sign in zip(("one side", "other side"), sorted(tops), (-1.0, 1.0), strict=True):
        yield Row(f"y(pi/2) at lam = {value:.9f}, {name}", top, sign * np.sqrt(2.0 * k**2 / (1.0 + k**2)), FORM, 1e-8)


def carrier() -> Iterator[Row]:
    """Interior layers: how many solutions there are, where they meet, and a pair that no other one leads to."""
    problem = classic.carrier(40)
    start = Guess("y = 0", problem, at_rest(problem))
    found = {eps: solutions([start], np.array([eps])) for eps in (0.5, 0.4, 0.3, 0.26, 0.22)}
    for (eps, states), known in zip(found.items(), (2.0, 4.0, 4.0, 6.0, 8.0), strict=True):
        count = float(with_images(states))
        yield Row(f"solutions at eps = {eps:g}, mirror images counted", count, known, CARRIER, 0.0)
    options = Arclength(first=0.05, max_points=600)
    passed = [
        one.point.parameter
        for state in found[0.22]
        for one in follow(_onwards(state, 1.0), 0.6, options=options)[1]
        if one.point.kind is Kind.PITCHFORK
    ]
    for exact in (0.4688625139, 0.2347252903):
        value = min(passed, key=lambda passed_at: abs(passed_at - exact), default=float("nan"))
        yield Row("eps of a pitchfork", value, exact, CARRIER, 1e-9)
    carried = [step_to(state, np.array([0.26])) for state in found[0.3]]
    alone = [one for one in found[0.26] if not any(is_same(one, other) for other in carried)]
    for number, state in enumerate(alone, start=1):
        (fold,) = singular(_onwards(state, 1.0), Kind.FOLD, 1, options)
        yield Row(f"eps where isolated solution {number} ends", fold.parameter, 0.2852253820, CARRIER, 1e-9)


def _onwards(state: Stationary, direction: float) -> Point:
    assert isinstance(state.problem, CollocationProblem)
    return begin(state.problem, state.x, state.p.tolist(), direction=direction)
