"""States a little off the sphere, and their modes: what `closed_forms` says grows or decays."""

from collections.abc import Mapping

import numpy as np
from numpy.polynomial import chebyshev, legendre
from tests.surfaces import State, fields_at

from shapespace.base.arrays import Array
from shapespace.numerics.state import state_from_functions
from shapespace.study.engine import Engine


def _displacements(l: int, u: Array) -> dict[str, Array | float]:
    """Normal displacement P_l(cos pi u), the tangential one that keeps u the scaled arc length, and their slopes.

    On the unit sphere arc length stretches by tau'/pi + xi, which must be the same everywhere: its mean, a_0.
    """
    a = chebyshev.poly2cheb(legendre.leg2poly(np.eye(l + 1)[l]))
    waves = np.pi * np.arange(len(a))
    cos, sin = np.cos(u[..., None] * waves), np.sin(u[..., None] * waves)
    shift = np.where(waves > 0.0, a / np.maximum(waves, 1.0), 0.0)
    xi = cos @ a
    return {
        "xi": xi,
        "dxi": -sin @ (a * waves),
        "ddxi": -cos @ (a * waves**2),
        "tau": -np.pi * (sin @ shift),
        "dtau": np.pi * (a[0] - xi),
        "stretch": a[0],
    }


def perturbed_sphere(engine: Engine, shape: Mapping[int, float], concentration: Mapping[int, float]) -> State:
    """The unit sphere of an engine, displaced to first order by shape[l] P_l and with concentration[l] P_l added."""
    state = engine.initial_state()
    column = {name: i for i, name in enumerate(engine.system.fields)}
    nodes, slopes, scalars = state.nodes.copy(), state.slopes.copy(), state.scalars.copy()
    for l in shape.keys() | concentration.keys():
        a, b = shape.get(l, 0.0), concentration.get(l, 0.0)
        d = _displacements(l, state.mesh)
        sin, cos = np.sin(np.pi * state.mesh), np.cos(np.pi * state.mesh)
        nodes[:, column["r"]] += a * (d["xi"] * sin + d["tau"] * cos)
        nodes[:, column["z"]] += a * (d["xi"] * cos - d["tau"] * sin)
        nodes[:, column["psi"]] += a * (d["tau"] - d["dxi"] / np.pi)
        nodes[:, column["c"]] += b * d["xi"]
        d = _displacements(l, state.stage_points)
        sin, cos = np.sin(np.pi * state.stage_points), np.cos(np.pi * state.stage_points)
        normal, tangential = d["dxi"] - np.pi * d["tau"], d["dtau"] + np.pi * d["xi"]
        slopes[..., column["r"]] += a * (normal * sin + tangential * cos)
        slopes[..., column["z"]] += a * (normal * cos - tangential * sin)
        slopes[..., column["psi"]] += a * (d["dtau"] - d["ddxi"] / np.pi)
        slopes[..., column["c"]] += b * d["dxi"]
        scalars[0] += a * np.pi * d["stretch"]
    return state_from_functions(state.mesh, engine.problem.degree, nodes, slopes, state.algebraic, scalars)


def modes(engine: Engine, x: Array, degrees: tuple[int, ...]) -> Array:
    """Amplitudes (len(degrees), 2) of P_l in the normal displacement and in the concentration, unit sphere, c0 = 1."""
    points, weights = legendre.leggauss(60)
    angle = np.arccos(points)
    f = fields_at(engine, x, angle / np.pi)
    displacement = np.sin(angle) * f["r"] + np.cos(angle) * f["z"] - 1.0
    functions = np.stack([displacement, f["c"] - 1.0], axis=1)
    polynomials = np.stack([legendre.legval(points, np.eye(l + 1)[l]) * (2 * l + 1) / 2.0 for l in degrees])
    return np.asarray(polynomials * weights @ functions)
