"""Time stepping: orders on an ODE, a constrained motion (index 2) and a surface; error control, ends, resuming."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from tests.dense import NO_PARAMETERS, DenseLinearisation, DenseProblem
from tests.surfaces import fields_at, make_engine, march

from shapespace.analysis.evolution import Evolution, Moment, Stepping
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import AbstractLinearisation, Rate
from shapespace.numerics.newton import Newton

TIGHT = Newton(1e-12)
ORDERS = (1, 2, 3)
END = 0.7
"""Not 1, where x of the motion on the circle is largest and thus blind to errors of first order."""

LOGISTIC = DenseProblem(lambda x, dq, p: dq - 3.0 * x * (1.0 - x))
"""y' = 3 y (1 - y)."""

# A point dragged along the unit circle by the force (0, -1): x' = m x, y' = -1 + m y, x^2 + y^2 = 1, q = (x, y).
CIRCLE = DenseProblem(
    lambda x, dq, p: np.array([dq[0] - x[2] * x[0], dq[1] + 1.0 - x[2] * x[1], x[0] ** 2 + x[1] ** 2 - 1.0]),
    lambda x: x[:2],
)


def logistic(t: float) -> Array:
    """From y(0) = 0.1."""
    return np.array([1.0 / (1.0 + 9.0 * np.exp(-3.0 * t))])


def circle(t: float) -> Array:
    """x = sech(1 - t), y = m = tanh(1 - t)."""
    return np.array([1.0 / np.cosh(1.0 - t), np.tanh(1.0 - t), np.tanh(1.0 - t)])


SOLVABLE = {"ODE": (LOGISTIC, logistic), "index 2": (CIRCLE, circle)}


def evolution(
    problem: DenseProblem, past: Sequence[Moment], until: float, newton: Newton = TIGHT, **stepping: float
) -> tuple[list[Moment], Outcome | None]:
    """Accepted moments after the past, and why they ended."""
    assert all(moment.problem is problem for moment in past)
    options = Stepping(**{"stationary_rate": 0.0, **stepping})
    made = Evolution(past, NO_PARAMETERS, until, options, newton)
    return list(made), made.outcome


def exact_past(name: str, count: int, step: float) -> list[Moment]:
    """Moments on the exact solution, the last at time 0."""
    problem, solution = SOLVABLE[name]
    return [Moment(-j * step, problem, solution(-j * step)) for j in range(count - 1, -1, -1)]


@pytest.mark.parametrize("name", SOLVABLE)
@pytest.mark.parametrize("order", ORDERS)
def test_order_in_time(name: str, order: int):
    """Backward Euler, BDF2 and BDF3 at fixed steps, started on the exact solution; multipliers as well as states."""
    problem, solution = SOLVABLE[name]
    errors = []
    for steps in (40, 80, 160):
        past = exact_past(name, order, END / steps)
        moments, outcome = evolution(problem, past, END, order=order, fixed_step=END / steps)
        assert (outcome, len(moments)) == (Outcome.REACHED_END, steps)
        errors.append(np.abs(moments[-1].x - solution(END)))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.abs(slopes[-1] - order).max() < 0.15, f"order {order}: errors {errors}, observed orders {slopes}"


@pytest.mark.parametrize("name", SOLVABLE)
@pytest.mark.parametrize(("order", "expected"), [(1, 1), (2, 2)])
def test_order_in_time_from_a_single_state(name: str, order: int, expected: int):
    """BDF2 starts with one step of backward Euler and loses nothing by it."""
    problem, solution = SOLVABLE[name]
    errors = []
    for steps in (80, 160, 320):
        moments, _ = evolution(problem, exact_past(name, 1, 1.0), END, order=order, fixed_step=END / steps)
        errors.append(float(np.abs(moments[-1].x - solution(END)).max()))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert abs(slopes[-1] - expected) < 0.15, f"order {order}: errors {errors}, observed orders {slopes}"


def test_variable_steps_keep_the_order():
    """Steps that alternate by a factor of two, through the history of moments, leave BDF2 at order 2."""
    errors = []
    for steps in (40, 80, 160):
        past = exact_past("ODE", 1, 1.0)
        while past[-1].time < 1.0 - 1e-12:
            step = (2.0 if len(past) % 2 else 1.0) / (1.5 * steps)
            until = min(past[-1].time + step, 1.0)
            past += evolution(LOGISTIC, past[-3:], until, order=2, fixed_step=until - past[-1].time)[0]
        errors.append(abs(float(past[-1].x[0] - logistic(1.0)[0])))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert abs(slopes[-1] - 2.0) < 0.2, f"errors {errors}, observed orders {slopes}"


