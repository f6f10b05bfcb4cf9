"""Exact results that the program must meet, in closed form: no line here uses a solver of the package.

The linear dynamics of a sphere of radius R with concentration c0: perturb R by a(t) P_l(cos theta) and c0 by
b(t) P_l(cos theta). With the Hill law f = c^2/(c^2 + c_s^2), activity z = (xi Delta mu)_0 f'(c0) and tension
T = gamma + (xi Delta mu)_0 f(c0), and

    q = D l(l+1)/R^2 + k,    s = (l-1)(l+2) [T/R^2 + kappa l(l+1)/R^4],    g = l(l+1)/((l-1)(l+2) eta_s + Gamma R^2),

    d/dt (a, b) = [[-(R^2 s/4)(1/eta_b + g), -R z/(2 eta_b)], [c0 R s/(2 eta_b), c0 z/eta_b - q]] (a, b),    l >= 2,

and db/dt = (c0 z/eta_b - 2 D/R^2 - k) b for l = 1, where a is a translation.
"""

from collections.abc import Mapping

import numpy as np
from scipy.special import i0, i1, jn_zeros, k0, k1

from shapespace.base.arrays import Array


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


def sphere_rates(v: Mapping[str, float], last: int) -> list[tuple[int, complex]]:
    """(l, growth rate) of the sphere for l = 0 (turnover) to `last`, largest real part first."""
    rates = [(0, complex(-v["turnover_rate"])), (1, complex(polar_rate(v)))]
    rates += [(l, complex(s)) for l in range(2, last + 1) for s in np.linalg.eigvals(rate_matrix(l, v))]
    return sorted(rates, key=lambda pair: (-pair[1].real, -pair[1].imag))


def sphere_energy(radius: float, spontaneous_curvature: float, rigidity: float = 1.0) -> float:
    """8 pi kappa (1 - C0 R/2)^2: the bending energy of a sphere."""
    return 8.0 * np.pi * rigidity * (1.0 - 0.5 * spontaneous_curvature * radius) ** 2


def polar_onset(saturation: float, exchange: float) -> float:
    """Pe* = (2 + k R^2/D)/(c0 f'(c0)) with c_s/c0 and k R^2/D: the sphere polarizes."""
    slope = 2.0 * saturation**2 / (1.0 + saturation**2) ** 2
    return (2.0 + exchange) / slope


def swimming_speed(v: Mapping[str, float], pattern: float) -> float:
    """-(R/2) (xi Delta mu)_0 f'(c0) dc/eta_b: the speed of a sphere with c = c0 + dc cos(theta)."""
    return -0.5 * v["sphere_radius"] * active_tension(v)[1] * pattern / v["bulk_viscosity"]


def buckling_tension(radius: float = 1.0, rigidity: float = 1.0) -> float:
    """-j_{1,1}^2 kappa/R_b^2 = -14.681970642: the clamped fluid disc buckles."""
    return -float(jn_zeros(1, 1)[0] ** 2) * rigidity / radius**2


def point_response(tension: float, radius: float = 1.0, rigidity: float = 1.0) -> float:
    """z0/F of a point force on the clamped disc: [-ln 2 + gamma_E + ln x + K0(x) - B (I0(x) - 1)]/(2 pi gamma), x = kR,
    k^2 = gamma/kappa, B = (1/x - K1(x))/I1(x).
    """
    x = np.sqrt(tension / rigidity) * radius
    b = (1.0 / x - k1(x)) / i1(x)
    return float((-np.log(2.0) + np.euler_gamma + np.log(x) + k0(x) - b * (i0(x) - 1.0)) / (2.0 * np.pi * tension))


def tube_radius(tension: float, curvature: float = 0.0, rigidity: float = 1.0) -> float:
    """1/sqrt(C0^2 + 2 gamma/kappa): of a long tube, bare or coated."""
    return float(1.0 / np.sqrt(curvature**2 + 2.0 * tension / rigidity))


def tether_force(tension: float, curvature: float = 0.0, rigidity: float = 1.0) -> float:
    """2 pi kappa (sqrt(C0^2 + 2 gamma/kappa) - C0): the pull on a long tube."""
    return float(2.0 * np.pi * rigidity * (1.0 / tube_radius(tension, curvature, rigidity) - curvature))
