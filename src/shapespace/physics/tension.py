"""Isotropic tension: passive, or the multiplier of a constraint on area, local or total."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, area_element
from shapespace.geometry.motion import divergence
from shapespace.physics.term import AbstractEnergy, AbstractTerm, Ledger, Site


def tension_power(tension: Traced, site: Site) -> Traced:
    """gamma div(v) r h of an isotropic tension gamma [energy/length^2]."""
    return tension * divergence(site.geometry, site.rates, site.gradients) * area_element(site.geometry)


class IsotropicTension(AbstractEnergy):
    """Power gamma div(v) of a uniform passive tension gamma [energy/length^2] (Eq. rayldens).

    It differs from the rate of gamma r h at fixed u by the flux (gamma q r)', which moves gamma from alpha into P_v.

    Sphere: p = 2 gamma/R + kappa C0 (C0 R - 2)/R^2.
    """

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    tension: Traced

    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """gamma [energy/length^2]: the energy is gamma times the area."""
        return self.tension + 0.0 * geometry.r

    def power(self, site: Site) -> Traced:
        """gamma div(v) r h."""
        return tension_power(self.tension, site)


class Incompressibility(AbstractTerm):
    """Power gamma_H div(v); gamma_H is the multiplier whose variation gives div(v) = 0 (Sec. V A)."""

    ledger: ClassVar[Ledger] = Ledger.CONSTRAINT
    tension: Traced

    def power(self, site: Site) -> Traced:
        """gamma_H div(v) r h."""
        return tension_power(self.tension, site)


class FixedArea(AbstractTerm):
    """Power Sigma div(v) of a tension Sigma, one number, the multiplier of the total area: dA/dt = int div(v) dA.

    The area may flow along the surface. At rest nothing distinguishes it from a surface that is incompressible everywhere.
    Sphere: p = 2 Sigma/R + kappa C0 (C0 R - 2)/R^2, with Sigma undetermined, as no other shape has its area and volume.
    """

    ledger: ClassVar[Ledger] = Ledger.CONSTRAINT
    tension: Traced

    def power(self, site: Site) -> Traced:
        """Sigma div(v) r h."""
        return tension_power(self.tension, site)
