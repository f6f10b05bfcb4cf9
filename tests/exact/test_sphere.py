"""The sphere: its pressure, and how fast small perturbations of shape and concentration grow or decay."""

from collections.abc import Mapping

import numpy as np
import pytest
from tests.exact.near_sphere import modes, perturbed_sphere
from tests.surfaces import make_engine, march, resting

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.numerics.newton import Newton, solve_root
from shapespace.numerics.state import State
from shapespace.study.engine import Engine
from shapespace.study.run import run
from shapespace.study.scenario import scenario
from shapespace.study.verification.closed_forms import polar_rate, pressure, rate_matrix

DEGREES = (1, 2, 3, 4)
AMPLITUDE = 1e-4
SHAPE = {2: 1.0, 3: -1.0, 4: 0.7}
CONCENTRATION = {1: 1.0, 2: 0.5, 3: 1.0, 4: -1.0}
PASSIVE = {"active_tension": 0.0, "tension": 0.0, "friction": 0.0}


def sphere(**overrides: object) -> Engine:
    """The polar swimmer's surface at rest, without its seed."""
    return make_engine("polar-swimmer", seed_amplitude=0.0, **overrides)


def off(engine: Engine, amplitude: float) -> State:
    """A sphere with all modes perturbed."""
    scaled = [{l: amplitude * a for l, a in part.items()} for part in (SHAPE, CONCENTRATION)]
    return perturbed_sphere(engine, *scaled)


def amplitudes_over_time(engine: Engine, steps: int, step: float, order: int) -> Array:
    """Amplitudes (steps + 1, degrees, 2) over time, half the difference of two runs with opposite perturbations.

    The difference drops what both share: effects of second order, and the discretisation error of the sphere itself.
    """
    both = []
    for amplitude in (AMPLITUDE, -AMPLITUDE):
        moments, outcome = march(
            engine, steps * step, state=off(engine, amplitude), newton=Newton(1e-11), order=order, fixed_step=step
        )
        assert outcome is Outcome.REACHED_END
        both.append(np.array([modes(engine, moment.x, DEGREES) for moment in moments]))
    return 0.5 * (both[0] - both[1])


@pytest.mark.parametrize(
    ("spontaneous_curvature", "tension", "active_tension"),
    [(0.0, 9.0, 0.0), (1.5, 2.0, 0.0), (-1.0, 5.0, 30.0), (2.0, -0.5, 0.0), (3.0, 4.0, -10.0)],
)
def test_pressure_of_the_stationary_sphere(spontaneous_curvature: float, tension: float, active_tension: float):
    """Newton finds the sphere from a state 1 % off in every unknown, and on it p = 2 T/R + kappa C0 (C0 R - 2)/R^2."""
    engine = sphere(spontaneous_curvature=spontaneous_curvature, tension=tension, active_tension=active_tension)
    x = engine.problem.pack(engine.initial_state())
    root = solve_root(engine.problem, 1.01 * x, engine.p, resting(engine, x), Newton(1e-11, max_iterations=40))
    assert root.outcome is Outcome.CONVERGED, root
    found, exact = engine.problem.unpack(root.x).scalars, pressure(engine.values)
    assert abs(found[1] - exact) < 1e-9, f"p - exact = {found[1] - exact:.2e} at p = {exact:.6g}"
    assert abs(found[0] - np.pi) < 1e-9, f"h - pi = {found[0] - np.pi:.2e}"


def test_pressure_in_the_units_of_the_user():
    """A run in other units (R0 = 1.3, kappa = 2.5, eta = 0.7) that starts on the sphere stays there, at that pressure."""
    constants = {
        "sphere_radius": 1.3, "bending_rigidity": 2.5, "bulk_viscosity": 0.7, "spontaneous_curvature": 1.7,
        "tension": 6.0, "active_tension": 3.0, "reference_concentration": 2.0, "saturation_concentration": 3.0,
    }  # fmt: skip
    case = scenario("polar-swimmer", elements=20, seed_amplitude=0.0, until=1e-3, **constants)
    result = run(case)
    exact = pressure(case.values())
    found = result.observables["pressure"]
    assert abs(found / exact - 1.0) < 1e-9, f"{result.outcome}: p = {found:.12g}, exact {exact:.12g}"


@pytest.mark.parametrize("tension", [0.0, 9.0])
def test_passive_relaxation_rates(tension: float):
    """Decay of shapes on a passive sphere by second-order time steps; -15, -66, -190 without tension and friction."""
    engine = sphere(**{**PASSIVE, "tension": tension, "friction": 0.01 * tension})
    step, steps = 1e-4, 24
    over_time = amplitudes_over_time(engine, steps, step, order=2)[:, 1:, 0]
    half = steps // 2
    found = np.log(over_time[-1] / over_time[half]) / (step * (steps - half))
    exact = np.array([rate_matrix(l, engine.values)[0, 0] for l in DEGREES[1:]])
    known = [-15.0, -66.0, -190.0] if tension == 0.0 else [-37.00489, -114.93806, -274.77861]
    np.testing.assert_allclose(exact, known, rtol=1e-7)
    error = np.abs(found / exact - 1.0).max()
    assert error < 1e-3, f"largest relative error {error:.2e}: found {found}, exact {exact}"


