"""Made-up runs that look like the four scenarios: right geometry and kinematics, no mechanics.

Each shape is a closed-form curve x -> (r, z) at every time. Angles and curvatures come from differences on a fine grid,
the normal velocity from the motion of the curve; tangential flow and regulator are invented.
"""

import json
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from shapespace.study.scenario import scenario

Array = NDArray[np.float64]
Curve = Callable[[float], tuple[Array, Array]]  # time -> fine (r, z), from the top pole down

FINE = 7201  # fine grid points; a multiple of POINTS - 1, plus 1
POINTS = 241
STEP = 1e-4  # of the central difference in time

_SYMBOLS = {
    "mesh_coordinate": ("u", "1"),
    "radius": ("r", "R0"),
    "axial_position": ("z", "R0"),
    "tangent_angle": ("psi", "1"),
    "meridional_curvature": ("C_u^u", "1/R0"),
    "azimuthal_curvature": ("C_phi^phi", "1/R0"),
    "tangential_velocity": ("v_u", "R0/tau"),
    "normal_velocity": ("v_n", "R0/tau"),
    "concentration": ("c", "c0"),
    "local_spontaneous_curvature": ("C_0", "1/R0"),
    "local_tension": ("gamma_H", "kappa/R0**2"),
    "height": ("d", "R0"),
    "equator_radius": ("r(1/2)", "R0"),
    "ring_position": ("u_m", "1"),
    "velocity": ("v_0", "R0/tau"),
    "max_concentration": ("c_max", "c0"),
    "polarity": ("P", "1"),
}


class Frame(NamedTuple):
    """Fields at the stored points (name -> array) and observables (name -> number) of one frame."""

    fields: dict[str, Array]
    observables: dict[str, float]


def _geometry(curve: Curve, time: float) -> tuple[dict[str, Array], float]:
    """The geometric fields on every (FINE - 1)/(POINTS - 1)-th fine point, and the length."""
    r, z = curve(time)
    before, after = curve(time - STEP), curve(time + STEP)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r), np.diff(z)))])
    r_s, z_s = np.gradient(r, s, edge_order=2), np.gradient(z, s, edge_order=2)
    psi = np.unwrap(np.arctan2(-z_s, r_s))
    psi -= 2 * np.pi * round(float(psi[0]) / (2 * np.pi))
    psi_s = np.gradient(psi, s, edge_order=2)
    psi_s[:2], psi_s[-2:] = psi_s[2], psi_s[-3]
    safe = np.where(r < 1e-6, 1.0, r)
    normal = ((after[0] - before[0]) * np.sin(psi) + (after[1] - before[1]) * np.cos(psi)) / (2 * STEP)
    fields = {
        "mesh_coordinate": s / s[-1],
        "radius": r,
        "axial_position": z,
        "tangent_angle": psi,
        "meridional_curvature": psi_s,
        "azimuthal_curvature": np.where(r < 1e-6, psi_s, np.sin(psi) / safe),
        "normal_velocity": normal,
    }
    stride = (FINE - 1) // (POINTS - 1)
    return {name: np.asarray(values[::stride], dtype=np.float64) for name, values in fields.items()}, float(s[-1])


def _dataset(name: str, model: str, times: Sequence[float], frames: Sequence[Frame]) -> xr.Dataset:
    rim = "Rb" if model == "open-membrane" else "R0"
    dataset = xr.Dataset(
        {
            **{n: (("time", "point"), np.stack([f.fields[n] for f in frames])) for n in frames[0].fields},
            **{n: ("time", np.array([f.observables[n] for f in frames])) for n in frames[0].observables},
        },
        coords={"time": np.asarray(times, dtype=np.float64)},
        attrs={"scenario": name, "model": model, "outcome": "stationary", "parameters": _parameters(name)},
    )
    dataset["time"].attrs = {"long_name": "time", "symbol": "t", "units": "tau"}
    for key in dataset.data_vars:
        symbol, units = _SYMBOLS[str(key)]
        dataset[key].attrs = {
            "long_name": str(key).replace("_", " "),
            "symbol": symbol,
            "units": units.replace("R0", rim),
        }
    return dataset


