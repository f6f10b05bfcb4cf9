"""Observables of a state at rest with their derivatives by the state and by the parameters."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.keys import nearest
from shapespace.study.observables import PEAKS, combined, energy_law, neck, readings
from shapespace.study.rows import algebraic_at, place_moves, slope_at, value_at
from shapespace.variational.ledger import densities
from shapespace.variational.surface import SurfaceSystem


class Gradients(NamedTuple):
    """Observables by name: values (m,), derivatives by x (m, size) and directly by p (m, n_p); dimensionless."""

    names: tuple[str, ...]
    values: Array
    by_x: Array
    by_p: Array


def gradients(problem: CollocationProblem, x: Array, p: Array, names: Sequence[str] = ()) -> Gradients:
    """Of these observables, or of all that have derivatives: those that tell of errors of the solution have none.

    InputError for a name that the state does not report.
    """
    system = problem.system
    assert isinstance(system, SurfaceSystem)
    parts = _parts(problem, system, x, p)
    known = _reported(system, parts, p)
    for name in names:
        if name not in known:
            raise InputError(
                f"{name}: is no observable of this state with a derivative; the nearest one is {nearest(name, known)}."
            )
    names = tuple(dict.fromkeys(names)) or tuple(known)

    def stacked(parts: Mapping[str, Any], p: Any) -> Any:
        values = _reported(system, parts, p)
        return jnp.stack([jnp.asarray(values[name]) for name in names])

    by_parts, by_p = jax.jacrev(stacked, argnums=(0, 1))(parts, jnp.asarray(p))
    rows, direct = np.zeros((len(names), len(x))), np.array(by_p)
    for name, (by_x, also_by_p) in _slopes_of_parts(problem, system, x, p, parts).items():
        weights = np.asarray(by_parts[name]).reshape(len(names), -1)
        rows += weights @ by_x
        direct += weights @ also_by_p
    return Gradients(names, np.array([float(known[name]) for name in names]), rows, direct)


def reported(problem: CollocationProblem, x: Array, p: Array) -> dict[str, float]:
    """The observables that have derivatives, dimensionless."""
    system = problem.system
    assert isinstance(system, SurfaceSystem)
    return {name: float(value) for name, value in _reported(system, _parts(problem, system, x, p), p).items()}


def _parts(problem: CollocationProblem, system: SurfaceSystem, x: Array, p: Array) -> dict[str, Any]:
    """What the observables are combined from, as `observables.measure` does."""
    integrals, peaks = problem.integrals(densities, x, p, REST)
    parts = integrals | {name: peaks[name] for name in PEAKS} | readings(system, problem.unpack(x))
    return {name: jnp.asarray(value) for name, value in parts.items()}


def _reported(system: SurfaceSystem, parts: Mapping[str, Any], p: Any) -> dict[str, Any]:
    """Observables at rest; those that tell of the error of the solution have no derivative."""
    values = combined(system, parts, p)
    return values | energy_law(values, 0.0)


def _slopes_of_parts(
    problem: CollocationProblem, system: SurfaceSystem, x: Array, p: Array, parts: Mapping[str, Any]
) -> dict[str, tuple[Array, Array]]:
    """Of each part of the observables its derivatives by x (m, size) and directly by p (m, n_p), m its components."""
    state, none = problem.unpack(x), np.zeros(len(p))
    sums, peaks = problem.integral_slopes(densities, x, p)
    found = {
        name: (by_x[None], by_p[None]) for name, (by_x, by_p) in (sums | {one: peaks[one] for one in PEAKS}).items()
    }
    read: dict[str, list[Array]] = {
        "first": [value_at(problem, x, name, 0.0)[1] for name in system.fields],
        "last": [value_at(problem, x, name, 1.0)[1] for name in system.fields],
        "scalars": [*np.eye(len(x))[len(x) - len(system.scalars) :]],
        "equator_radius": [value_at(problem, x, "r", 0.5)[1]],
    }
    # Where r is smallest, and c largest, moving the place changes nothing to first order.
    if (narrowest := neck(state, system.fields.index("r"))) is not None:
        read["neck_radius"] = [value_at(problem, x, "r", narrowest[0])[1]]
    if "gamma_pole" in parts:
        read["gamma_pole"] = [algebraic_at(problem, state, "gamma", 0.0)]
    if "poles" in parts:
        read["poles"] = [slope_at(problem, x, "psi", u)[1] for u in (0.0, 1.0)]
    if "ring_position" in parts:
        place = float(parts["ring_position"])
        read["max_concentration"] = [value_at(problem, x, "c", place)[1]]
        read["ring_position"] = [place_moves(problem, x, state, "c", place)]
    return found | {name: (np.array(rows), np.tile(none, (len(rows), 1))) for name, rows in read.items()}
