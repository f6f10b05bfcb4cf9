"""The constrained Rayleigh functional and its first variation over the rates (paper Sec. IV E, Eq. Rbar).

With the density R(w, w'; y) per du and per 2 pi, the variation over a rate w_i reads P_i' = dR/dw_i with the flux
P_i = dR/dw_i'. Fluxes are fields of the first-order system: P_r = alpha, P_z = beta (the multipliers of the geometric
relations), P_psi = r times the bending moment, P_v = r T_uu. Both derivatives are one gradient of the scalar density.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.motion import Rates, turning_rate
from shapespace.physics.term import AbstractTerm, Ledger, Site


class Multipliers(NamedTuple):
    """alpha and beta, the Lagrange multipliers of r' = h cos psi and z' = -h sin psi [energy/length/time per rate].

    turning: that of turning = dpsi/dt + q^u psi', where that rate is an unknown.
    """

    radial: Traced
    axial: Traced
    turning: Traced | float = 0.0


class Variation(NamedTuple):
    """`force` = dR/dw and `flux` = dR/dw', both over the rates."""

    force: Rates
    flux: Rates


def density(terms: tuple[AbstractTerm, ...], site: Site) -> Traced:
    """R per du and per 2 pi: the sum of all powers."""
    return sum((term.power(site) for term in terms), start=jnp.zeros(()))


def constraint_power(multipliers: Multipliers, site: Site) -> Traced:
    """d/dt of alpha (r' - h cos psi) + beta (z' + h sin psi) at fixed multipliers (Eq. Lmultiplier).

    The SLE multiplier zeta of h' = 0 vanishes identically (App. E), which the gauge alpha(0) = 0 replaces.
    """
    g, w, dw = site.geometry, site.rates, site.gradients
    cos, sin = jnp.cos(g.psi), jnp.sin(g.psi)
    radial = dw.r - w.h * cos + g.h * sin * w.psi
    axial = dw.z + w.h * sin + g.h * cos * w.psi
    turning = w.turning - turning_rate(g, w)
    return multipliers.radial * radial + multipliers.axial * axial + multipliers.turning * turning


def variation(terms: tuple[AbstractTerm, ...], multipliers: Multipliers, site: Site) -> Variation:
    """First variation of the constrained density at one point."""

    def constrained(w: Rates, dw: Rates) -> Traced:
        moved = site._replace(rates=w, gradients=dw)
        return density(terms, moved) + constraint_power(multipliers, moved)

    return Variation(*jax.grad(constrained, argnums=(0, 1))(site.rates, site.gradients))


def booked_power(terms: tuple[AbstractTerm, ...], ledger: Ledger, site: Site) -> Traced:
    """The part of the density that belongs to one ledger of the energy law."""
    return density(tuple(term for term in terms if term.ledger is ledger), site)
