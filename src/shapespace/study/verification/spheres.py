"""The active sphere: pressure, energy, relaxation and oscillation, and where it polarizes."""

from collections.abc import Iterator

from shapespace.study.branching import branch
from shapespace.study.engine import Engine
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.steady import steady
from shapespace.study.verification.closed_forms import (
    polar_onset,
    pressure,
    sphere_energy,
    sphere_rates,
)
from shapespace.study.verification.record import Row
from shapespace.study.verification.states import found_state, special_point

FORM = "closed form"


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
