"""The dataset of a short run: fields that agree with each other and with the observables, from the first frame on."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.dataset import make_dataset, open_dataset
from shapespace.study.observables import FLOWS
from shapespace.study.run import Run, run
from shapespace.study.scenario import scenario
from shapespace.study.store import RunStore

NAMES = ("guided-division", "polar-swimmer", "membrane-protrusion", "vesicle")
# A rate of change needs two states, and the flow of the flat disc has no limit at t = 0.
UNKNOWN_AT_START = {key: {"energy_residual", "boundary_residual"} for key in NAMES}
UNKNOWN_AT_START["membrane-protrusion"] |= {*FLOWS}
FLOW = ("tangential_velocity", "normal_velocity")


@cache
def short_run(name: str) -> Run:
    return run(scenario(name, elements=20, until=0.02, mesh_tolerance=1e-3))


@cache
def dataset_of(name: str) -> xr.Dataset:
    return short_run(name).dataset


@pytest.mark.parametrize("name", NAMES)
def test_everything_is_finite_and_says_what_it_is(name: str):
    data = dataset_of(name)
    for key, variable in data.variables.items():
        quantity = QUANTITIES[str(key)]
        assert (variable.attrs["symbol"], variable.attrs["long_name"]) == (quantity.symbol, quantity.meaning)
        assert variable.attrs["units"]
        if key != "neck_radius":
            assert np.isfinite(variable.values[1 if key in UNKNOWN_AT_START[name] else 0 :]).all(), key
    assert (data.attrs["scenario"], data.attrs["outcome"]) == (name, "reached-end")
    assert json.loads(data.attrs["parameters"])["until"] == 0.02


@pytest.mark.parametrize("name", NAMES)
def test_fields_agree_with_each_other(name: str):
    """r' = h cos psi and z' = -h sin psi, curvatures by differences, all to the accuracy of differences."""
    data = dataset_of(name).isel(time=-1)
    u, r, z, psi = (data[key].values for key in ("mesh_coordinate", "radius", "axial_position", "tangent_angle"))
    h = float(data["length"])
    assert (u[0], u[-1]) == (0.0, 1.0)
    np.testing.assert_allclose(np.gradient(r, u, edge_order=2), h * np.cos(psi), atol=1e-3 * h)
    np.testing.assert_allclose(np.gradient(z, u, edge_order=2), -h * np.sin(psi), atol=1e-3 * h)
    inner = slice(1, -1)
    curvature = np.abs(data["meridional_curvature"].values).max()
    slope = np.gradient(psi, u)[inner]
    np.testing.assert_allclose(slope / h, data["meridional_curvature"].values[inner], atol=1e-2 * curvature)
    np.testing.assert_allclose(np.sin(psi[inner]) / r[inner], data["azimuthal_curvature"].values[inner], rtol=1e-9)
    area = 2.0 * np.pi * np.trapezoid(r * h, u)
    assert float(data["area"]) == pytest.approx(area, rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_surface_moves_at_its_normal_velocity(name: str):
    """Between two frames, in the lab frame: (dr, dz) . n = v_n dt at the same u, to the first order of the step."""
    data = dataset_of(name)
    before, after = data.isel(time=-2), data.isel(time=-1)
    assert np.array_equal(before["mesh_coordinate"], after["mesh_coordinate"])
    step = float(after["time"] - before["time"])
    dr, dz = (after[key].values - before[key].values for key in ("radius", "axial_position"))
    psi = after["tangent_angle"].values
    normal = (dr * np.sin(psi) + dz * np.cos(psi)) / step
    velocity = after["normal_velocity"].values
    np.testing.assert_allclose(normal, velocity, atol=0.1 * np.abs(velocity).max())


@pytest.mark.parametrize("name", NAMES[:2])
def test_initial_frame_flows_as_the_first_step_says(name: str):
    frames, data = short_run(name).frames, dataset_of(name)
    assert not frames[0].rates.any(), "the initial state is given, not solved for"
    for key in (*FLOW, "pressure", "dissipation", "chemical_power"):
        np.testing.assert_array_equal(data[key].values[0], data[key].values[1])
    assert np.abs(data["normal_velocity"].values[0]).max() > 0.0
    if name == "polar-swimmer":
        # The step is tiny: the flow is that of the force balance at t = 0, as the next step confirms. (A resting sphere
        # with uniform regulator, as in guided division, flows not at all at t = 0.)
        flow = data["normal_velocity"].values
        assert np.abs(flow[2] - flow[0]).max() < 1e-3 * np.abs(flow[0]).max()


def test_flat_disc_starts_at_rest():
    """It buckles as the root of time, so that its flow has no limit at t = 0."""
    data = dataset_of("membrane-protrusion")
    assert not any(data[key].values[0].any() for key in FLOW)
    assert data["normal_velocity"].values[1].max() > 1.0


def test_frame_alone_has_no_flow():
    result = short_run("guided-division")
    data = make_dataset(result.scenario, result.frames[:1], Outcome.MAX_STEPS)
    assert all(np.isnan(data[key].values).all() for key in FLOW)
    assert not {"velocity", "pressure", "dissipation"} & set(data.variables)
    assert np.isfinite(data["radius"].values).all()


def test_store_without_a_frame_says_so(tmp_path: Path):
    RunStore.create(tmp_path / "run", scenario("guided-division")).close()
    with pytest.raises(StoreError, match="no time step yet; continue the run with --resume"):
        open_dataset(tmp_path / "run")
