"""Observables of a state, by their contract names, dimensionless."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.geometry.contact import crosses_itself
from shapespace.numerics.adaptation import discretisation_error
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.state import Places, State
from shapespace.physics.term import CHANNELS
from shapespace.study.engine import Engine
from shapespace.variational.ledger import boundary_power, densities
from shapespace.variational.surface import SurfaceSystem

CLOSING_RADIUS = 1e-4
"""A neck thinner than this, in units of the surface's length scale, counts as closed."""
SAMPLES_PER_ELEMENT = 6
"""Where extrema are looked for, and where an outline may cross itself."""
DISSIPATIONS = tuple(channel.value for channel in CHANNELS)
"""The channels of the dissipation, of which a model has some."""
SUPPLIES = ("force_power", "boundary_power", "chemical_power")
FLOWS = (
    "dissipation",
    *DISSIPATIONS,
    "external_power",
    *SUPPLIES,
    "energy_rate",
    "energy_residual",
    "amount_supply",
    "reaction_rate",
)
"""What belongs to the motion of a surface, not to its shape: not known of a state that is given."""
PEAKS = ("curvature",)
"""Densities whose largest point value is an observable, not their integral."""
_ZOOMS, _ZOOM = 3, 64
"""Each narrows the place of an extremum to two of so many parts; its value then is exact to round-off."""


def measure(engine: Engine, x: Array, rate: Rate) -> dict[str, float]:
    """All observables of one state in motion that need no other moment; `energy` is F, for the energy law."""
    problem, system = engine.problem, engine.system
    state = problem.unpack(x)
    integrals, peaks = problem.integrals(densities, x, engine.p, rate)
    parts = integrals | {name: peaks[name] for name in PEAKS} | readings(system, state)
    out = combined(system, parts, engine.p) | {
        "discretisation_error": discretisation_error(state),
        "boundary_residual": _boundary_residual(engine, x, rate),
    }
    return {name: float(value) for name, value in out.items()}


def readings(system: SurfaceSystem, state: State) -> dict[str, Any]:
    """What observables read off a state at single points: `first`, `last` (n,), `scalars` (n_s,), and by names of their own."""
    column = {name: i for i, name in enumerate(system.fields)}
    out: dict[str, Any] = {
        "first": state.nodes[0],
        "last": state.nodes[-1],
        "scalars": state.scalars,
        "equator_radius": state.field(column["r"], np.array([0.5]))[0],
    }
    radius = neck_radius(state, column["r"])
    if radius is not None:
        out["neck_radius"] = radius
    if "gamma" in system.algebraic:
        out["gamma_pole"] = state.algebraic_values(np.array([0.0]))[0, 0]
    if "p" in system.scalars:
        ends = np.array([0.0, 1.0])
        poles = state.derivatives(ends)[:, column["psi"]]
        out["poles"] = poles if "h" in system.scalars else poles / state.algebraic_values(ends)[:, -1]
        if "c" in column:
            out["ring_position"], out["max_concentration"] = largest_value(state, column["c"])
    return out


def combined(system: SurfaceSystem, parts: Mapping[str, Any], p: Any) -> dict[str, Any]:
    """Observables from integrals, largest values and readings, of numbers or as a function to differentiate; p (n_p,)."""
    scalars = dict(zip(system.scalars, parts["scalars"], strict=True))
    z = system.fields.index("z")
    out = {
        "height": parts["first"][z] - parts["last"][z],
        "max_meridional_curvature": parts["curvature"],
        **{name: parts[name] for name in ("length", "equator_radius", "area", "bending_energy", "energy")},
        **{name: parts[name] for name in ("reaction_rate",) if name in parts},
        **_powers(system, parts),
    }
    if system.storages:
        out["energy"] += system.stored_energy(p, {"p": parts["volume"], "sigma": parts["area"]})
    if "neck_radius" in parts:
        out["neck_radius"] = parts["neck_radius"]
    if "p" in scalars:
        out |= _closed(parts, scalars)
        out |= _regulated(system, parts, p) if "c" in system.fields else {}
        out |= dict.fromkeys(("tension", "tension_pole"), scalars["sigma"]) if "sigma" in scalars else {}
    if "gamma_pole" in parts:
        out["tension_pole"] = parts["gamma_pole"]
    if "p" not in scalars:
        out["pulling_force"] = parts["pulling_force"]
        out["pulling_force_per_2pi"] = parts["pulling_force"] / (2.0 * np.pi)
    return out


def _powers(system: SurfaceSystem, parts: Mapping[str, Any]) -> dict[str, Any]:
    """What is dissipated, by channel, and supplied; a rim lets matter in at the reservoir's tension, which does work."""
    named = {name: parts[name] for name in DISSIPATIONS if name in parts}
    work = {
        "force_power": parts["force_power"],
        "boundary_power": boundary_power(system, parts["first"], parts["last"]),
    }
    return {"dissipation": sum(named.values()), **named, "external_power": sum(work.values()), **work}


