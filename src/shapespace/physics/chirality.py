"""Chirality: an active torque about the normal, which turns the matter one way."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element
from shapespace.geometry.motion import vorticity
from shapespace.physics.term import AbstractTerm, Ledger, Site


class ChiralTorque(AbstractTerm):
    """Power tau(c) (n . curl v)/2 of a torque tau = amplitude c/reference per area about the outward normal.

    It is an antisymmetric tension T_phiu - T_uphi = tau, whose divergence is the force -tau'/(2 h) along e_phi.
    amplitude: [energy/length^2]; reference: c0. Sphere: tau = tau_1 cos(theta) turns it as a whole at tau_1/(2 Gamma R^2),
    tau_2 cos(theta)^2 turns the halves against each other, v_phi = tau_2 R cos(theta) sin(theta)/(Gamma R^2 + 4 eta_s).
    """

    ledger: ClassVar[Ledger] = Ledger.CHEMICAL
    amplitude: Traced
    reference: Traced

    def power(self, site: Site) -> Traced:
        """-tau (n . curl v)/2 r h."""
        torque = self.amplitude * site.concentration / self.reference
        spin = 0.5 * vorticity(site.geometry, site.rates, site.gradients)
        return -torque * spin * area_element(site.geometry)
