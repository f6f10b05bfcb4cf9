"""Linear dynamics of a sphere of radius R with concentration c0, in closed form, and states a little off the sphere.

Perturb R by a(t) P_l(cos theta) and c0 by b(t) P_l(cos theta). With the Hill law f = c^2/(c^2 + c_s^2), activity
z = (xi Delta mu)_0 f'(c0) and tension T = gamma + (xi Delta mu)_0 f(c0), and

    q = D l(l+1)/R^2 + k,    s = (l-1)(l+2) [T/R^2 + kappa l(l+1)/R^4],    g = l(l+1)/((l-1)(l+2) eta_s + Gamma R^2),

    d/dt (a, b) = [[-(R^2 s/4)(1/eta_b + g), -R z/(2 eta_b)], [c0 R s/(2 eta_b), c0 z/eta_b - q]] (a, b),    l >= 2,

and db/dt = (c0 z/eta_b - 2 D/R^2 - k) b for l = 1, where a is a translation.
"""

from collections.abc import Mapping

import numpy as np
from numpy.polynomial import chebyshev, legendre
from tests.surfaces import State, fields_at

from shapespace.base.arrays import Array
from shapespace.numerics.state import state_from_functions
from shapespace.study.engine import Engine


def active_tension(v: Mapping[str, float]) -> tuple[float, float]:
    """T and z of a sphere at c0."""
    c0, c_s = v["reference_concentration"], v["saturation_concentration"]
    hill, slope = c0**2 / (c0**2 + c_s**2), 2.0 * c0 * c_s**2 / (c0**2 + c_s**2) ** 2
    return v["tension"] + v["active_tension"] * hill, v["active_tension"] * slope


def pressure(v: Mapping[str, float]) -> float:
    """2 T/R + kappa C0 (C0 R - 2)/R^2."""
    radius, c_0 = v["sphere_radius"], v["spontaneous_curvature"]
    return 2.0 * active_tension(v)[0] / radius + v["bending_rigidity"] * c_0 * (c_0 * radius - 2.0) / radius**2


def polar_rate(v: Mapping[str, float]) -> float:
    """Growth rate of l = 1."""
    exchange = 2.0 * v["diffusivity"] / v["sphere_radius"] ** 2 + v["turnover_rate"]
    return v["reference_concentration"] * active_tension(v)[1] / v["bulk_viscosity"] - exchange


def rate_matrix(l: int, v: Mapping[str, float]) -> Array:
    """The 2x2 matrix of (a, b) for l >= 2, at C0 = 0."""
    radius, eta_b, c0 = v["sphere_radius"], v["bulk_viscosity"], v["reference_concentration"]
    tension, z = active_tension(v)
    q = v["diffusivity"] * l * (l + 1) / radius**2 + v["turnover_rate"]
    s = (l - 1) * (l + 2) * (tension / radius**2 + v["bending_rigidity"] * l * (l + 1) / radius**4)
    g = l * (l + 1) / ((l - 1) * (l + 2) * v["shear_viscosity"] + v["friction"] * radius**2)
    return np.array(
        [
            [-(radius**2 * s / 4.0) * (1.0 / eta_b + g), -radius * z / (2.0 * eta_b)],
            [c0 * radius * s / (2.0 * eta_b), c0 * z / eta_b - q],
        ]
    )


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
