"""The edge of a coat that is bound to matter: line tension, and a bending rigidity that differs inside."""

from typing import ClassVar

import jax

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, total_curvature
from shapespace.physics.patch import AbstractProfile
from shapespace.physics.term import AbstractEnergy, Ledger, Site, energy_power


class LineTension(AbstractEnergy):
    """f = r |tension'(a)|, a tension per length that is spread over the coat's edge (Lipowsky, J. Phys. II 2, 1825 (1992)).

    tension: profile over material area with the line tension [energy/length] inside, 0 outside; as |d tension/ds| = r
    |tension'(a)|, the energy is 2 pi r times the line tension where the edge is sharp.
    """

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    tension: AbstractProfile

    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """-r tension'(a): profiles of patches fall outwards [energy/length^2]."""
        return -geometry.r * jax.jvp(self.tension, (geometry.area,), (1.0 + 0.0 * geometry.area,))[1]

    def power(self, site: Site) -> Traced:
        """d/dt (f r h) along the motion."""
        return energy_power(self, site)


class BendingContrast(AbstractEnergy):
    """f = (excess/2) (2H - C0)^2: what a coat adds to the bending rigidity of the membrane below.

    excess: profile over material area [energy]; spontaneous_curvature: C0(a), that of the membrane's own bending energy.
    """

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    excess: AbstractProfile
    spontaneous_curvature: AbstractProfile

    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """(excess/2) (2H - C0)^2 [energy/length^2]."""
        bend = total_curvature(geometry) - self.spontaneous_curvature(geometry.area)
        return 0.5 * self.excess(geometry.area) * bend**2

    def power(self, site: Site) -> Traced:
        """d/dt (f r h) along the motion."""
        return energy_power(self, site)
