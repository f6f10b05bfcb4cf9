"""Observables of a state, by their contract names, dimensionless."""

import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.geometry.contact import crosses_itself
from shapespace.numerics.adaptation import discretisation_error
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.state import State
from shapespace.physics.term import CHANNELS
from shapespace.study.engine import Engine
from shapespace.variational.ledger import boundary_power, densities

CLOSING_RADIUS = 1e-4
"""A neck thinner than this, in units of the surface's length scale, counts as closed."""
OUTLINE = 6
"""Segments of an outline per element, to see where it crosses itself."""
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
_SAMPLES_PER_ELEMENT = 4
_ZOOMS, _ZOOM = 3, 64
"""Each narrows the place of an extremum to two of so many parts; its value then is exact to round-off."""


def measure(engine: Engine, x: Array, rate: Rate) -> dict[str, float]:
    """All observables of one state in motion that need no other moment; `energy` is F, for the energy law."""
    problem, system = engine.problem, engine.system
    state = problem.unpack(x)
    column = {name: i for i, name in enumerate(system.fields)}
    integrals, peaks = problem.integrals(densities, x, engine.p, rate)
    scalars = dict(zip(system.scalars, state.scalars.tolist(), strict=True))
    first, last = state.nodes[0], state.nodes[-1]
    out = {
        "height": first[column["z"]] - last[column["z"]],
        "length": integrals["length"],
        "equator_radius": float(state.field(column["r"], np.array([0.5]))[0]),
        "max_meridional_curvature": peaks["curvature"],
        **{name: integrals[name] for name in ("area", "bending_energy", "energy")},
        **{name: integrals[name] for name in ("reaction_rate",) if name in integrals},
        **_powers(engine, integrals, first, last),
    }
    if system.storages:
        out["energy"] += system.stored_energy(
            jnp.asarray(engine.p), {"p": integrals["volume"], "sigma": integrals["area"]}
        )
    out |= {
        "discretisation_error": discretisation_error(state),
        "boundary_residual": _boundary_residual(engine, x, rate),
    }
    radius = neck_radius(state, column["r"])
    if radius is not None:
        out["neck_radius"] = radius
    if "p" in scalars:
        out |= _closed(state, column, integrals, scalars)
        out |= _regulated(engine, state, column, integrals) if "c" in column else {}
        out |= dict.fromkeys(("tension", "tension_pole"), scalars["sigma"]) if "sigma" in scalars else {}
    if "gamma" in system.algebraic:
        out["tension_pole"] = float(state.algebraic_values(np.array([0.0]))[0, 0])
    if "p" not in scalars:
        out["pulling_force"] = integrals["pulling_force"]
        out["pulling_force_per_2pi"] = integrals["pulling_force"] / (2.0 * np.pi)
    return {name: float(value) for name, value in out.items()}


def _powers(engine: Engine, integrals: dict[str, float], first: Array, last: Array) -> dict[str, float]:
    """What is dissipated, by channel, and supplied; a rim lets matter in at the reservoir's tension, which does work."""
    named = {name: integrals[name] for name in DISSIPATIONS if name in integrals}
    work = {"force_power": integrals["force_power"], "boundary_power": boundary_power(engine.system, first, last)}
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


def _closed(
    state: State, column: dict[str, int], integrals: dict[str, float], scalars: dict[str, float]
) -> dict[str, float]:
    """Observables that only a closed surface has."""
    ends = np.array([0.0, 1.0])
    poles = state.derivatives(ends)[:, column["psi"]]
    if "h" not in scalars:
        poles = poles / state.algebraic_values(ends)[:, -1]
    area, volume = integrals["area"], integrals["volume"]
    return {
        "volume": volume,
        "reduced_volume": 6.0 * np.sqrt(np.pi) * volume / area**1.5,
        "pressure": scalars["p"],
        "velocity": scalars["v0"],
        "polarity": 1.0 - poles[0] / poles[1],
    }


def _regulated(engine: Engine, state: State, column: dict[str, int], integrals: dict[str, float]) -> dict[str, float]:
    """Observables that only a surface with a regulator has."""
    v = engine.values
    c_pole = state.nodes[0, column["c"]]
    position, largest = largest_value(state, column["c"])
    out = {}
    if "active_tension" in v:
        hill = c_pole**2 / (c_pole**2 + v["saturation_concentration"] ** 2)
        out["tension_pole"] = v["tension"] + v["active_tension"] * hill
    return out | {
        "max_concentration": largest,
        "ring_position": position,
        **{name: integrals[name] for name in ("chemical_power", "amount", "amount_supply")},
    }


def _samples(state: State) -> Array:
    """Points (m,) that resolve the state: a few per element, and u = 1/2."""
    fractions = np.arange(_SAMPLES_PER_ELEMENT) / _SAMPLES_PER_ELEMENT
    points = state.mesh[:-1, None] + state.widths[:, None] * fractions
    return np.union1d(np.append(points.ravel(), 1.0), [0.5])


def neck_radius(state: State, r: int) -> float | None:
    """The smallest r at an interior local minimum of r(u), r being field number `r`; None without one."""
    found = neck(state, r)
    return None if found is None else found[1]


def neck(state: State, r: int) -> tuple[float, float] | None:
    """Where r(u) has its smallest interior local minimum, and its value there; None without one."""
    u = _samples(state)
    values = state.field(r, u)
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
    places = np.arange(OUTLINE * problem.elements + 1) / OUTLINE
    u = np.interp(places, np.arange(problem.elements + 1), state.mesh)
    z = fields.index("z")

    def outline(u: Array) -> tuple[Array, Array]:
        return state.field(r, u), state.field(z, u)

    radii, heights = outline(u)
    # An outline on its side of the axis cannot cross itself where it only falls, or turns only one way around a point.
    middle = 0.5 * (heights[0] + heights[-1])
    turns = radii[1:] * (heights[:-1] - middle) - radii[:-1] * (heights[1:] - middle)
    if radii[1:-1].min() > 0.0 and ((np.diff(heights) < 0.0).all() or (turns > 0.0).all()):
        return None
    return Outcome.SELF_INTERSECTING if crosses_itself(outline, u) else None


def largest_value(state: State, field: int) -> tuple[float, float]:
    """Where a field is largest, and its value there; a uniform field has its largest value in the middle."""
    u = _samples(state)
    values = state.field(field, u)
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
