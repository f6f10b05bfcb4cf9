"""Viscosity: in the plane of the surface, and against bending."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element
from shapespace.geometry.motion import curvature_rate, strain_rate
from shapespace.physics.term import AbstractTerm, Ledger, Site


class ShearViscosity(AbstractTerm):
    """(eta_s/2) [(S_uu - S_phiphi)^2 + (2 S_uphi)^2], half of S_2 (Eq. rayldens). viscosity: eta_s [energy time/length^2]."""

    ledger: ClassVar[Ledger] = Ledger.SHEAR
    viscosity: Traced

    def power(self, site: Site) -> Traced:
        """Half the dissipation rate times r h."""
        s = strain_rate(site.geometry, site.rates, site.gradients)
        return 0.5 * self.viscosity * ((s.uu - s.phiphi) ** 2 + (2.0 * s.uphi) ** 2) * area_element(site.geometry)


class BulkViscosity(AbstractTerm):
    """(eta_b/2) (div v)^2, half of S_1 (Eq. rayldens). viscosity: eta_b [energy time/length^2]."""

    ledger: ClassVar[Ledger] = Ledger.BULK
    viscosity: Traced

    def power(self, site: Site) -> Traced:
        """Half the dissipation rate times r h."""
        s = strain_rate(site.geometry, site.rates, site.gradients)
        return 0.5 * self.viscosity * (s.uu + s.phiphi) ** 2 * area_element(site.geometry)


class BendingViscosity(AbstractTerm):
    """(eta_c/2) (d(2H)/dt)^2 with the rate of the matter. viscosity: eta_c [energy time], > 0.

    Sphere: a mode l that changes 2H by (l-1)(l+2)/R^2 per amplitude is slowed as by friction eta_c (l-1)^2 (l+2)^2/R^4
    along the normal. The surface must have the rate `turning` as an unknown.
    """

    ledger: ClassVar[Ledger] = Ledger.BENDING
    viscosity: Traced

    def power(self, site: Site) -> Traced:
        """Half the dissipation rate times r h."""
        rate = curvature_rate(site.geometry, site.rates, site.gradients)
        return 0.5 * self.viscosity * rate**2 * area_element(site.geometry)
