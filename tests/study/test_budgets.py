"""The budgets of runs and stationary states: channels, supplies, the rest of the energy law, amounts of the species."""

import functools
from pathlib import Path

import numpy as np
import pytest

from shapespace.base.errors import InputError
from shapespace.cli import main
from shapespace.study.observables import DISSIPATIONS, FLOWS
from shapespace.study.run import Run, run, store_frame
from shapespace.study.scenario import scenario
from shapespace.study.steady import steady
from shapespace.view.budget import plot_budget

CASES = {
    "guided-division": {"seed_amplitude": 0.1, "until": 0.03},
    "membrane-protrusion": {"pulling_force": 20.0, "until": 0.01},
    "vesicle": {"until": 2e-3},
}
CHANNELS = {
    "guided-division": {"shear_dissipation", "bulk_dissipation", "friction_dissipation"},
    "membrane-protrusion": {"shear_dissipation", "friction_dissipation"},
    "vesicle": {"shear_dissipation", "bulk_dissipation", "friction_dissipation"},
}


@functools.cache
def short_run(name: str) -> Run:
    return run(scenario(name, elements=20, time_tolerance=1e-5, **CASES[name]))


@pytest.mark.parametrize("name", CASES)
def test_the_energy_law_is_the_sum_of_the_stored_powers(name: str):
    data = short_run(name).dataset.isel(time=slice(1, None))
    found = {channel for channel in DISSIPATIONS if channel in data}
    assert found == CHANNELS[name]
    assert all((data[channel] >= 0.0).all() for channel in found), "the second law"
    np.testing.assert_allclose(data["dissipation"], sum(data[channel] for channel in found), rtol=1e-14)
    np.testing.assert_allclose(data["external_power"], data["force_power"] + data["boundary_power"], rtol=1e-14)
    supply = data["external_power"] + data.get("chemical_power", 0.0)
    rest = data["energy_rate"] + data["dissipation"] - supply
    np.testing.assert_allclose(data["energy_residual"], rest, atol=1e-9 * float(data["dissipation"].max()))
    # The flat disc buckles like the root of time: its first steps cannot close the law.
    late = data.isel(time=slice(len(data["time"]) // 2, None))
    assert float(np.abs(late["energy_residual"] / late["dissipation"]).max()) < 1e-2


def test_the_amount_of_the_species_changes_by_its_supply():
    """To the order of the trapezoidal rule over the steps."""
    data = short_run("guided-division").dataset.isel(time=slice(1, None))
    change = float(data["amount"][-1] - data["amount"][0])
    given = float(np.trapezoid(data["amount_supply"], data["time"]))
    assert given == pytest.approx(change, rel=1e-3)
    assert change > 0.1, "nothing is supplied: nothing is tested"


def test_work_of_the_reservoir_and_of_the_pull():
    """The rim at rest draws area against the tension there: -(gamma0 + eta_s dA/dt/(pi R_b^2)) dA/dt; the pull lifts."""
    data = short_run("membrane-protrusion").dataset.isel(time=slice(1, None))
    v = short_run("membrane-protrusion").scenario.values()
    radius, inflow = v["base_radius"], -data["tangential_velocity"].values[:, -1]
    growth = 2.0 * np.pi * radius * inflow
    tension = v["boundary_tension"] + v["shear_viscosity"] * growth / (np.pi * radius**2)
    np.testing.assert_allclose(data["boundary_power"], -tension * growth, rtol=1e-8)
    assert float(data["area"][-1] - data["area"][0]) == pytest.approx(np.trapezoid(growth, data["time"]), rel=1e-2)
    assert (data["force_power"] > 0.0).all()


def test_budget_of_a_swimmer_at_rest(tmp_path: Path):
    """A stationary state dissipates what the reaction supplies; its energy and its regulator stay."""
    state = steady(scenario("polar-swimmer", peclet=24))
    values = state.observables
    assert state.outcome.is_success
    assert values["velocity"] != 0.0
    assert values["energy_rate"] == 0.0
    assert {name for name in values if name in FLOWS} >= CHANNELS["guided-division"]
    assert values["dissipation"] > 0.0
    assert abs(values["energy_residual"]) < 1e-7 * values["dissipation"]
    assert abs(values["amount_supply"]) < 1e-8 * values["amount"]
    store_frame(tmp_path / "state", state.scenario, state.frame, state.outcome)
    assert main(["plot", str(tmp_path / "state"), "--budget"]) == 0
    assert (tmp_path / "state" / "budget.png").stat().st_size > 1000
    assert main(["plot", str(tmp_path / "state"), "--budget", "--mode", "0"]) == 2


@pytest.mark.parametrize("name", CASES)
def test_figure_draws_every_power_that_moves(name: str):
    data = short_run(name).dataset
    figure = plot_budget(data)
    texts = {text.get_text() for text in figure.axes[1].get_legend().get_texts()}
    assert {"dF/dt", "shear"} <= texts
    assert ("activity" in texts) == ("chemical_power" in data)
    assert len(figure.axes) == (4 if "amount" in data else 3)
    with pytest.raises(InputError, match="are not stored"):
        plot_budget(data.drop_vars("dissipation"))