@pytest.mark.parametrize("name", SOLVABLE)
@pytest.mark.parametrize("order", ORDERS)
def test_error_control_meets_its_tolerance(name: str, order: int):
    """Both problems forget errors, so the error stays below the sum of local ones; and it falls with the tolerance."""
    problem, solution = SOLVABLE[name]
    errors, counts, tolerances = [], [], (1e-3, 1e-5, 1e-7)
    for tolerance in tolerances:
        moments, outcome = evolution(problem, exact_past(name, 1, 1.0), 2.0, order=order, tolerance=tolerance)
        assert outcome is Outcome.REACHED_END
        errors.append(max(float(np.abs(m.x[:2] - solution(m.time)[:2]).max()) for m in moments))
        counts.append(len(moments))
        assert errors[-1] < counts[-1] * tolerance, (
            f"error {errors[-1]:.1e} after {counts[-1]} steps at {tolerance:.0e}"
        )
    gain = np.log(errors[0] / errors[-1]) / np.log(tolerances[0] / tolerances[-1])
    expected = order / (order + 1)
    assert abs(gain - expected) < 0.2, (
        f"error ~ tolerance^{gain:.2f}, expected {expected:.2f}; {errors}, steps {counts}"
    )


def test_constraint_holds_at_every_step():
    """Stiffly accurate: algebraic equations are met to round-off, not to the tolerance."""
    moments, _ = evolution(CIRCLE, exact_past("index 2", 1, 1.0), 1.0, tolerance=1e-2)
    drift = max(abs(m.x[0] ** 2 + m.x[1] ** 2 - 1.0) for m in moments)
    assert drift < 1e-12, f"largest drift {drift:.1e} over {len(moments)} steps"


def test_steps_grow_as_the_solution_calms_down():
    """A fast decay ends: the steps follow the solution, not the stiffest rate."""
    problem = DenseProblem(lambda x, dq, p: dq - np.array([-1e4 * (x[0] - x[1]), -x[1]]))
    moments, outcome = evolution(problem, [Moment(0.0, problem, np.array([2.0, 1.0]))], 5.0, tolerance=1e-4)
    assert outcome is Outcome.REACHED_END
    assert len(moments) < 200, f"{len(moments)} steps"
    assert max(m.step for m in moments) > 100.0 / 1e4
    assert abs(moments[-1].x[1] - np.exp(-5.0)) < 1e-3


@pytest.mark.parametrize("until", [0.1, 0.37, 1.0])
@pytest.mark.parametrize("stepping", [{"fixed_step": 0.08}, {"tolerance": 1e-3}, {"tolerance": 1e-6, "order": 3}])
def test_lands_on_the_end(until: float, stepping: dict[str, float]):
    """The last moment is at `until` exactly, and no sliver of a step leads there."""
    moments, outcome = evolution(LOGISTIC, exact_past("ODE", 1, 1.0), until, **stepping)
    assert outcome is Outcome.REACHED_END
    assert abs(moments[-1].time - until) <= 1e-15
    if "tolerance" in stepping:
        assert moments[-1].step > 0.3 * moments[-2].step


def test_a_solution_that_ends_underflows():
    """y' = -1/(2y) ends at t = 1 with y = sqrt(1 - t) = 0: no step leads past it."""
    problem = DenseProblem(lambda x, dq, p: 2.0 * x * dq + 1.0, lambda x: x)
    moments, outcome = evolution(problem, [Moment(0.0, problem, np.ones(1))], 2.0, tolerance=1e-4)
    assert outcome is Outcome.STEP_UNDERFLOW
    assert moments[-1].time == pytest.approx(1.0, abs=1e-2)
    assert all(np.isfinite(m.x).all() for m in moments)


def test_a_blow_up_ends_in_a_named_outcome():
    """y' = y^2 reaches infinity at t = 1: steps shrink with the time left; nothing is ever NaN."""
    problem = DenseProblem(lambda x, dq, p: dq - x**2)
    moments, outcome = evolution(problem, [Moment(0.0, problem, np.ones(1))], 2.0, tolerance=1e-4, max_steps=3000)
    assert outcome in (Outcome.STEP_UNDERFLOW, Outcome.MAX_STEPS)
    assert all(np.isfinite(m.x).all() for m in moments)
    assert abs(moments[-1].time - 1.0) < 2e-2, f"{outcome} at {moments[-1].time:.6g}"


def test_an_undefined_state_underflows():
    """A residual that is NaN beyond some state cannot be entered, but for the tolerance of Newton; a fixed step that needs
    it ends the run."""
    problem = DenseProblem(lambda x, dq, p: dq - 1.0 + 0.0 * np.sqrt(0.5 - x))
    for stepping in ({"tolerance": 1e-4}, {"fixed_step": 0.03}):
        moments, outcome = evolution(problem, [Moment(0.0, problem, np.zeros(1))], 1.0, **stepping)
        assert outcome is Outcome.STEP_UNDERFLOW
        assert 0.4 < moments[-1].time <= 0.5 + TIGHT.tolerance


