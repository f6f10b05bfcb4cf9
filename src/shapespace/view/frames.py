"""A stored run as checked arrays: one profile at any frame position, and the measure of progress along the run."""

import json
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from shapespace.base.errors import InputError
from shapespace.base.scales import Scales

Array = NDArray[np.float64]

PROFILE_VARIABLES = (
    "mesh_coordinate",
    "radius",
    "axial_position",
    "tangent_angle",
    "meridional_curvature",
    "azimuthal_curvature",
    "tangential_velocity",
    "normal_velocity",
)
REGULATORS = {"closed-surface": "concentration", "open-membrane": "local_spontaneous_curvature"}
_TIME_SHARE = 0.35  # weight of plain time beside shape change and curve change, each of weight 1
_COMPARED_POINTS = 81


@dataclass(frozen=True)
class Profile:
    """One meridian, u from 0 (top pole) to 1, in the units of the dataset."""

    time: float
    u: Array
    radius: Array
    axial: Array
    angle: Array
    meridional_curvature: Array
    azimuthal_curvature: Array
    tangential: Array
    normal: Array
    regulator: Array | None
    swim: float

    @property
    def centre(self) -> float:
        """Mean of the highest and the lowest z."""
        return 0.5 * float(self.axial.min() + self.axial.max())


@dataclass(frozen=True)
class Run:
    """The arrays of a dataset that pictures need: `fields` are (time, point), `swim` and `time` are (time,)."""

    dataset: xr.Dataset
    time: Array
    fields: dict[str, Array]
    swim: Array
    regulator: str | None
    is_open: bool
    scales: Scales

    def profile(self, position: float) -> Profile:
        """The meridian at a frame position in [0, frames - 1]; between frames, linear at fixed u.

        Fixed u, not fixed point number: the points of two frames differ where the mesh has moved.
        """
        low = min(int(position), self.time.size - 1)
        weight = position - low
        names = (*PROFILE_VARIABLES, *([self.regulator] if self.regulator else []))
        values = {name: self.fields[name][low] for name in names}
        time, swim = float(self.time[low]), float(self.swim[low])
        if weight > 0:
            u, u_next = (self.fields["mesh_coordinate"][k] for k in (low, low + 1))
            for name in names[1:]:
                after = np.interp(u, u_next, self.fields[name][low + 1])
                values[name] = (1 - weight) * values[name] + weight * after
            time += weight * (float(self.time[low + 1]) - time)
            swim += weight * (float(self.swim[low + 1]) - swim)
        return Profile(
            time=time,
            u=values["mesh_coordinate"],
            radius=values["radius"],
            axial=values["axial_position"],
            angle=values["tangent_angle"],
            meridional_curvature=values["meridional_curvature"],
            azimuthal_curvature=values["azimuthal_curvature"],
            tangential=values["tangential_velocity"],
            normal=values["normal_velocity"],
            regulator=values[self.regulator] if self.regulator else None,
            swim=swim,
        )


def read_run(dataset: xr.Dataset, observables: Iterable[str] = (), least: int = 2) -> Run:
    """The arrays of `dataset`, checked: at least so many frames, time increases, all variables there and finite."""
    scenario = str(dataset.attrs.get("scenario", "unnamed"))
    model = str(dataset.attrs.get("kind", dataset.attrs.get("model", "")))
    observables = tuple(observables)
    expected = REGULATORS.get(model)
    wanted = [*PROFILE_VARIABLES, *observables, *([expected] if expected else [])]
    missing = [name for name in ("time", *wanted) if name not in dataset.variables]
    if missing:
        raise InputError(
            f"dataset of scenario '{scenario}' lacks {', '.join(missing)}; pass the dataset of a stored run."
        )
    regulator = expected or next((name for name in REGULATORS.values() if name in dataset), None)
    if regulator and regulator not in wanted:
        wanted.append(regulator)
    frames = dataset.sizes.get("time", 0)
    if frames < least:
        raise InputError(
            f"dataset of scenario '{scenario}' has {frames} frame(s); its picture needs {least}: run it on."
        )
    for name in ("time", *wanted):
        dims = ("time",) if name == "time" or name in observables else ("time", "point")
        if set(dataset[name].dims) != set(dims):
            raise InputError(f"'{name}' has dimensions {dataset[name].dims}; it must have {dims}.")
        if not np.all(np.isfinite(dataset[name].values)):
            raise InputError(f"'{name}' of scenario '{scenario}' holds NaN or infinity; plot only finite frames.")
    time = np.asarray(dataset["time"].values, dtype=np.float64)
    if not np.all(np.diff(time) > 0):
        raise InputError(f"time of scenario '{scenario}' does not increase; sort the frames by time.")
    fields = {
        name: np.asarray(dataset[name].transpose("time", "point").values, dtype=np.float64)
        for name in wanted
        if name not in observables
    }
    swim = observable(dataset, "velocity") if "velocity" in dataset else np.zeros_like(time)
    parameters = json.loads(dataset.attrs.get("parameters", "{}"))
    if not parameters:
        raise InputError(f"dataset of scenario '{scenario}' lacks its parameters; pass the dataset of a stored run.")
    return Run(dataset, time, fields, swim, regulator, model == "open-membrane", Scales.of(parameters))


def observable(dataset: xr.Dataset, name: str) -> Array:
    """A series over time as plain numbers."""
    return np.asarray(dataset[name].values, dtype=np.float64)


def shape_steps(run: Run) -> Array:
    """Root mean square displacement of the meridian between frames, at fixed u about the centre: (frames - 1,)."""
    u = np.linspace(0, 1, _COMPARED_POINTS)
    shapes = np.empty((run.time.size, 2, u.size))
    for k in range(run.time.size):
        z = run.fields["axial_position"][k]
        mesh = run.fields["mesh_coordinate"][k]
        centre = 0.0 if run.is_open else 0.5 * (z.min() + z.max())
        shapes[k] = np.interp(u, mesh, run.fields["radius"][k]), np.interp(u, mesh, z - centre)
    steps: Array = np.sqrt(np.mean(np.sum(np.diff(shapes, axis=0) ** 2, axis=1), axis=-1))
    return steps


def progress_measure(run: Run, curve: Array, time_share: float = _TIME_SHARE) -> Array:
    """Progress in [0, 1] at every frame: change of shape and of `curve`, and some plain time, so that rest counts."""
    steps = time_share * np.diff(run.time) / (run.time[-1] - run.time[0])
    scales = float(run.fields["radius"].max()), float(np.abs(curve).max())
    for change, scale in zip((shape_steps(run), np.abs(np.diff(curve))), scales, strict=True):
        total = float(change.sum())
        if total > 1e-9 * scale:  # else round-off, which is no progress
            steps = steps + change / total
    progress = np.concatenate([[0.0], np.cumsum(steps)])
    if progress[-1] == 0:
        return np.linspace(0, 1, progress.size)
    return np.asarray(progress / progress[-1], dtype=np.float64)


def snapshot_frames(progress: Array, count: int) -> list[int]:
    """At most `count` different frames nearest to equal steps of progress, the first and the last among them."""
    nearest = {int(np.argmin(np.abs(progress - target))) for target in np.linspace(0, 1, count)}
    return sorted(nearest | {0, progress.size - 1})


def frame_positions(progress: Array, count: int) -> Array:
    """`count` fractional frame positions at equal steps of progress."""
    return np.asarray(np.interp(np.linspace(0, 1, count), progress, np.arange(progress.size, dtype=np.float64)))
