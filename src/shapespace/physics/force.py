"""External forces: an axial force density on a patch, and pressure."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element
from shapespace.geometry.motion import axial_velocity, normal_velocity
from shapespace.physics.patch import AbstractProfile
from shapespace.physics.term import AbstractTerm, Ledger, Site


class AxialForce(AbstractTerm):
    """Power -f_z(a) v . e_z of an axial force density bound to matter (Eq. pullforce). density: f_z(a) [energy/length^3]."""

    ledger: ClassVar[Ledger] = Ledger.EXTERNAL
    density: AbstractProfile

    def power(self, site: Site) -> Traced:
        """-f_z v . e_z r h."""
        g = site.geometry
        return -self.density(g.area) * axial_velocity(g, site.rates) * area_element(g)


class Pressure(AbstractTerm):
    """Power -p v_n of the pressure difference p [energy/length^3], the multiplier of the enclosed volume (Sec. IV E)."""

    ledger: ClassVar[Ledger] = Ledger.CONSTRAINT
    pressure: Traced

    def power(self, site: Site) -> Traced:
        """-p v_n r h."""
        return -self.pressure * normal_velocity(site.geometry, site.rates) * area_element(site.geometry)
