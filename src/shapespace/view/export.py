"""What is stored as files for other programs: NetCDF, tables, and meshes with fields."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from shapespace.base.errors import InputError
from shapespace.study.files import storage, write_atomically
from shapespace.study.tables import VARIED, stored_dataset
from shapespace.view.frames import REGULATORS
from shapespace.view.mesh import mesh_of, ply_bytes, vtk_bytes, vtk_series

Progress = Callable[[int, int], None]
"""Called after each file with how many are done, and of how many."""

ENDINGS = {"netcdf": ".nc", "csv": ".csv", "vtk": "-vtk", "ply": "-ply"}
"""By form, how the name of the file or folder ends."""
FORMS = {".nc": "netcdf", ".csv": "csv", ".vtp": "vtk", ".vtk": "vtk", ".pvd": "vtk", ".ply": "ply"}
"""By ending, the form that a name promises."""


def export(
    source: str | Path, out: str | Path | None = None, *, form: str = "netcdf", progress: Progress | None = None
) -> Path:
    """Write `STORE` or `STORE:LABEL` in another form; returns the file written, of meshes the one to open or their folder.

    form: netcdf, all of it; csv, numbers over times, states or points of the grid; vtk, a series that ParaView opens; ply, one
    mesh per time or state. out: the file, of meshes the folder; the default lies beside the store.
    """
    if form not in ENDINGS:
        raise InputError(f"form = {form!r}: must be one of {', '.join(ENDINGS)}.")
    if out is not None and FORMS.get(Path(out).suffix, form) != form:
        raise InputError(
            f"{out}: its ending promises {FORMS[Path(out).suffix]}, not {form}; choose another name or form."
        )
    text = str(source).rstrip("/")
    target = Path(out) if out is not None else Path(text.replace(":", "-") + ENDINGS[form])
    data = stored_dataset(text)
    if form in ("netcdf", "csv"):
        # NetCDF is made in memory: HDF5 crashes the process at its end when a disk is full under an open file.
        content = bytes(data.to_netcdf(engine="h5netcdf")) if form == "netcdf" else csv_of(data).encode()
        with storage(target):
            write_atomically(target, content)
        return target
    if "radius" not in data:
        raise InputError(
            f"{text}: is a diagram, a map without surfaces; export it as netcdf or csv, or {text}:LABEL of it."
        )
    with storage(target):
        target.mkdir(parents=True, exist_ok=True)
        return _write_meshes(data, target, form, progress or (lambda done, total: None))


def csv_of(data: xr.Dataset) -> str:
    """The numbers over times, states or grid points as lines with a heading, of a single state those along its curve.

    Comments above say the scenario and the units.
    """
    if data.sizes.get("state") == 1:
        data = data.isel(state=0)
        chosen = [name for name, variable in data.data_vars.items() if "point" in variable.dims]
    else:
        chosen = [name for name, variable in data.data_vars.items() if not {"point", "rate"} & {*variable.dims}]
    frame = data[chosen].to_dataframe().reset_index()
    units = {name: data[name].attrs.get("units", "") for name in frame.columns if name in data}
    told = ", ".join(f"{name} {unit}" for name, unit in units.items() if unit not in ("", "1"))
    head = f"# scenario: {data.attrs.get('scenario', '')}\n# units: {told}\n"
    return head + str(frame.to_csv(index=False, float_format="%.17g"))


def _write_meshes(data: xr.Dataset, folder: Path, form: str, progress: Progress) -> Path:
    units = {str(name): variable.attrs.get("units", "") for name, variable in data.variables.items()}
    series = _series(data)
    keys = ["time"] if "time" in data else _varied(data)
    carried = REGULATORS.get(data.attrs["kind"], "")
    span = (min(0.0, float(data[carried].min())), float(data[carried].max())) if carried in data else (0.0, 1.0)
    names = {f"{number:06d}.{'vtp' if form == 'vtk' else 'ply'}": float(value) for number, value in enumerate(series)}
    for number, (name, value) in enumerate(names.items()):
        mesh = mesh_of(data, number)
        told = {key: float(data[key][number]) for key in keys}
        is_vtk = form == "vtk"
        content = vtk_bytes(mesh, units, value, told) if is_vtk else ply_bytes(mesh, data.attrs["kind"], span, told)
        write_atomically(folder / name, content)
        progress(number + 1, len(names))
    if form == "ply":
        return folder
    write_atomically(folder / "series.pvd", vtk_series(names))
    return folder / "series.pvd"


def _varied(data: xr.Dataset) -> list[str]:
    """The keys that vary from state to state."""
    return str(data.attrs.get(VARIED, "")).split()


def _series(data: xr.Dataset) -> NDArray[np.float64]:
    """What takes the place of time in a series: time, of states the key that varies where it does so steadily, else numbers."""
    if "time" in data:
        return np.asarray(data["time"].to_numpy(), dtype=np.float64)
    for key in reversed(_varied(data)):
        values = np.asarray(data[key].to_numpy(), dtype=np.float64)
        steps = np.diff(values)
        if (steps > 0.0).all() or (steps < 0.0).all():
            return values
    return np.arange(data.sizes["state"], dtype=np.float64)
