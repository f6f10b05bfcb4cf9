"""What a store holds as one xarray Dataset, whatever it is: fields along curves and observables over times or states."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import Branch, open_branch
from shapespace.study.curve_store import Curve, open_curve
from shapespace.study.dataset import open_dataset, profile_of
from shapespace.study.diagram_store import open_diagram
from shapespace.study.frame import Frame
from shapespace.study.manifests import CONVENTIONS, noun_of
from shapespace.study.scenario import Scenario
from shapespace.study.search_store import Search, open_search
from shapespace.study.stored_starts import Start, stored_start

STATE, POINT = "state", "point"
RATES = 6
"""Growth rates of a point that a table has."""
VARIED = "varied"
"""Attribute: the key that varies from state to state, of a curve both with a blank between."""


def stored_dataset(text: str | Path) -> xr.Dataset:
    """The dataset of `STORE` or `STORE:LABEL`. InputError and StoreError where there is nothing to tell."""
    path = Path(text)
    noun = noun_of(path)
    if noun == "branch":
        return branch_dataset(open_branch(path))
    if noun == "curve":
        return curve_dataset(open_curve(path))
    if noun == "diagram":
        data = open_diagram(path).dataset
        # NetCDF takes words and numbers; Zarr takes what JSON does.
        return data.assign_attrs({name: _plain(value) for name, value in data.attrs.items()})
    if noun == "search":
        return search_dataset(open_search(path))
    if names_state(text):
        return state_dataset(stored_start(text))
    return open_dataset(path)


def names_state(text: str | Path) -> bool:
    """Whether this is `STORE:LABEL`, and not the directory of a store."""
    return ":" in str(text) and not Path(text).is_dir()


def search_dataset(search: Search) -> xr.Dataset:
    """Fields (state, point) and observables (state) of the states that a search found. InputError where there is none."""
    frames = [one.frame for one in search.states if one.frame]
    return _states([search.scenario] * len(frames), frames, {})


def state_dataset(start: Start) -> xr.Dataset:
    """The same of one state, with its values of the keys that vary where it comes from."""
    values = start.scenario.values()
    data = _states([start.scenario], [start.frame], {key: [values[key]] for key in start.keys})
    return data.assign_attrs({VARIED: " ".join(start.keys)})


def branch_dataset(branch: Branch) -> xr.Dataset:
    """Fields (state, point), observables and parameter (state), leading growth rates (state, rate), in order of the branch."""
    points = branch.points
    columns: dict[str, Sequence[object]] = {branch.key: [point.parameter for point in points]}
    if branch.free is not None:
        columns[branch.free] = [point.freed for point in points]
    columns |= {
        "parameter_error": [point.parameter_error for point in points],
        "n_unstable": [np.nan if point.n_unstable is None else point.n_unstable for point in points],
    }
    data = _states([branch.scenario_at(point) for point in points], [point.frame for point in points], columns)
    rates = np.stack([_rates(point) for point in points])
    unit = {"units": f"1/{branch.scenario.scales.unit('time')}", "long_name": "leading growth rates"}
    data["growth_rate"] = ((STATE, "rate"), rates[..., 0], unit)
    data["growth_frequency"] = ((STATE, "rate"), rates[..., 1], unit | {"long_name": "their imaginary parts"})
    return _described(data, branch).assign_attrs({VARIED: branch.key})


def curve_dataset(curve: Curve) -> xr.Dataset:
    """Fields (state, point), observables and both parameters (state), in the order of the curve."""
    points = curve.points
    columns = {key: [point.parameters[i] for point in points] for i, key in enumerate(curve.keys)}
    columns |= {f"{key}_error": [point.parameter_errors[i] for point in points] for i, key in enumerate(curve.keys)}
    data = _states([curve.scenario_at(point) for point in points], [point.frame for point in points], columns)
    return _described(data, curve).assign_attrs({VARIED: " ".join(curve.keys)})


def _states(
    scenarios: Sequence[Scenario], frames: Sequence[Frame], columns: Mapping[str, Sequence[object]]
) -> xr.Dataset:
    """Profiles, observables and further columns of states, with units."""
    if not frames:
        raise InputError("there is no state in this store.")
    scales = scenarios[0].scales
    fields = [profile_of(*one) for one in zip(scenarios, frames, strict=True)]
    data = {name: ((STATE, POINT), np.stack([one[name] for one in fields])) for name in fields[0]}
    names = dict.fromkeys(name for frame in frames for name in frame.observables)
    series = {name: np.array([frame.observables.get(name, np.nan) for frame in frames]) for name in names}
    series |= {name: np.array(values, dtype=float) for name, values in columns.items()}
    made = xr.Dataset(data | {name: (STATE, values) for name, values in series.items()})
    for name, variable in made.variables.items():
        quantity = QUANTITIES.get(str(name).removesuffix("_error"))
        if quantity is not None:
            variable.attrs |= {"long_name": quantity.meaning, "symbol": quantity.symbol}
            variable.attrs["units"] = scales.unit(str(name).removesuffix("_error"))
    about = {"scenario": scenarios[0].name, "kind": scenarios[0].kind, "parameters": json.dumps(scenarios[0].values())}
    return made.assign_attrs(about, conventions=CONVENTIONS)


def _described(data: xr.Dataset, path: Branch | Curve) -> xr.Dataset:
    """With labels, places and the scenario."""
    for name in ("label", "kind"):
        data[name] = (STATE, np.array([getattr(point, name) for point in path.points], dtype=str))
    data["arclength"] = (STATE, np.array([point.place for point in path.points]), {"long_name": "along the path"})
    outcome = str(path.outcome) if path.outcome else "unfinished"
    return data.assign_attrs(outcome=outcome, parameters=json.dumps(path.scenario.values()))


def _plain(value: object) -> object:
    return value if isinstance(value, str | int | float) else json.dumps(value)


def _rates(point: BranchPoint) -> NDArray[np.float64]:
    """The leading growth rates (RATES, 2), NaN where they are not known."""
    rates = np.full((RATES, 2), np.nan)
    known = point.growth_rates[:RATES]
    rates[: len(known)] = known
    return rates
