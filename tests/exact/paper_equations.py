"""The paper's explicit equations (main text, Apps. A-F), written by hand in plain NumPy.

Everything is a value at one or many points u. A leading d, dd, ddd means one, two, three derivatives over u; C0 is the
spontaneous curvature. Only r' = h cos(psi) is used; h may depend on u unless a docstring says otherwise. Names in
parentheses are the labels of the paper's equations. Misprints that were found are corrected, and marked "misprint".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Shape(NamedTuple):
    """Shape and spontaneous curvature with their derivatives over u."""

    r: Array
    psi: Array
    dpsi: Array
    ddpsi: Array
    dddpsi: Array
    h: Array
    dh: Array
    ddh: Array
    C0: Array
    dC0: Array
    ddC0: Array


class Flow(NamedTuple):
    """Centre-of-mass velocity in the unit basis with its derivatives over u."""

    v_n: Array
    dv_n: Array
    ddv_n: Array
    v_u: Array
    dv_u: Array
    ddv_u: Array
    v_phi: Array
    dv_phi: Array
    ddv_phi: Array


class Material(NamedTuple):
    """Constants, tensions gamma and active = xi Delta mu with their slopes, and external force densities."""

    kappa: float
    eta_s: float
    eta_b: float
    friction: float
    gamma: Array
    dgamma: Array
    active: Array
    dactive: Array
    f_n: Array
    f_u: Array
    f_phi: Array


class Tension(NamedTuple):
    """Components of a tension tensor in the unit basis and the slopes that its divergence needs."""

    uu: Array
    duu: Array
    pp: Array
    n: Array | float = 0.0
    dn: Array | float = 0.0
    up: Array | float = 0.0
    dup: Array | float = 0.0


# Laws of the two models.


def patch(value: float, patch_area: float, sharpness: float, area: Array) -> tuple[Array, Array, Array]:
    """(scpara, pullforce) value/2 (1 - tanh(sharpness (a - patch_area))) and two derivatives over a = A/(2 pi)."""
    t = np.tanh(sharpness * (area - patch_area))
    slope = 1 - t**2
    return value / 2 * (1 - t), -value / 2 * sharpness * slope, value * sharpness**2 * t * slope


def active_tension(amplitude: float, saturation: float, c: Array, dc: Array) -> tuple[Array, Array]:
    """(stresssc) xi Delta mu(c) = amplitude c^2/(c^2 + c_s^2) and its slope over u."""
    rest = c**2 + saturation**2
    return amplitude * c**2 / rest, 2 * amplitude * saturation**2 * c * dc / rest**2


def ring(c0: float, amplitude: float, width: float, u: Array) -> Array:
    """(c0dyn)."""
    return c0 * (1 + amplitude * np.exp(-((u - 0.5) ** 2) / width**2))


# Geometry.


def c_uu(s: Shape) -> tuple[Array, Array, Array]:
    """(Cijaxi) C_u^u = psi'/h with two derivatives."""
    first = s.ddpsi / s.h - s.dpsi * s.dh / s.h**2
    second = s.dddpsi / s.h - (2 * s.ddpsi * s.dh + s.dpsi * s.ddh) / s.h**2 + 2 * s.dpsi * s.dh**2 / s.h**3
    return s.dpsi / s.h, first, second


def cotangent(s: Shape) -> tuple[Array, Array]:
    """cos(psi)/r and its slope."""
    cot = np.cos(s.psi) / s.r
    return cot, -np.sin(s.psi) * s.dpsi / s.r - s.h * cot**2


def c_pp(s: Shape) -> tuple[Array, Array, Array]:
    """(Cijaxi) C_phi^phi = sin(psi)/r with two derivatives (Codazzi: C_phi^phi' = r'/r (C_u^u - C_phi^phi))."""
    meridional, dmeridional, _ = c_uu(s)
    cot, dcot = cotangent(s)
    value = np.sin(s.psi) / s.r
    first = s.h * cot * (meridional - value)
    return value, first, (s.dh * cot + s.h * dcot) * (meridional - value) + s.h * cot * (dmeridional - first)


def excess(s: Shape) -> tuple[Array, Array, Array]:
    """2H - C0 with two derivatives."""
    sums = [a + b for a, b in zip(c_uu(s), c_pp(s), strict=True)]
    return sums[0] - s.C0, sums[1] - s.dC0, sums[2] - s.ddC0


