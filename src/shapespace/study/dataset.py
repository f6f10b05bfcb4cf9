"""A run as a self-describing xarray Dataset: fields along the curve and observables over time, in the scenario's units."""

import json
from collections.abc import Iterable
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import xarray as xr

from shapespace.base.arrays import Array
from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.models.open_membrane import local_spontaneous_curvature
from shapespace.numerics.state import State
from shapespace.study.engine import Engine, even_points, state_of
from shapespace.study.frame import Frame
from shapespace.study.manifests import CONVENTIONS
from shapespace.study.observables import FLOWS
from shapespace.study.scenario import Scenario
from shapespace.study.store import RunStore

POINTS = 241
_FLOW_FIELDS = ("tangential_velocity", "normal_velocity", "azimuthal_velocity")


def make_dataset(scenario: Scenario, frames: Iterable[Frame], outcome: Outcome | None) -> xr.Dataset:
    """Fields (time, point) on points that follow each frame's mesh, observables (time); NaN where one does not apply."""
    engine, frames = Engine.of(scenario), list(frames)
    scales = scenario.scales
    times = np.array([frame.time for frame in frames])
    fields = [_fields(engine, frame) for frame in frames]
    series = [frame.observables for frame in frames]
    # A run's first state is given, a stationary one that was stored is solved for.
    if frames[0].step == 0.0 and "dissipation" not in series[0] and "p" in engine.system.scalars:
        fields[0], series[0] = _set_in_motion(fields, series, _flow_observables(engine))
    if "velocity" in series[-1]:
        travelled = _travelled(times, np.array([values.get("velocity", 0.0) for values in series]))
        travelled = travelled / scales.factor("length")
        for column, shift in zip(fields, travelled, strict=True):
            column["axial_position"] = column["axial_position"] + shift
    data = {
        name: (("time", "point"), np.stack([column[name] for column in fields]) * scales.factor(name))
        for name in fields[0]
    }
    names = dict.fromkeys(name for values in series for name in values)
    observables = {name: ("time", np.array([values.get(name, np.nan) for values in series])) for name in names}
    dataset = xr.Dataset({**data, **observables}, coords={"time": times})
    for name, variable in dataset.variables.items():
        quantity = QUANTITIES[str(name)]
        variable.attrs |= {"long_name": quantity.meaning, "symbol": quantity.symbol, "units": scales.unit(str(name))}
    dataset.attrs |= {
        "scenario": scenario.name,
        "model": scenario.model,
        "kind": scenario.kind,
        "outcome": str(outcome) if outcome else "unfinished",
        "parameters": json.dumps(scenario.values()),
        "conventions": CONVENTIONS,
    }
    return dataset


def profile_of(scenario: Scenario, frame: Frame) -> dict[str, Array]:
    """The fields (point,) of one frame along its curve, by name, in the scenario's units."""
    fields = _fields(Engine.of(scenario), frame)
    return {name: values * scenario.scales.factor(name) for name, values in fields.items()}


def meridian_of(scenario: Scenario, frame: Frame) -> tuple[Array, Array]:
    """Radius and axial position (point,) of one frame."""
    profile = profile_of(scenario, frame)
    return profile["radius"], profile["axial_position"]


def open_dataset(path: str | Path) -> xr.Dataset:
    """The dataset of a stored run, finished or not. StoreError where there is none, or nothing in it yet."""
    store = RunStore.open(path)
    if not len(store):
        raise StoreError(f"{path}: holds no time step yet; continue the run with --resume.")
    dataset = make_dataset(store.scenario, (store.read(i) for i in range(len(store))), store.outcome)
    dataset.attrs |= {"created": store.created, "shapespace_version": store.versions["shapespace"]}
    return dataset


def _set_in_motion(
    fields: list[dict[str, Array]], series: list[dict[str, float]], solved_for: tuple[str, ...]
) -> tuple[dict[str, Array], dict[str, float]]:
    """Fields and observables of the initial frame with what its force balance gives: to the length of the first step,
    the values after it. Where no step was taken they are not known, NaN and absent.
    """
    later, after = fields[1:2], series[1:2]
    u = fields[0]["mesh_coordinate"]
    flow = {
        name: np.interp(u, later[0]["mesh_coordinate"], later[0][name]) if later else np.full_like(u, np.nan)
        for name in _FLOW_FIELDS
        if name in fields[0]
    }
    given = {name: value for name, value in series[0].items() if name not in solved_for}
    solved = {name: after[0][name] for name in solved_for if after and name in after[0]}
    return fields[0] | flow, given | solved


def _flow_observables(engine: Engine) -> tuple[str, ...]:
    """Those that belong to the motion, not to the shape: a tension too where it holds the area."""
    return ("velocity", "pressure", *FLOWS, *(("tension", "tension_pole") if "sigma" in engine.system.scalars else ()))


def _travelled(times: Array, speeds: Array) -> Array:
    """Distance (frames,) that the comoving frame has swum, by the trapezoidal rule over the steps."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times))])


def _fields(engine: Engine, frame: Frame) -> dict[str, Array]:
    """Dimensionless fields (point,) of one frame, sampled evenly over its elements."""
    system = engine.system
    state = state_of(frame)
    u = even_points(frame.mesh, POINTS)
    y = dict(zip(system.fields, state.values(u).T, strict=True))
    dpsi = state.derivatives(u)[:, system.fields.index("psi")]
    is_even = "h" in system.scalars
    h = frame.scalars[0] if is_even else state.algebraic_values(u)[:, system.algebraic.index("h")]
    # At the poles the azimuthal curvature tends to the meridional one; the first and last points are the poles or the rim.
    at_axis = np.array([(i in (0, POINTS - 1) and "p" in system.scalars) or i == 0 for i in range(POINTS)])
    azimuthal = np.where(at_axis, dpsi / h, np.sin(y["psi"]) / np.where(at_axis, 1.0, y["r"]))
    rates = State(frame.mesh, frame.nodes, frame.slopes, frame.rates, frame.scalars).algebraic_values(u)
    v0 = frame.scalars[system.scalars.index("v0")] if "v0" in system.scalars else 0.0
    out = {
        "mesh_coordinate": u,
        "radius": np.where(at_axis, 0.0, y["r"]),
        "axial_position": y["z"],
        "tangent_angle": y["psi"],
        "meridional_curvature": dpsi / h,
        "azimuthal_curvature": azimuthal,
        "tangential_velocity": y["v"],
        "normal_velocity": np.sin(y["psi"]) * rates[:, 0] + np.cos(y["psi"]) * (rates[:, 1] + v0),
    }
    named = {"c": "concentration", "c_2": "second_concentration", "v_phi": "azimuthal_velocity"}
    out |= {name: y[field] for field, name in named.items() if field in y}
    if "gamma" in system.algebraic:
        out["local_tension"] = state.algebraic_values(u)[:, 0]
    if "area" in y:
        out["local_spontaneous_curvature"] = _coat(engine, y["area"])
    return out


def _coat(engine: Engine, area: Array) -> Array:
    """C0 at cumulative areas (point,)."""
    return np.asarray(local_spontaneous_curvature(engine.system.named(jnp.asarray(engine.p)), jnp.asarray(area)))