def _parameters(name: str) -> str:
    return json.dumps(scenario(name).values())


def _ramp(time: float, centre: float, width: float) -> float:
    """A smooth step from 0 to 1 about `centre`."""
    return float(0.5 * (1 + np.tanh((time - centre) / width)))


def _unit_volume(r: Array, z: Array) -> tuple[Array, Array]:
    """The curve scaled to the volume of the unit sphere."""
    volume = -np.trapezoid(np.pi * r**2, z)
    scale = (4 * np.pi / 3 / volume) ** (1 / 3)
    return r * scale, z * scale


def guided_division(frames: int = 90, neck: float = 0.003) -> xr.Dataset:
    """Cassini ovals ingressing to a neck of radius `neck`, points crowded there."""
    stretch = np.linspace(-1, 1, FINE)
    theta = np.pi / 2 * (1 + np.sinh(8 * stretch) / np.sinh(8)) * 0.5 + np.pi / 4 * (1 + stretch)

    def curve(time: float) -> tuple[Array, Array]:
        q = neck + (1 - neck) * (1 - _ramp(time, 0.22, 0.06)) ** 1.0
        e2 = 1 - min(q, 1.0) ** 2
        rho = np.sqrt(e2 * np.cos(2 * theta) + np.sqrt(1 - (e2 * np.sin(2 * theta)) ** 2))
        return _unit_volume(rho * np.sin(theta), rho * np.cos(theta))

    times = np.concatenate([np.linspace(0, 0.5, frames - frames // 6), np.linspace(0.55, 2, frames // 6)])
    made = []
    for time in times:
        fields, _ = _geometry(curve, float(time))
        u = fields["mesh_coordinate"]
        ring = np.exp(-((u - 0.5) ** 2) / 0.02)
        growth = 1 - np.exp(-20 * time)
        fields["tangential_velocity"] = 4 * growth * np.sin(2 * np.pi * u) * np.sin(np.pi * u) ** 2
        fields["concentration"] = 1 + growth * (3.2 * ring + 6 * _ramp(time, 0.3, 0.05) * ring**12)
        waist = float(np.interp(0.5, u, fields["radius"]))
        z = fields["axial_position"]
        made.append(Frame(fields, {"equator_radius": waist, "height": float(z[0] - z[-1]), "velocity": 0.0}))
    return _dataset("guided-division", "closed-surface", list(times), made)


def _swimmer_curve(slip: Callable[[float], float], drift: Callable[[float], float]) -> Curve:
    theta = np.linspace(0, np.pi, FINE)
    x = np.cos(theta)

    def curve(time: float) -> tuple[Array, Array]:
        a = slip(time)
        rho = 1 - 0.18 * (1 - a) * (1.5 * x**2 - 0.5) * -1 * _ramp(time, 0.3, 0.1) - 0.16 * a * (2.5 * x**3 - 1.5 * x)
        r, z = _unit_volume(rho * np.sin(theta), rho * x)
        return r, z + drift(time)

    return curve


def _swimmer(name: str, slip_time: float, end: float, frames: int, speed: float) -> xr.Dataset:
    def slip(time: float) -> float:
        return _ramp(time, slip_time, 0.25)

    def drift(time: float) -> float:
        return speed * 0.125 * float(np.logaddexp(0, (time - slip_time) / 0.125))

    curve = _swimmer_curve(slip, drift)
    made = []
    times = np.linspace(0, end, frames)
    for time in times:
        fields, _ = _geometry(curve, float(time))
        u, a = fields["mesh_coordinate"], slip(float(time))
        centre = 0.5 * (1 - a)
        ring = np.exp(-((u - centre) ** 2) / 0.03)
        swim = speed * a
        slope = -(u - centre) * np.sin(np.pi * u) * (3.0 + 3 * a)
        fields["tangential_velocity"] = slope * np.sin(np.pi * u) + 0.3 * swim * np.sin(np.pi * u)
        fields["concentration"] = 0.2 + (1.6 + 0.5 * a) * ring
        z = fields["axial_position"]
        observables = {
            "ring_position": float(u[np.argmax(fields["concentration"])]),
            "velocity": swim,
            "polarity": 1.0 - float(fields["meridional_curvature"][0] / fields["meridional_curvature"][-1]),
            "max_concentration": float(fields["concentration"].max()),
            "height": float(z[0] - z[-1]),
            "equator_radius": float(np.interp(0.5, u, fields["radius"])),
        }
        made.append(Frame(fields, observables))
    return _dataset(name, "closed-surface", list(times), made)


def ring_slipping(frames: int = 80) -> xr.Dataset:
    """A ring that pinches the waist, slips to the top pole and makes the surface swim upwards."""
    return _swimmer("ring-slipping", 2.5, 5.0, frames, 0.9)


def polar_swimmer(frames: int = 60) -> xr.Dataset:
    """A cap that forms early and drives an egg downwards."""
    return _swimmer("polar-swimmer", 1.0, 6.0, frames, -0.35)


def membrane_protrusion(frames: int = 70, tall: float = 0.7) -> xr.Dataset:
    """A bump of final height `tall` growing on a clamped disc."""
    r = np.linspace(0, 1, FINE)
    shape = (1 - r**2) ** 2 * np.exp(-((r / 0.42) ** 4))

    def curve(time: float) -> tuple[Array, Array]:
        return r, tall * (1 - np.exp(-max(time, -1.0) * 4) * (1 + 4 * max(time, -1.0))) * shape

    times = 2 * np.linspace(0, 1, frames) ** 1.5
    made = []
    for time in times:
        fields, length = _geometry(curve, float(time))
        s, radius = fields["mesh_coordinate"] * length, fields["radius"]
        area = np.concatenate([[0.0], np.cumsum(np.diff(s) * 0.5 * (radius[1:] + radius[:-1]))])
        fields["tangential_velocity"] = (
            -np.max(fields["normal_velocity"]) * radius * np.exp(-((radius / 0.6) ** 2)) * 1.4
        )
        fields["local_spontaneous_curvature"] = 4.5 * (1 - np.tanh(25 * (area - 0.08)))
        fields["local_tension"] = 12.5 + 0 * area
        made.append(Frame(fields, {"height": float(fields["axial_position"][0] - fields["axial_position"][-1])}))
    return _dataset("membrane-protrusion", "open-membrane", list(times), made)


MAKERS: dict[str, Callable[..., xr.Dataset]] = {
    "membrane-protrusion": membrane_protrusion,
    "ring-slipping": ring_slipping,
    "polar-swimmer": polar_swimmer,
    "guided-division": guided_division,
}

FRAMES = 24  # of the shared datasets


@cache
def dataset_of(name: str) -> xr.Dataset:
    """The made-up run of a scenario, made once."""
    return MAKERS[name](frames=FRAMES)


@cache
def dying_flow() -> xr.Dataset:
    """A protrusion nearly all of whose change is early, and whose flow dies by four decades over the frames."""
    dataset = dataset_of("membrane-protrusion")
    part = np.linspace(0, 1, FRAMES)
    slow = dataset.assign_coords(time=("time", 2 * part * 10.0 ** (4 * (part - 1)), dataset["time"].attrs))
    for name, speed in (("tangential_velocity", -1.0), ("normal_velocity", 2.0)):
        flow = speed * 10.0 ** (-4 * part[:, None]) * np.sin(np.pi * dataset["mesh_coordinate"].values)
        slow[name] = (("time", "point"), flow, dataset[name].attrs)
    return slow
