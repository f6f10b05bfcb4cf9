"""Parameterizations of a deforming surface by their coordinate flow q^u (paper Sec. II, Table 1).

The variational system imposes the scaling Lagrangian-Eulerian (SLE) choice h' = 0 by multipliers and needs none of these;
they express rates at fixed u for given flows, which is how the same functional is checked in other parameterizations.
"""

import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry
from shapespace.geometry.motion import Rates


def eulerian_rates(g: Geometry, v_n: Traced, dv_n: Traced, v_u: Traced, v_phi: Traced) -> Rates:
    """Rates for q^u = v^u: points move along the normal only (Eqs. dtrvn-dtpspvn)."""
    return Rates(jnp.sin(g.psi) * v_n, jnp.cos(g.psi) * v_n, -dv_n / g.h, g.dpsi * v_n, v_u, v_phi)


def lagrangian_rates(g: Geometry, v_n: Traced, dv_n: Traced, v_u: Traced, dv_u: Traced, v_phi: Traced) -> Rates:
    """Rates for q^u = 0: points move with the matter (Eqs. dtr, dtz, dth, dtpsi)."""
    return Rates(
        r=v_u * jnp.cos(g.psi) + v_n * jnp.sin(g.psi),
        z=-v_u * jnp.sin(g.psi) + v_n * jnp.cos(g.psi),
        psi=(v_u * g.dpsi - dv_n) / g.h,
        h=dv_u + v_n * g.dpsi,
        meridional_velocity=v_u,
        azimuthal_velocity=v_phi,
    )