CASES = {
    "passive": PASSIVE,
    "under tension": {"active_tension": 0.0, "tension": 9.0, "friction": 0.09},
    "active and stable": {"tension": 9.0, "peclet": 15.0, "friction": 0.09},
    "swimming": {"tension": 9.0, "peclet": 30.0, "friction": 0.09},
    "unstable up to l = 2": {"tension": 2.0, "peclet": 60.0, "friction": 2.25, "turnover_rate": 2.0, "shear_viscosity": 2.0},
    "contracting in other ratios": {
        "tension": 1.0, "active_tension": 20.0, "friction": 0.5, "bulk_viscosity": 1.0, "saturation_concentration": 3.0,
        "diffusivity": 0.3, "turnover_rate": 0.0,
    },
}  # fmt: skip


def growth_matrices(over_time: Array, step: float) -> tuple[float, dict[int, Array]]:
    """The rate of l = 1 and the 2x2 matrices of l >= 2 behind a run of backward Euler steps.

    A step solves y_n = (1 - step M) y_{n+1} with the same M: no error of time discretisation is left in M.
    """
    polar = over_time[:, 0, 1]
    rate = float(np.mean(1.0 - polar[:-1] / polar[1:]) / step)
    matrices = {}
    for i, l in enumerate(DEGREES[1:], start=1):
        y = over_time[:, i]
        weights = 1.0 / np.linalg.norm(y[1:], axis=1)[:, None]
        back = np.linalg.lstsq(y[1:] * weights, y[:-1] * weights, rcond=None)[0].T
        matrices[l] = (np.eye(2) - back) / step
    return rate, matrices


def report(found: Array, exact: Array) -> str:
    return f"\nfound {found.ravel()}\nexact {exact.ravel()}"


@pytest.mark.parametrize("case", CASES)
def test_growth_rates(case: str):
    """All of l = 1..4 at once: the matrix to 1e-3 of its norm, its eigenvalues to 1e-3 of themselves."""
    engine = sphere(**CASES[case])
    step = 4e-3
    rate, matrices = growth_matrices(amplitudes_over_time(engine, 10, step, order=1), step)
    exact_rate = polar_rate(engine.values)
    assert abs(rate - exact_rate) < 1e-3 * abs(exact_rate), f"l = 1: {rate:.8g}, exact {exact_rate:.8g}"
    for l, found in matrices.items():
        exact = rate_matrix(l, engine.values)
        size = np.abs(exact).max()
        assert np.abs(found - exact).max() < 1e-3 * size, f"l = {l}" + report(found, exact)
        eigenvalues, exact_eigenvalues = (np.sort_complex(np.linalg.eigvals(m)) for m in (found, exact))
        # A double eigenvalue (passive, l = 2) splits like the square root of a perturbation: the trace says all.
        if abs(exact_eigenvalues[0] - exact_eigenvalues[1]) < 1e-6 * size:
            eigenvalues, exact_eigenvalues = eigenvalues.sum(), exact_eigenvalues.sum()
        error = np.abs(eigenvalues / exact_eigenvalues - 1.0).max()
        assert error < 1e-3, f"l = {l}: relative error {error:.1e}" + report(eigenvalues, exact_eigenvalues)


def onset(v: Mapping[str, float]) -> float:
    """The Peclet number at which l = 1 starts to grow, (2 + k R^2/D)/(c0 f'(c0))."""
    c0, c_s = v["reference_concentration"], v["saturation_concentration"]
    slope = 2.0 * c0 * c_s**2 / (c0**2 + c_s**2) ** 2
    return (2.0 + v["turnover_rate"] * v["sphere_radius"] ** 2 / v["diffusivity"]) / (c0 * slope)


@pytest.mark.parametrize(
    ("constants", "critical"), [({}, 22.0), ({"saturation_concentration": 10.0, "turnover_rate": 45.0}, 2397.235)]
)
def test_swimming_starts_at_the_critical_peclet_number(constants: dict[str, float], critical: float):
    """Below the onset a polar perturbation decays, above it grows, at a rate linear in Pe - Pe*."""
    rates = []
    for factor in (0.95, 1.05):
        engine = sphere(**constants, peclet=factor * critical, tension=20.0)
        assert abs(onset(engine.values) - critical) < 1e-3
        rates.append(growth_matrices(amplitudes_over_time(engine, 4, 1e-3, order=1), 1e-3)[0])
    found = critical * (0.95 - 0.1 * rates[0] / (rates[1] - rates[0]))
    assert rates[0] < 0.0 < rates[1], f"rates {rates}"
    assert abs(found / critical - 1.0) < 1e-3, f"Pe* = {found:.7g}, exact {critical:.7g}"


def test_swimming_speed_at_onset():
    """U = -(R/2) z delta_c/eta_b for c = c0 + delta_c cos(theta), whatever friction and tension."""
    engine = sphere(peclet=25.0, friction=1.7)
    speeds = []
    for amplitude in (AMPLITUDE, -AMPLITUDE):
        moments, _ = march(engine, 1e-3, state=perturbed_sphere(engine, {}, {1: amplitude}), order=1, fixed_step=1e-3)
        polar = modes(engine, moments[-1].x, (1,))[0, 1]
        speeds.append(engine.problem.unpack(moments[-1].x).scalars[2] / polar)
    found, exact = float(np.mean(speeds)), -0.5 * 25.0 * 0.5 / engine.values["bulk_viscosity"]
    assert abs(found / exact - 1.0) < 1e-4, f"U/delta_c = {found:.8g}, exact {exact:.8g}"
