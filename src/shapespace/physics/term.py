"""What a term of the Rayleigh functional is, and what it may look at.

Densities are per du and per 2 pi, that is, they include the area element r h (paper Eq. rayldens).
"""

from abc import abstractmethod
from enum import StrEnum
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, area_element
from shapespace.geometry.motion import Rates, coordinate_flow, divergence


class Site(NamedTuple):
    """Everything known at one point of the surface: shape, rates w, their gradients w' = dw/du, concentration c, c'.

    second_concentration: of a second species. bending: the bending moment P_psi/r and its slope, where a flux asks for them.
    """

    geometry: Geometry
    rates: Rates
    gradients: Rates
    concentration: Traced
    concentration_slope: Traced | float = 0.0
    second_concentration: Traced | float = 0.0
    bending: Traced | float = 0.0
    bending_slope: Traced | float = 0.0


class Ledger(StrEnum):
    """Where a power is booked in the energy law dF/dt + 2 D = external + chemical; D has channels (exact result 5)."""

    ENERGY = "energy"
    SHEAR = "shear_dissipation"
    BULK = "bulk_dissipation"
    BENDING = "bending_dissipation"
    FRICTION = "friction_dissipation"
    REACTION = "chemical_dissipation"
    EXTERNAL = "external"
    CHEMICAL = "chemical"
    CONSTRAINT = "constraint"
    RATE = "reaction_rate"
    """No power: the term only says how fast a reaction goes."""


CHANNELS = (Ledger.SHEAR, Ledger.BULK, Ledger.BENDING, Ledger.FRICTION, Ledger.REACTION)
"""Where work turns into heat: twice what is booked there, temperature times the entropy produced."""


class AbstractTerm(eqx.Module):
    """One contribution to the Rayleigh functional. `ledger` is a class attribute of each final term."""

    ledger: eqx.AbstractClassVar[Ledger]

    @abstractmethod
    def power(self, site: Site) -> Traced:
        """Power density times r h [energy/time]: linear in the rates, or quadratic (half the dissipation) if dissipative."""


class AbstractReacting(AbstractTerm):
    """A term that knows how fast the reaction goes that it stands for."""

    @abstractmethod
    def reaction_rate(self, site: Site) -> Traced:
        """r_p r h [1/time]."""


class AbstractEnergy(AbstractTerm):
    """A free energy: final classes give its density; `energy_power` is its rate of change along any motion."""

    @abstractmethod
    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """Energy per area [energy/length^2]."""


def energy_power(energy: AbstractEnergy, site: Site) -> Traced:
    """d/dt at fixed u of (f r h), a directional derivative along the rates (Eqs. dtFequi, dtfk).

    The cumulative area of an incompressible surface is a material label, so at fixed u it changes by -h q^u r. The species
    is carried along and diluted, so that c changes by -q^u c' - c div v; what diffusion and turnover change is no motion.
    """
    g, w = site.geometry, site.rates
    direction = Geometry(w.r, w.psi, site.gradients.psi, w.h, -coordinate_flow(g, w) * g.r)
    at, along = (g, site.concentration), (direction, carried_rate(site))
    return jax.jvp(lambda x, c: energy.density(x, c) * area_element(x), at, along)[1]


def carried_rate(site: Site) -> Traced:
    """dc/dt at fixed u of a species that is carried along and diluted: -q^u c' - c div v."""
    g, w = site.geometry, site.rates
    slope = jnp.asarray(site.concentration_slope)
    return -coordinate_flow(g, w) * slope / g.h - site.concentration * divergence(g, w, site.gradients)
