"""Motion of an axisymmetric surface: velocities from rates at fixed u, strain rates, coordinate flow.

All functions are linear in the rates. Velocity components refer to the unit vectors e_u/h, e_phi/r and n, in the lab frame.
"""

from typing import NamedTuple

import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, azimuthal_curvature, meridional_curvature


class Rates(NamedTuple):
    """Rates w at one u: d/dt at fixed u of r, z, psi, h, and the tangential velocities; also used for their u-derivatives.

    turning: d psi/dt of the matter, dpsi/dt + q^u psi', of surfaces that resist bending.
    """

    r: Traced
    z: Traced
    psi: Traced
    h: Traced
    meridional_velocity: Traced
    azimuthal_velocity: Traced
    turning: Traced | float = 0.0


class StrainRate(NamedTuple):
    """Components S_uu, S_phiphi, S_uphi of the strain-rate tensor in the unit basis [1/time] (Eqs. Suu-Sup)."""

    uu: Traced
    phiphi: Traced
    uphi: Traced


def normal_velocity(g: Geometry, w: Rates) -> Traced:
    """v_n = sin(psi) dr/dt + cos(psi) dz/dt [length/time] (Sec. IV E)."""
    return jnp.sin(g.psi) * w.r + jnp.cos(g.psi) * w.z


def coordinate_flow(g: Geometry, w: Rates) -> Traced:
    """h q^u = v_u + sin(psi) dz/dt - cos(psi) dr/dt [length/time]: flow of matter past the mesh (Eq. quryv)."""
    return w.meridional_velocity + jnp.sin(g.psi) * w.z - jnp.cos(g.psi) * w.r


def axial_velocity(g: Geometry, w: Rates) -> Traced:
    """v . e_z = v_n cos(psi) - v_u sin(psi) [length/time]."""
    return normal_velocity(g, w) * jnp.cos(g.psi) - w.meridional_velocity * jnp.sin(g.psi)


def strain_rate(g: Geometry, w: Rates, dw: Rates) -> StrainRate:
    """S_uu = v_u'/h + C_u^u v_n, S_phiphi = cos(psi) v_u/r + C_phi^phi v_n, S_uphi = (v_phi'/h - cos(psi) v_phi/r)/2."""
    v_n = normal_velocity(g, w)
    cot = jnp.cos(g.psi) / g.r
    return StrainRate(
        uu=dw.meridional_velocity / g.h + meridional_curvature(g) * v_n,
        phiphi=cot * w.meridional_velocity + azimuthal_curvature(g) * v_n,
        uphi=0.5 * (dw.azimuthal_velocity / g.h - cot * w.azimuthal_velocity),
    )


def turning_rate(g: Geometry, w: Rates) -> Traced:
    """d psi/dt of the matter: dpsi/dt + q^u psi' [1/time]."""
    return w.psi + coordinate_flow(g, w) * g.dpsi / g.h


def curvature_rate(g: Geometry, w: Rates, dw: Rates) -> Traced:
    """d(2H)/dt of the matter, from w.turning = d psi/dt of the matter [1/(length time)].

    With psi' and r' of the matter stretched by S: (turning' - psi' S_uu)/h + cos(psi) turning/r - C_phi^phi S_phiphi.
    """
    s = strain_rate(g, w, dw)
    meridional = dw.turning / g.h - meridional_curvature(g) * s.uu
    return meridional + jnp.cos(g.psi) / g.r * w.turning - azimuthal_curvature(g) * s.phiphi


def vorticity(g: Geometry, w: Rates, dw: Rates) -> Traced:
    """n . curl v = (r v_phi)'/(r h) [1/time]: twice the rate at which the matter spins about the normal."""
    return dw.azimuthal_velocity / g.h + jnp.cos(g.psi) / g.r * w.azimuthal_velocity


def divergence(g: Geometry, w: Rates, dw: Rates) -> Traced:
    """div v = tr S [1/time] (Eq. divvexp)."""
    s = strain_rate(g, w, dw)
    return s.uu + s.phiphi
