"""Isotropic tension: passive, active, or the multiplier of incompressibility."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, area_element
from shapespace.geometry.motion import divergence
from shapespace.physics.term import AbstractEnergy, AbstractTerm, Ledger, Site


class IsotropicTension(AbstractEnergy):
    """Power gamma div(v) of a uniform passive tension gamma [energy/length^2] (Eq. rayldens).

    It differs from the rate of gamma r h at fixed u by the flux (gamma q r)', which moves gamma from alpha into P_v.

    Sphere: p = 2 gamma/R + kappa C0 (C0 R - 2)/R^2.
    """

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    tension: Traced

    def density(self, geometry: Geometry) -> Traced:
        """gamma [energy/length^2]: the energy is gamma times the area."""
        return self.tension + 0.0 * geometry.r

    def power(self, site: Site) -> Traced:
        """gamma div(v) r h."""
        return self.tension * divergence(site.geometry, site.rates, site.gradients) * area_element(site.geometry)


class Incompressibility(AbstractTerm):
    """Power gamma_H div(v); gamma_H is the multiplier whose variation gives div(v) = 0 (Sec. V A)."""

    ledger: ClassVar[Ledger] = Ledger.CONSTRAINT
    tension: Traced

    def power(self, site: Site) -> Traced:
        """gamma_H div(v) r h."""
        return self.tension * divergence(site.geometry, site.rates, site.gradients) * area_element(site.geometry)
