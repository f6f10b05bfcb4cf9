"""Stationary states of scenarios: they solve the equations, obey exact laws, and are where the dynamics ends."""

import numpy as np
import pytest

from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.newton import solve_root
from shapespace.study.engine import state_of
from shapespace.study.paths import NEWTON, StateName
from shapespace.study.run import run
from shapespace.study.scenario import scenario
from shapespace.study.settling import key_values, settle
from shapespace.study.steady import Steady, steady


def assert_solved(found: Steady) -> None:
    """Converged, on a settled mesh, and found again in at most two iterations from its own frame."""
    assert found.outcome is Outcome.CONVERGED
    assert found.found.settled
    again = settle(found.scenario, state_of(found.frame), found.problem.keys)
    problem = again.problem
    p = key_values(found.scenario, found.problem.keys)
    x = problem.base.pack(state_of(found.frame))
    root = solve_root(problem, x, p, REST, NEWTON)
    assert root.outcome is Outcome.CONVERGED
    assert root.iterations <= 2


def test_the_resting_sphere():
    """`--state trivial`: p = 2 T/R (exact result 1 at C0 = 0), at rest and round."""
    case = scenario("polar-swimmer", elements=20)
    found = steady(case, state=StateName.TRIVIAL)
    assert_solved(found)
    tension = case.parameters.tension + case.parameters.active_tension / 2.0
    assert found.observables["pressure"] == pytest.approx(2.0 * tension, rel=1e-9)
    assert abs(found.observables["velocity"]) < 1e-9
    assert abs(found.observables["polarity"]) < 1e-9


def test_the_swimmer_just_beyond_its_pitchfork():
    """U = -(R/2) (xi dmu)_0 f'(c0) dc/eta_b for c = c0 + dc cos(theta) (exact result 4), to second order in dc."""
    misses, sizes = [], []
    for peclet in (22.04, 22.01):
        found = steady(scenario("polar-swimmer", elements=20, peclet=peclet))
        assert_solved(found)
        state = state_of(found.frame)
        column = found.engine.system.fields.index("c")
        top, bottom = state.nodes[0, column], state.nodes[-1, column]
        amplitude = 0.5 * (top - bottom)
        law = -0.5 * peclet * 0.5 * amplitude
        misses.append(abs(found.observables["velocity"] / law - 1.0))
        sizes.append(abs(amplitude))
    assert misses[0] < 0.02
    order = np.log(misses[0] / misses[1]) / np.log(sizes[0] / sizes[1])
    assert abs(order - 2.0) < 0.2, f"misses {misses} at amplitudes {sizes}"


def test_below_the_pitchfork_there_is_no_swimmer():
    """The search says so, with the parameters it got to, and does not pass off the sphere as a swimmer."""
    found = steady(scenario("polar-swimmer", elements=20, peclet=15.0))
    assert found.outcome is Outcome.NO_STATE


def test_conserved_regulator_is_refused():
    with pytest.raises(InputError, match="turnover_rate = 0"):
        steady(scenario("polar-swimmer", turnover_rate=0.0))


def test_the_flat_disc_and_the_protrusion():
    """Without coat and pull the disc is flat; the protrusion is where the dynamics of the same scenario ends."""
    case = scenario("membrane-protrusion", elements=20, spontaneous_curvature=4.0)
    flat = steady(case.with_overrides({"spontaneous_curvature": 0.0}), state=StateName.TRIVIAL)
    assert_solved(flat)
    assert abs(flat.observables["height"]) < 1e-12
    found = steady(case)
    assert_solved(found)
    end = run(case.with_overrides({"time_tolerance": 1e-5}))
    assert end.outcome is Outcome.STATIONARY
    assert found.observables["height"] == pytest.approx(end.observables["height"], rel=1e-4)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("membrane-protrusion", {"spontaneous_curvature": 9.0}),
        ("membrane-protrusion", {"spontaneous_curvature": 0.0, "pulling_force": 1.0}),
        ("guided-division", {}),
    ],
)
def test_no_state_is_called_trivial_that_is_none(name: str, keys: dict[str, float]):
    """With a coat, a pull or a ring the sphere and the disc do not rest."""
    found = steady(scenario(name, elements=20, **keys), state=StateName.TRIVIAL)
    assert found.outcome is Outcome.NO_STATE
    assert "rests only with" in found.nearest


@pytest.mark.parametrize("friction", [1e-2, 1e-4, 1e-6])
def test_the_swimmer_where_friction_hardly_tells_a_translation(friction: float):
    """Pe* = 22 whatever the friction, though a translation is nearly neutral all along; the speed tends to a limit."""
    found = steady(scenario("polar-swimmer", elements=20, friction=friction))
    assert_solved(found)
    assert found.observables["velocity"] == pytest.approx(-15.68918 - 0.48 * friction, abs=1e-3)


def test_at_the_pitchfork_itself_there_is_no_swimmer():
    case = scenario("polar-swimmer", elements=20, peclet=22.0)
    assert steady(case).outcome is Outcome.NO_STATE
    assert "comes to no swimmer at 22" in steady(case).nearest
    assert steady(case, state=StateName.TRIVIAL).outcome is Outcome.CONVERGED


def test_a_surface_that_may_rotate_at_any_rate_is_refused():
    with pytest.raises(InputError, match="friction = 0"):
        steady(scenario("polar-swimmer", friction=0.0, azimuthal_flow=True))


@pytest.mark.slow
def test_the_divided_surface_is_where_division_ends():
    """Through two folds in the ring's amplitude to the neck that the dynamics ends in, symmetric and at rest."""
    found = steady(scenario("guided-division"))
    assert_solved(found)
    end = run(scenario("guided-division"))
    assert found.observables["neck_radius"] == pytest.approx(end.observables["neck_radius"], rel=1e-6)
    assert abs(found.observables["velocity"]) < 1e-9


def test_every_solution_carries_its_errors():
    """The estimated error of the discretisation below what was aimed at, and conditions that hold to round-off."""
    case = scenario("polar-swimmer", elements=20, max_steps=3)
    data = run(case).dataset
    assert np.isnan(data.boundary_residual[0])  # the initial state is given, not solved for
    for errors in (data.isel(time=slice(1, None)), steady(case).observables):
        assert (np.asarray(errors["discretisation_error"]) > 0.0).all()
        assert (np.asarray(errors["discretisation_error"]) <= case.numerics.mesh_tolerance).all()
        assert (np.asarray(errors["boundary_residual"]) < 1e-9).all()
