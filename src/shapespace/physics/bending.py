"""Helfrich bending energy with a spontaneous-curvature profile."""

from typing import ClassVar

import jax.numpy as jnp

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


class InducedBending(AbstractEnergy):
    """f = (kappa/2) (2H - C0 - coupling c)^2 + E_T c (ln(c/c0) - 1): a dilute species that bends the surface.

    The spontaneous curvature grows by coupling [1/(length concentration)] with c, whose mixing costs E_T = thermal_energy
    [energy/(length^2 concentration)] (Leibler, J. Phys. 47, 507 (1986)). `physics.species.CurvatureSpecies` has its flux.
    A sphere yields to l >= 2 where s_l (kappa coupling^2 + E_T/c) = (kappa coupling (l-1)(l+2)/R^2)^2, s_l its stiffness.
    """

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    rigidity: Traced
    spontaneous_curvature: Traced
    coupling: Traced
    thermal_energy: Traced
    reference: Traced

    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """Energy per area [energy/length^2]."""
        bend = total_curvature(geometry) - self.spontaneous_curvature - self.coupling * concentration
        mixing = self.thermal_energy * concentration * (jnp.log(concentration / self.reference) - 1.0)
        return 0.5 * self.rigidity * bend**2 + mixing

    def power(self, site: Site) -> Traced:
        """d/dt (f r h) along the motion, which carries the species."""
        return energy_power(self, site)
