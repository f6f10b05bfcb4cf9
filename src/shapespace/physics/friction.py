"""Friction with the surroundings."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element
from shapespace.geometry.motion import normal_velocity
from shapespace.physics.term import AbstractTerm, Ledger, Site


class TangentialFriction(AbstractTerm):
    """(Gamma/2) [v_u^2 + (v_phi - v_d)^2] (Eqs. fext, rayldens) against surroundings that turn with Omega about the axis.

    coefficient: Gamma [energy time/length^4]; rotation: Omega [1/time], v_d = Omega r (zero in the paper). A surface in
    rotating surroundings turns rigidly with them, v_phi = Omega r, which is exact on any shape.
    """

    ledger: ClassVar[Ledger] = Ledger.FRICTION
    coefficient: Traced
    rotation: Traced

    def power(self, site: Site) -> Traced:
        """Half the dissipation rate times r h."""
        g, w = site.geometry, site.rates
        slip = w.azimuthal_velocity - self.rotation * g.r
        return 0.5 * self.coefficient * (w.meridional_velocity**2 + slip**2) * area_element(g)


class NormalFriction(AbstractTerm):
    """(Gamma_n/2) v_n^2 against surroundings at rest. coefficient: Gamma_n [energy time/length^4].

    The only resistance that a flat piece of a surface has to being bent: viscosity in its plane has none.
    """

    ledger: ClassVar[Ledger] = Ledger.FRICTION
    coefficient: Traced

    def power(self, site: Site) -> Traced:
        """Half the dissipation rate times r h."""
        return 0.5 * self.coefficient * normal_velocity(site.geometry, site.rates) ** 2 * area_element(site.geometry)
