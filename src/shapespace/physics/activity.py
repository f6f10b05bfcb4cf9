"""Active isotropic tension regulated by a species."""

from typing import ClassVar

from shapespace.base.arrays import Traced
from shapespace.physics.tension import tension_power
from shapespace.physics.term import AbstractTerm, Ledger, Site


class ActiveTension(AbstractTerm):
    """Power xi Delta mu(c) div(v) with the Hill law xi Delta mu = amplitude c^2/(c^2 + c_s^2) (Eq. stresssc).

    The term is what eliminating the reaction rate r_p at fixed Delta mu leaves (physics/onsager.py).
    amplitude: (xi Delta mu)_0 [energy/length^2]; saturation: c_s [concentration].
    """

    ledger: ClassVar[Ledger] = Ledger.CHEMICAL
    amplitude: Traced
    saturation: Traced

    def tension(self, concentration: Traced) -> Traced:
        """xi Delta mu(c) [energy/length^2]."""
        return self.amplitude * concentration**2 / (concentration**2 + self.saturation**2)

    def power(self, site: Site) -> Traced:
        """xi Delta mu(c) div(v) r h."""
        return tension_power(self.tension(site.concentration), site)
