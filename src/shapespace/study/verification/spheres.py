"""The active sphere: pressure, energy, relaxation and oscillation, and where it polarizes."""

from collections.abc import Iterator

import numpy as np

from shapespace.numerics.gauss import gauss_rule
from shapespace.study.branching import branch
from shapespace.study.dataset import profile_of
from shapespace.study.engine import Engine
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.steady import Steady, steady
from shapespace.study.verification.closed_forms import (
    polar_onset,
    pressure,
    sphere_energy,
    sphere_rates,
    swimming_speed,
)
from shapespace.study.verification.record import Row
from shapespace.study.verification.states import Absent, found_state, special_point

FORM = "closed form"
OUYANG = "Ou-Yang & Helfrich 1987, closed form"
QUADRATURE = 8
"""Gauss points on each element."""


def resting(spontaneous_curvature: float = 2.0, tension: float = -0.5) -> Iterator[Row]:
    """Laplace's law with bending."""
    case = scenario("polar-swimmer", spontaneous_curvature=spontaneous_curvature, tension=tension, peclet=10.0)
    seen = found_state(steady(case, state="trivial")).observables
    values = Engine.of(case).values
    yield Row("pressure", seen["pressure"], pressure(values), FORM, 1e-8)
    curved = case.with_overrides({"spontaneous_curvature": 1.0})
    energy = found_state(steady(curved, state="trivial")).observables["bending_energy"]
    yield Row("bending energy", energy, sphere_energy(1.0, 1.0), FORM, 1e-8)


def passive() -> Iterator[Row]:
    """Shapes of a viscous sphere relax; fast diffusion puts the rates of the concentration out of sight."""
    case = scenario("polar-swimmer", peclet=0.0, tension=0.0, friction=0.0, diffusivity=1000.0, elements=60)
    yield from _rates(case, 8, range(2, 7))


def active() -> Iterator[Row]:
    """Shape and concentration coupled, with friction: of each l the larger rate."""
    case = scenario("polar-swimmer", peclet=15.0, tension=9.0, friction=2.25, diffusivity=20.0, elements=60)
    yield from _rates(case, 12, range(1, 7))


def oscillating() -> Iterator[Row]:
    """A complex pair of l = 2."""
    case = scenario("polar-swimmer", peclet=40.0, tension=-20.0, friction=20.0, elements=60)
    values = Engine.of(case).values
    exact = next(rate for l, rate in sphere_rates(values, 8) if l == 2 and rate.imag > 0.0)
    rates = found_state(steady(case, state="trivial")).rates(8).values
    growth, frequency = min(rates, key=lambda rate: abs(complex(*rate) - exact))
    yield Row("growth rate, l = 2", growth, exact.real, FORM, 1e-7)
    yield Row("frequency, l = 2", frequency, exact.imag, FORM, 1e-7)


def polarization() -> Iterator[Row]:
    """The sphere yields to l = 1 in a pitchfork."""
    case = scenario("polar-swimmer")
    found = branch(case, "peclet", 23.0, start=21.0, state="trivial", stability=False)
    fork = special_point(found, "pitchfork")
    yield Row("Pe* of the pitchfork, k = 9", fork.parameter, polar_onset(1.0, 9.0), FORM, 1e-9)
    case = scenario("polar-swimmer", saturation_concentration=10.0, turnover_rate=45.0)
    found = branch(case, "peclet", 2410.0, start=2390.0, state="trivial", stability=False)
    fork = special_point(found, "pitchfork")
    yield Row("Pe* of the pitchfork, c_s = 10 c0, k = 45", fork.parameter, polar_onset(10.0, 45.0), FORM, 1e-9)


def swimming() -> Iterator[Row]:
    """Just beyond its onset, and far from it.

    With c = c0 + dc cos(theta) the speed is -(R/2) (xi Delta mu)_0 f'(c0) dc/eta_b; what else there is goes with dc^2, and is
    removed by two states. The friction force along the axis, of the flow and the motion together, vanishes at any amplitude.
    """
    ratios, squares = [], []
    for peclet in (22.01, 22.04):
        state = found_state(steady(scenario("polar-swimmer", peclet=peclet)))
        values = Engine.of(state.scenario).values
        c = profile_of(state.scenario, state.frame)["concentration"]
        pattern = 0.5 * float(c[0] - c[-1])
        ratios.append(state.observables["velocity"] / swimming_speed(values, pattern))
        squares.append(pattern**2)
    at_onset = (squares[1] * ratios[0] - squares[0] * ratios[1]) / (squares[1] - squares[0])
    yield Row("speed over its law, as the pattern tends to zero", at_onset, 1.0, FORM, 1e-4)
    for peclet in (24.0, 100.0):
        state = found_state(steady(scenario("polar-swimmer", peclet=peclet)))
        yield Row(
            f"net friction force at Pe = {peclet:g}, of its parts", _net_friction(state), 0.0, "no external force", 1e-6
        )


def _net_friction(state: Steady) -> float:
    """The axial friction force int Gamma v_u e_u.e_z dA over int Gamma |v_u e_u.e_z| dA."""
    found = state.engine.problem.unpack(state.found.x)
    rule = gauss_rule(QUADRATURE)
    mesh = found.mesh
    u = (mesh[:-1, None] + np.diff(mesh)[:, None] * rule.points).ravel()
    weights = (np.diff(mesh)[:, None] * rule.weights).ravel()
    fields = dict(zip(state.engine.system.fields, found.values(u).T, strict=True))
    force = -fields["v"] * np.sin(fields["psi"]) * fields["r"]
    return float(weights @ force / (weights @ np.abs(force)))


def squeezed() -> Iterator[Row]:
    """A passive sphere under excess pressure from outside yields to l where the tension is -l (l + 1) kappa/R^2."""
    case = scenario("polar-swimmer", peclet=0.0)
    found = branch(case, "tension", -21.0, start=-5.0, state="trivial", stability=False)
    points = [point for point in found.special_points if point.kind in ("pitchfork", "transcritical")]
    kinds = [point.kind for point in points]
    if kinds != ["transcritical", "pitchfork", "transcritical"]:
        raise Absent(f"found {', '.join(kinds) or 'no branch point'}; the branch ended so: {found.outcome}.")
    for l, point in enumerate(points, start=2):
        pressure_outside = -point.observables["pressure"]
        yield Row(f"outer pressure at the {point.kind} of l = {l}", pressure_outside, 2.0 * l * (l + 1), OUYANG, 1e-8)


def hopf() -> Iterator[Row]:
    """Where the trace of l = 2 vanishes: -(s/4)(1 + g) + Pe/2 - 6 - k = 0 with s = 4 (gamma + 26), g = 1/4."""
    case = scenario("polar-swimmer", elements=20, peclet=40.0, friction=20.0)
    point = special_point(branch(case, "tension", -23.0, start=-21.0, state="trivial"), "hopf")
    yield Row("tension at which oscillations set in", point.parameter, -22.0, FORM, 1e-6)


def _rates(case: Scenario, count: int, degrees: range) -> Iterator[Row]:
    """The largest rate of each l. Found and exact rates are paired by their order, so that none may be missing between them."""
    found = found_state(steady(case, state="trivial")).rates(count).values
    exact = sphere_rates(Engine.of(case).values, 40)
    for l in degrees:
        place = next(i for i, (degree, _) in enumerate(exact) if degree == l)
        yield Row(f"growth rate, l = {l}", found[place][0], exact[place][1].real, FORM, 1e-7)
