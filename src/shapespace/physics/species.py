"""A species on a moving surface: advection, dilution, diffusion, turnover (paper Eqs. particle, cdt).

In conservative form on the mesh, with n = c r h the amount per du and per 2 pi,

    dn/dt + N' = k (c0hat(u) - c) r h,     N = c r (h q^u) - D r c'/h,

which equals the advective form of Eq. (cdt) by d(r h)/dt + (r h q^u)' = r h div(v), and keeps the total amount exactly.
"""

from abc import abstractmethod
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element
from shapespace.geometry.motion import coordinate_flow
from shapespace.physics.term import Site


class AbstractReference(eqx.Module):
    """The concentration that turnover relaxes to, as a function of the mesh coordinate u."""

    @abstractmethod
    def __call__(self, u: Traced) -> Traced:
        """c0hat(u) [concentration]."""


class Ring(AbstractReference):
    """c0 [1 + amplitude exp(-(u - 1/2)^2/width^2)] (Eq. c0dyn); Table 5's width 0.02 is width^2 (reading notes)."""

    concentration: Traced
    amplitude: Traced
    width: Traced

    def __call__(self, u: Traced) -> Traced:
        """c0hat(u)."""
        return self.concentration * (1.0 + self.amplitude * jnp.exp(-(((u - 0.5) / self.width) ** 2)))


class Species(eqx.Module):
    """diffusivity D [length^2/time], turnover_rate k [1/time], reference c0hat(u) [concentration].

    Of two species the law of the second sees the two exchanged: `concentration` is always its own.
    """

    diffusivity: Traced
    turnover_rate: Traced
    reference: AbstractReference

    def amount(self, site: Site) -> Traced:
        """n = c r h."""
        return site.concentration * area_element(site.geometry)

    def flux(self, site: Site, slope: Traced) -> Traced:
        """N = c r (h q^u) - D r c'/h, slope = c'. Zero at a pole."""
        g = site.geometry
        return site.concentration * g.r * coordinate_flow(g, site.rates) - self.diffusivity * g.r * slope / g.h

    def source(self, site: Site, u: Traced) -> Traced:
        """k (c0hat(u) - c) r h."""
        return self.turnover_rate * (self.reference(u) - site.concentration) * area_element(site.geometry)


class ReactingSpecies(Species):
    """A species that also reacts with another: rate(c, c_2) [concentration/time] is added to its turnover.

    Two of them on a sphere that does not move are linearly stable against P_l where the eigenvalues of f - q D, f the
    Jacobian of the two rates, q = l(l+1)/R^2, are negative (Turing 1952).
    """

    rate: Callable[[Traced, Traced], Traced]

    def source(self, site: Site, u: Traced) -> Traced:
        """[k (c0hat(u) - c) + rate(c, c_2)] r h."""
        made = self.rate(site.concentration, jnp.asarray(site.second_concentration))
        return super().source(site, u) + made * area_element(site.geometry)


class CurvatureSpecies(Species):
    """A dilute species that bends the surface, with the flux that its energy (`physics.bending.InducedBending`) demands.

    Its chemical potential is mu = E_T ln(c/c0) - coupling b with b = kappa (2H - C0 - coupling c), the bending moment. The
    flux -(D c/E_T) grad mu along the surface is that of Fick, and (D c coupling/E_T) b'/h towards high moments.
    coupling: [1/(length concentration)]; thermal_energy: E_T [energy/(length^2 concentration)], > 0.
    """

    coupling: Traced
    thermal_energy: Traced

    def flux(self, site: Site, slope: Traced) -> Traced:
        """N = c r (h q^u) - D r c'/h + (D c coupling/E_T) r b'/h."""
        g, share = site.geometry, self.diffusivity * self.coupling / self.thermal_energy
        return super().flux(site, slope) + share * site.concentration * g.r * site.bending_slope / g.h
