"""Helfrich bending energy with a spontaneous-curvature profile."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, total_curvature
from shapespace.physics.patch import AbstractProfile
from shapespace.physics.term import AbstractEnergy, Ledger, Site, energy_power


class HelfrichBending(AbstractEnergy):
    """f = (kappa/2) (2H - C0)^2 (Eq. fkappa), with C0 a function of material area.

    rigidity: kappa [energy]; spontaneous_curvature: profile C0(a) [1/length]. Sphere: 8 pi kappa (1 - C0 R/2)^2.
    """

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    rigidity: Traced
    spontaneous_curvature: AbstractProfile

    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """(kappa/2) (2H - C0)^2 [energy/length^2]."""
        return 0.5 * self.rigidity * (total_curvature(geometry) - self.spontaneous_curvature(geometry.area)) ** 2

    def power(self, site: Site) -> Traced:
        """d/dt (f r h) along the motion."""
        return energy_power(self, site)