def energy_law(values: dict[str, float], rate: float) -> dict[str, float]:
    """dF/dt, and what it leaves of the energy law: dF/dt + 2 D - external - chemical power."""
    supply = values["external_power"] + values.get("chemical_power", 0.0)
    return {"energy_rate": rate, "energy_residual": rate + values["dissipation"] - supply}


def _boundary_residual(engine: Engine, x: Array, rate: Rate) -> float:
    """By how much the worst of the end conditions and the integral conditions is missed."""
    # As many as there are fields and scalars; they come last.
    conditions = len(engine.system.fields) + len(engine.system.scalars)
    return float(np.abs(engine.problem.residual(x, engine.p, rate)[-conditions:]).max())


def _closed(parts: Mapping[str, Any], scalars: Mapping[str, Any]) -> dict[str, Any]:
    """Observables that only a closed surface has."""
    area, volume = parts["area"], parts["volume"]
    return {
        "volume": volume,
        "reduced_volume": 6.0 * np.sqrt(np.pi) * volume / area**1.5,
        "pressure": scalars["p"],
        "velocity": scalars["v0"],
        "polarity": 1.0 - parts["poles"][0] / parts["poles"][1],
    }


def _regulated(system: SurfaceSystem, parts: Mapping[str, Any], p: Any) -> dict[str, Any]:
    """Observables that only a surface with a regulator has."""
    v = dict(zip(system.parameters, p, strict=True))
    c_pole = parts["first"][system.fields.index("c")]
    out = {
        name: parts[name]
        for name in ("max_concentration", "ring_position", "chemical_power", "amount", "amount_supply")
    }
    if "active_tension" in v:
        hill = c_pole**2 / (c_pole**2 + v["saturation_concentration"] ** 2)
        out["tension_pole"] = v["tension"] + v["active_tension"] * hill
    return out


def _samples(state: State) -> Places:
    """Points that resolve the state: a few per element, and u = 1/2."""
    return _sampled(state.mesh.tobytes(), state.rule.degree)


@lru_cache(maxsize=64)
def _sampled(nodes: bytes, degree: int) -> Places:
    """The points of a mesh, which many states share."""
    mesh = np.frombuffer(nodes)
    fractions = np.arange(SAMPLES_PER_ELEMENT) / SAMPLES_PER_ELEMENT
    points = mesh[:-1, None] + np.diff(mesh)[:, None] * fractions
    return Places.on(mesh, gauss_rule(degree), np.union1d(np.append(points.ravel(), 1.0), [0.5]))


def neck_radius(state: State, r: int) -> float | None:
    """The smallest r at an interior local minimum of r(u), r being field number `r`; None without one."""
    found = neck(state, r)
    return None if found is None else found[1]


def neck(state: State, r: int) -> tuple[float, float] | None:
    """Where r(u) has its smallest interior local minimum, and its value there; None without one."""
    places = _samples(state)
    values, u = state.field(r, places), places.u
    inner = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])) + 1
    found = [_largest_between(state, r, -1.0, u[i - 1], u[i + 1]) for i in inner]
    return min(((place, -value) for place, value in found), key=lambda one: one[1], default=None)


def shape_end(problem: CollocationProblem, x: Array) -> Outcome | None:
    """Why no physical shape lies beyond a state, if so: its neck has closed, or its outline crosses itself."""
    state, fields = problem.unpack(x), problem.system.fields
    r = fields.index("r")
    neck = neck_radius(state, r)
    if neck is not None and neck < CLOSING_RADIUS:
        return Outcome.NECK_CLOSED
    z, samples = fields.index("z"), _samples(state)
    radii, heights = state.field(r, samples), state.field(z, samples)
    # An outline on its side of the axis cannot cross itself where it only falls, or turns only one way around a point.
    middle = 0.5 * (heights[0] + heights[-1])
    turns = radii[1:] * (heights[:-1] - middle) - radii[:-1] * (heights[1:] - middle)
    if radii[1:-1].min() > 0.0 and ((np.diff(heights) < 0.0).all() or (turns > 0.0).all()):
        return None
    crosses = crosses_itself(lambda u: (state.field(r, u), state.field(z, u)), samples.u)
    return Outcome.SELF_INTERSECTING if crosses else None


def largest_value(state: State, field: int) -> tuple[float, float]:
    """Where a field is largest, and its value there; a uniform field has its largest value in the middle."""
    places = _samples(state)
    values, u = state.field(field, places), places.u
    top = float(values.max())
    if top - float(values.min()) <= 1e-12 * max(abs(top), 1.0):
        return 0.5, top
    i = int(values.argmax())
    if i in (0, len(u) - 1):
        return float(u[i]), top
    return _largest_between(state, field, 1.0, u[i - 1], u[i + 1])


def _largest_between(state: State, field: int, sign: float, left: float, right: float) -> tuple[float, float]:
    """Where sign * field is largest between two points with one maximum between them, and that value, by zooming in."""
    for _ in range(_ZOOMS):
        u = np.linspace(left, right, _ZOOM + 1)
        values = sign * state.field(field, u)
        i = int(values.argmax())
        left, right = u[max(i - 1, 0)], u[min(i + 1, _ZOOM)]
    return float(u[i]), float(values[i])