# Kinematics; w = v^u - q^u is contravariant.


def kinematics(s: Shape, f: Flow, w: Array, dw: Array) -> dict[str, Array]:
    """(dtr, dtz, dth, dtpsi, dtpsipr) rates at fixed u of r, z, h, psi and C_u^u.

    Misprint: dtpsipr has [w psi'/h]' where the advection w [psi'/h]' of a scalar belongs.
    """
    sin, cos = np.sin(s.psi), np.cos(s.psi)
    curvature, dcurvature, _ = c_uu(s)
    return {
        "r": w * s.h * cos + f.v_n * sin,
        "z": -w * s.h * sin + f.v_n * cos,
        "h": dw * s.h + w * s.dh + f.v_n * s.dpsi,
        "psi": w * s.dpsi - f.dv_n / s.h,
        "c_uu": w * dcurvature - curvature**2 * f.v_n - (f.ddv_n / s.h - f.dv_n * s.dh / s.h**2) / s.h,
    }


def strain_rate(s: Shape, f: Flow) -> tuple[Array, Array, Array]:
    """(Suu-Sup) S_uu, S_phiphi, S_uphi."""
    cot, _ = cotangent(s)
    uu = f.dv_u / s.h + s.dpsi / s.h * f.v_n
    pp = cot * f.v_u + np.sin(s.psi) / s.r * f.v_n
    return uu, pp, (f.dv_phi / s.h - cot * f.v_phi) / 2


def strain_rate_slopes(s: Shape, f: Flow) -> tuple[Array, Array, Array]:
    """Derivatives over u of (Suu-Sup), by the product rule."""
    cot, dcot = cotangent(s)
    (cu, dcu, _), (cp, dcp, _) = c_uu(s), c_pp(s)
    uu = f.ddv_u / s.h - f.dv_u * s.dh / s.h**2 + dcu * f.v_n + cu * f.dv_n
    pp = dcot * f.v_u + cot * f.dv_u + dcp * f.v_n + cp * f.dv_n
    return uu, pp, (f.ddv_phi / s.h - f.dv_phi * s.dh / s.h**2 - dcot * f.v_phi - cot * f.dv_phi) / 2


def divergence(s: Shape, f: Flow) -> Array:
    """(divvexp) (r v_u)'/(h r) + (psi'/h + sin(psi)/r) v_n."""
    transport = (s.h * np.cos(s.psi) * f.v_u + s.r * f.dv_u) / (s.h * s.r)
    return transport + (s.dpsi / s.h + np.sin(s.psi) / s.r) * f.v_n


# Bending energy density and its partial derivatives (HelfAxi).


def f_kappa(s: Shape, m: Material) -> dict[str, Array]:
    """Value of f_kappa and partial derivatives over psi, psi', h, C0."""
    x = excess(s)[0]
    return {
        "value": m.kappa / 2 * x**2,
        "psi": m.kappa * x * np.cos(s.psi) / s.r,
        "dpsi": m.kappa * x / s.h,
        "h": -m.kappa * x * s.dpsi / s.h**2,
        "C0": -m.kappa * x,
    }


# Tensions and their divergence.


def equilibrium_tension(s: Shape, m: Material) -> Tension:
    """(HelfTens)."""
    (cu, dcu, _), (cp, dcp, _), (_, dx, ddx) = c_uu(s), c_pp(s), excess(s)
    return Tension(
        uu=m.gamma + m.kappa / 2 * ((cp - s.C0) ** 2 - cu**2),
        duu=m.dgamma + m.kappa * ((cp - s.C0) * (dcp - s.dC0) - cu * dcu),
        pp=m.gamma + m.kappa / 2 * ((cu - s.C0) ** 2 - cp**2),
        n=m.kappa * dx / s.h,
        dn=m.kappa * (ddx / s.h - dx * s.dh / s.h**2),
    )


def dissipative_tension(s: Shape, f: Flow, m: Material) -> Tension:
    """(Tuu, Tpp, Tup)."""
    (uu, pp, up), (duu, dpp, dup) = strain_rate(s, f), strain_rate_slopes(s, f)
    return Tension(
        uu=m.eta_b * (uu + pp) + m.eta_s * (uu - pp) + m.active,
        duu=m.eta_b * (duu + dpp) + m.eta_s * (duu - dpp) + m.dactive,
        pp=m.eta_b * (uu + pp) - m.eta_s * (uu - pp) + m.active,
        up=2 * m.eta_s * up,
        dup=2 * m.eta_s * dup,
    )


