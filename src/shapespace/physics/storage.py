"""Energy stored in the total volume or area of a surface: elastic in place of fixed, so that the multiplier follows the size."""

from abc import abstractmethod

import equinox as eqx

from shapespace.base.arrays import Traced


class AbstractStorage(eqx.Module):
    """An energy E(X) of a total size X, whose derivative is the multiplier up to its sign."""

    @abstractmethod
    def size(self, multiplier: Traced) -> Traced:
        """The X at which the pressure p = -dE/dV, or the tension sigma = dE/dA, has this value."""

    @abstractmethod
    def energy(self, size: Traced) -> Traced:
        """E(X) [energy]."""


class OsmoticPressure(AbstractStorage):
    """E = K (V - V0)^2/(2 V0): the pressure K (1 - V/V0) that solutes exert, linear about the volume V0.

    modulus: K [energy/length^3], > 0; volume: V0. Sphere with tension gamma: 2 gamma/R = K (1 - R^3/R0^3).
    """

    modulus: Traced
    volume: Traced

    def size(self, multiplier: Traced) -> Traced:
        """V0 (1 - p/K)."""
        return self.volume * (1.0 - multiplier / self.modulus)

    def energy(self, size: Traced) -> Traced:
        """K (V - V0)^2/(2 V0)."""
        return 0.5 * self.modulus * (size - self.volume) ** 2 / self.volume


class AreaElasticity(AbstractStorage):
    """E = K (A - A0)^2/(2 A0): the tension K (A/A0 - 1) of a membrane that evens out its strain.

    modulus: K [energy/length^2], > 0; area: A0. Sphere under pressure p: p R/2 = K (R^2/R0^2 - 1).
    """

    modulus: Traced
    area: Traced

    def size(self, multiplier: Traced) -> Traced:
        """A0 (1 + sigma/K)."""
        return self.area * (1.0 + multiplier / self.modulus)

    def energy(self, size: Traced) -> Traced:
        """K (A - A0)^2/(2 A0)."""
        return 0.5 * self.modulus * (size - self.area) ** 2 / self.area