@dataclass(frozen=True)
class Reluctant(DenseProblem):
    """dx/dt = 1, whose Jacobian counts as singular for steps from x = 0 below `least`; it cannot be tried for ever."""

    least: float = 0.0

    def linearise(self, x: Array, p: Array, rate: Rate) -> tuple[Array, AbstractLinearisation]:
        assert self.calls[0] < 10_000, "it tries for ever"
        residual, linearisation = super().linearise(x, p, rate)
        singular = DenseLinearisation(np.zeros((1, 1)))
        too_short = rate.coefficient * self.least > 1.0 and rate.history[0] == 0.0
        return residual, singular if too_short else linearisation


@pytest.mark.parametrize("stepping", [{}, {"fixed_step": 0.01}, {"first_step": 0.3}])
def test_a_start_that_no_step_leaves_underflows(stepping: dict[str, float]):
    problem = Reluctant(lambda x, dq, p: dq - 1.0, calls=[0], least=np.inf)
    moments, outcome = evolution(problem, [Moment(0.0, problem, np.zeros(1))], 1.0, **stepping)
    assert (outcome, moments) == (Outcome.STEP_UNDERFLOW, [])


@pytest.mark.parametrize("until", [1e-4, 3e-3, 1.0])
def test_a_start_that_only_long_steps_leave(until: float):
    """The first step may be longer than asked, but never leads beyond the end."""
    problem = Reluctant(lambda x, dq, p: dq - 1.0, calls=[0], least=1e-3)
    moments, outcome = evolution(problem, [Moment(0.0, problem, np.zeros(1))], until, tolerance=1e-4)
    assert all(m.time <= until for m in moments), f"{[m.time for m in moments]} beyond {until}"
    assert outcome is (Outcome.REACHED_END if until > 1e-3 else Outcome.STEP_UNDERFLOW)


def test_max_steps():
    moments, outcome = evolution(LOGISTIC, exact_past("ODE", 1, 1.0), 1.0, fixed_step=0.01, max_steps=7)
    assert (outcome, len(moments)) == (Outcome.MAX_STEPS, 7)


def test_the_last_step_allowed_may_reach_the_end():
    moments, outcome = evolution(LOGISTIC, exact_past("ODE", 1, 1.0), 0.08, fixed_step=0.01, max_steps=8)
    assert (outcome, len(moments)) == (Outcome.REACHED_END, 8)


def test_nothing_to_do_at_the_end():
    moments, outcome = evolution(LOGISTIC, [Moment(1.0, LOGISTIC, logistic(1.0))], 1.0)
    assert (outcome, moments) == (Outcome.REACHED_END, [])


@pytest.mark.parametrize("rate", [1e-3, 1e-6])
def test_stationary_state_ends_the_run(rate: float):
    """|y'| <= rate, relative to y: y = 1 - 9 e^(-3t) nearly, so y' is about 27 e^(-3t)."""
    moments, outcome = evolution(LOGISTIC, exact_past("ODE", 1, 1.0), 1e3, tolerance=1e-5, stationary_rate=rate)
    assert outcome is Outcome.STATIONARY
    assert abs(moments[-1].x[0] - 1.0) < rate
    assert moments[-1].time > np.log(27.0 / rate) / 3.0 - 1.0


def test_an_event_ends_the_run_with_its_outcome():
    seen = []

    def event(moment: Moment) -> Outcome | None:
        seen.append(moment.time)
        return Outcome.NECK_CLOSED if moment.x[0] > 0.5 else None

    made = Evolution(exact_past("ODE", 1, 1.0), NO_PARAMETERS, 2.0, Stepping(), events=(event,))
    moments = list(made)
    assert made.outcome is Outcome.NECK_CLOSED
    assert seen == [m.time for m in moments]
    assert moments[-2].x[0] <= 0.5 < moments[-1].x[0]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("cut", [1, 2, 5, 17])
def test_resuming_from_the_last_moments_changes_nothing(order: int, cut: int):
    """Killed after `cut` steps and resumed from at most four moments: the same steps and the same end."""
    start = exact_past("index 2", 1, 1.0)
    whole, _ = evolution(CIRCLE, start, 1.0, order=order, tolerance=1e-5)
    past = [*start, *whole[:cut]][-4:]
    rest, outcome = evolution(CIRCLE, past, 1.0, order=order, tolerance=1e-5)
    assert outcome is Outcome.REACHED_END
    np.testing.assert_allclose([m.time for m in rest], [m.time for m in whole[cut:]], rtol=1e-9)
    miss = np.abs(rest[-1].x - whole[-1].x).max()
    assert miss < 1e-10, f"ends differ by {miss:.1e}"