def divergence_u(s: Shape, t: Tension) -> Array:
    """(divTu) e_u . div T."""
    return t.duu / s.h + cotangent(s)[0] * (t.uu - t.pp) + s.dpsi / s.h * t.n


def divergence_phi(s: Shape, t: Tension) -> Array:
    """(divTp) e_phi . div T of a symmetric tension."""
    return t.dup / s.h + 2 * cotangent(s)[0] * t.up


def divergence_n(s: Shape, t: Tension) -> Array:
    """(divTn) n . div T."""
    return t.dn / s.h + cotangent(s)[0] * t.n - s.dpsi / s.h * t.uu - np.sin(s.psi) / s.r * t.pp


def helfrich_divergence_u(s: Shape, m: Material) -> Array:
    """(divTeu) e_u . div T_e."""
    return (m.dgamma + f_kappa(s, m)["C0"] * s.dC0) / s.h


def helfrich_divergence_n(s: Shape, m: Material) -> Array:
    """(divTen) n . div T_e, the shape equation, term by term as printed."""
    sin, cos, k, r, h = np.sin(s.psi), np.cos(s.psi), m.kappa, s.r, s.h
    return (
        -(k * s.C0**2 / 2 + m.gamma) * (sin / r + s.dpsi / h)
        + 2 * k * s.C0 * sin / r * s.dpsi / h
        + s.dC0 * (k * s.dh / h**3 - k * cos / (h * r))
        - k * s.ddC0 / h**2
        + k * sin / (4 * r**3) * (3 + np.cos(2 * s.psi))
        - k * s.dpsi / (4 * h * r**2) * (1 + 3 * np.cos(2 * s.psi))
        - 2 * k * cos * s.dh * s.dpsi / (h**3 * r)
        + 3 * k * s.dh**2 * s.dpsi / h**5
        - k * s.ddh * s.dpsi / h**4
        - 3 * k * sin * s.dpsi**2 / (2 * h**2 * r)
        + k * s.dpsi**3 / (2 * h**3)
        + 2 * k * cos * s.ddpsi / (h**2 * r)
        - 3 * k * s.dh * s.ddpsi / h**4
        + k * s.dddpsi / h**3
    )


# Force balances.


def meridional_balance(s: Shape, f: Flow, m: Material) -> Array:
    """(varivu) the left-hand side, per area."""
    (uu, pp, _), (duu, dpp, _) = strain_rate(s, f), strain_rate_slopes(s, f)
    isotropic = m.eta_b * (duu + dpp) + m.eta_s * (duu - dpp) + m.dgamma + m.dactive
    shear = 2 * m.eta_s * (uu - pp) * cotangent(s)[0]
    return isotropic / s.h + shear - m.friction * f.v_u + m.f_u + f_kappa(s, m)["C0"] * s.dC0 / s.h


def azimuthal_balance(s: Shape, f: Flow, m: Material) -> Array:
    """(vphi) left minus right, per area. Misprint: it has eta for eta_s (and its Euler-Lagrange line + for -)."""
    up, dup = strain_rate(s, f)[2], strain_rate_slopes(s, f)[2]
    return 2 * m.eta_s / s.h * dup + 4 * m.eta_s * up * cotangent(s)[0] - m.friction * f.v_phi + m.f_phi


def normal_balance(s: Shape, f: Flow, m: Material) -> Array:
    """n . div(T_d + T_e) + f_n, per area. Misprint: App. E drops f_n where it states this balance."""
    return divergence_n(s, dissipative_tension(s, f, m)) + helfrich_divergence_n(s, m) + m.f_n


# The constrained functional (App. E 4 b), h' = 0.


def alpha_prime(s: Shape, f: Flow, m: Material) -> Array:
    """(alphaprime)."""
    td, te = dissipative_tension(s, f, m), equilibrium_tension(s, m)
    cu, cp, sin = s.dpsi / s.h, np.sin(s.psi) / s.r, np.sin(s.psi)
    normal = td.uu * cu + td.pp * cp + m.gamma * (cu + cp) - m.f_n
    coat = f_kappa(s, m)["C0"] * s.r * s.dC0 * np.cos(s.psi)
    return normal * s.r * s.h * sin + (te.pp - m.gamma) * s.h + coat


