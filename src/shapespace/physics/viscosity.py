"""In-plane viscosity."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element
from shapespace.geometry.motion import strain_rate
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