def test_going_on_beyond_an_end_takes_the_step_up_again():
    """A stop at a given time shortens a step; the next one is not shorter for it."""
    first, _ = evolution(LOGISTIC, exact_past("ODE", 1, 1.0), 0.5, tolerance=1e-5)
    usual = max(m.step for m in first)
    second, outcome = evolution(LOGISTIC, first[-4:], 1.0, tolerance=1e-5)
    assert outcome is Outcome.REACHED_END
    assert second[0].step > 0.5 * usual, f"{second[0].step:.2e} after steps up to {usual:.2e}"
    assert abs(second[-1].x[0] - logistic(1.0)[0]) < 1e-3


@pytest.mark.parametrize("options", [{"order": 0}, {"order": 4}, {"fixed_step": -1.0}, {"tolerance": 0.0}])
def test_options_out_of_range_are_refused(options: dict[str, float]):
    with pytest.raises(ValueError, match=r"must be|and tolerance"):
        Stepping(**options)


@functools.cache
def division(order: int, steps: int = 0) -> dict[str, Array]:
    """r, psi and c of guided division at t = 0.02 at 101 values of u, by fixed steps, or else by very small ones."""
    engine = make_engine("guided-division")
    stepping = {"fixed_step": 0.02 / steps} if steps else {"tolerance": 1e-9}
    moments, outcome = march(engine, 0.02, newton=TIGHT, order=order, **stepping)
    assert outcome is Outcome.REACHED_END
    fields = fields_at(engine, moments[-1].x, np.linspace(0.0, 1.0, 101))
    return {name: fields[name] for name in ("r", "psi", "c")}


def surface_orders(order: int, counts: tuple[int, ...], reference: dict[str, Array]) -> dict[str, Array]:
    errors = {
        name: [np.abs(division(order, steps)[name] - values).max() for steps in counts]
        for name, values in reference.items()
    }
    return {name: np.array([np.log2(a / b) for a, b in pairwise(found)]) for name, found in errors.items()}


@pytest.mark.parametrize(("order", "counts"), [(1, (10, 20, 40)), (2, (20, 40, 80))])
def test_order_in_time_of_a_surface(order: int, counts: tuple[int, ...]):
    """While the ring of guided division builds up, against a run of third order at tolerance 1e-9."""
    orders = surface_orders(order, counts, division(3))
    assert all(abs(found[-1] - order) < 0.1 for found in orders.values()), f"order {order}: observed {orders}"


@pytest.mark.slow
@pytest.mark.parametrize(("order", "counts"), [(1, (80, 160)), (2, (80, 160))])
def test_order_in_time_of_a_surface_at_small_steps(order: int, counts: tuple[int, ...]):
    orders = surface_orders(order, counts, division(3))
    assert all(abs(found[-1] - order) < 0.1 for found in orders.values()), f"order {order}: observed {orders}"


def test_error_control_on_a_surface():
    """Adaptive steps on a mesh that stays: the error at t = 0.02 stays near the tolerance, and falls with it."""
    engine, reference = make_engine("guided-division"), division(3)
    errors, counts = [], []
    for tolerance in (1e-3, 1e-4, 1e-5):
        moments, outcome = march(engine, 0.02, tolerance=tolerance)
        assert outcome is Outcome.REACHED_END
        fields = fields_at(engine, moments[-1].x, np.linspace(0.0, 1.0, 101))
        errors.append(max(float(np.abs(fields[name] - values).max()) for name, values in reference.items()))
        counts.append(len(moments) - 1)
    message = f"errors {errors} in {counts} steps"
    assert all(error < 20.0 * tolerance for error, tolerance in zip(errors, (1e-3, 1e-4, 1e-5), strict=True)), message
    gain = np.log10(errors[0] / errors[-1]) / 2.0
    assert 0.45 < gain < 1.0, f"error ~ tolerance^{gain:.2f}: {message}"


def test_resuming_a_surface_changes_nothing():
    """Adaptive steps with a moving mesh, cut in the middle: the same end to round-off and Newton's tolerance."""
    engine = make_engine("guided-division", mesh_tolerance=1e-4)
    made = Evolution(march(engine, 1e-3)[0][-4:], engine.p, 0.02, Stepping())
    whole = list(made)
    cut = len(whole) // 2
    past = [replace(m, rate=None) for m in whole[cut - 4 : cut]]
    rest = list(Evolution(past, engine.p, 0.02, Stepping()))
    np.testing.assert_allclose([m.time for m in rest], [m.time for m in whole[cut:]], rtol=1e-6)
    miss = engine.problem.norm(rest[-1].x - whole[-1].x, whole[-1].x)
    assert miss < 1e-6, f"ends differ by {miss:.1e}"