def beta_prime(s: Shape, f: Flow, m: Material) -> Array:
    """(betaprime)."""
    td = dissipative_tension(s, f, m)
    cu, cp = s.dpsi / s.h, np.sin(s.psi) / s.r
    normal = td.uu * cu + td.pp * cp + m.gamma * (cu + cp) - m.f_n
    return normal * s.r * s.h * np.cos(s.psi) - f_kappa(s, m)["C0"] * s.r * s.dC0 * np.sin(s.psi)


def moment(s: Shape, m: Material) -> Array:
    """r h df_kappa/dpsi', what (vardpsidt) differentiates."""
    return f_kappa(s, m)["dpsi"] * s.r * s.h


def moment_prime(s: Shape, m: Material, alpha: Array, beta: Array) -> Array:
    """(vardpsidt) [r h df_kappa/dpsi']' from the terms without derivative."""
    return f_kappa(s, m)["psi"] * s.r * s.h + alpha * s.h * np.sin(s.psi) + beta * s.h * np.cos(s.psi)


def ddpsi(s: Shape, m: Material, alpha: Array, beta: Array) -> Array:
    """(vardpsidt) solved for psi''."""
    shear = s.h * (alpha * np.sin(s.psi) + beta * np.cos(s.psi)) / (m.kappa * s.r)
    return s.h * (shear - c_pp(s)[1] + s.dC0)


def zeta_prime(s: Shape, m: Material, alpha: Array, beta: Array) -> Array:
    """(vardhdt) zeta'."""
    energy = f_kappa(s, m)
    return energy["h"] * s.r * s.h + energy["value"] * s.r - alpha * np.cos(s.psi) + beta * np.sin(s.psi)


def multipliers(s: Shape, m: Material) -> tuple[Array, Array]:
    """(alpha, beta)."""
    te, sin, cos = equilibrium_tension(s, m), np.sin(s.psi), np.cos(s.psi)
    return (te.n * sin + (te.uu - m.gamma) * cos) * s.r, (te.n * cos - (te.uu - m.gamma) * sin) * s.r


def multiplier_slopes(s: Shape, m: Material) -> tuple[Array, Array]:
    """Derivatives over u of (alpha, beta), by the product rule."""
    te, sin, cos = equilibrium_tension(s, m), np.sin(s.psi), np.cos(s.psi)
    plane, dplane, dr = te.uu - m.gamma, te.duu - m.dgamma, s.h * cos
    dnormal, dtangent = dr * te.n + s.r * te.dn, dr * plane + s.r * dplane
    dalpha = dnormal * sin + dtangent * cos + s.r * s.dpsi * (te.n * cos - plane * sin)
    return dalpha, dnormal * cos - dtangent * sin - s.r * s.dpsi * (te.n * sin + plane * cos)


def beta_balance(s: Shape, f: Flow, m: Material) -> Array:
    """(betaprime2) left minus right, per area: the normal balance."""
    td, te, tan = dissipative_tension(s, f, m), equilibrium_tension(s, m), np.tan(s.psi)
    cu, cp = s.dpsi / s.h, np.sin(s.psi) / s.r
    left = te.dn / s.h + cotangent(s)[0] * te.n - cp * te.uu - te.uu * cu
    left -= tan * (te.duu / s.h + te.n * cu - m.dgamma / s.h)
    return left - (td.uu * cu + td.pp * cp - m.f_n - f_kappa(s, m)["C0"] * s.dC0 / s.h * tan)


# Species.


class Species(NamedTuple):
    """Concentration with its derivatives over u, and the constants D, k and the reference c0hat(u)."""

    c: Array
    dc: Array
    ddc: Array
    diffusivity: float
    turnover: float
    reference: Array


def concentration_rate(s: Shape, f: Flow, q: Array, c: Species) -> Array:
    """(cdt) dc/dt at fixed u, with the Laplace-Beltrami operator (r c'/h)'/(r h)."""
    laplacian = c.ddc / s.h**2 - c.dc * s.dh / s.h**3 + cotangent(s)[0] * c.dc / s.h
    exchange = -c.turnover * (c.c - c.reference)
    return -q * c.dc - c.c * divergence(s, f) + c.diffusivity * laplacian + exchange


def coordinate_flow(s: Shape, f: Flow, r_t: Array, z_t: Array) -> Array:
    """(quryv) q^u, with v^u = v_u/h."""
    return (f.v_u + np.sin(s.psi) * z_t - np.cos(s.psi) * r_t) / s.h
