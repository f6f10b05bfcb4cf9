"""Leaning spheroids in closed form: r = a sin t (1 + e cos t), z = c cos t for t in [0, pi], from pole to pole.

e = 0 is a spheroid, prolate for c > a; e != 0 is an egg, wider towards u = 0 for e > 0. Near a sphere the elongation is the
harmonic l = 2, the leaning l = 3 and a shift.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from shapespace.base.arrays import Array

ORDER = 400
"""Of the quadrature and of the arc length's interpolation: round-off down to elongations of some hundred."""
LARGEST_ELONGATION = 1e3


@cache
def _quadrature() -> tuple[Array, Array]:
    """Gauss points and weights on [-1, 1], made when they are needed."""
    return np.polynomial.legendre.leggauss(ORDER)


@dataclass(frozen=True)
class Spheroid:
    """One such surface: equatorial radius a, polar half axis c [length], leaning e in (-1, 1)."""

    equatorial: float
    polar: float
    leaning: float = 0.0

    @classmethod
    def of(cls, area: float, volume: float, oblate: bool = False, leaning: float = 0.0) -> "Spheroid":
        """The one with this area and volume, long or flat. ValueError where there is none."""
        # Imported late: it takes half a second, and most surfaces are none.
        from scipy.optimize import brentq

        reduced = 6.0 * np.sqrt(np.pi) * volume / area**1.5

        def excess(logarithm: float) -> float:
            return cls(1.0, float(np.exp(logarithm)), leaning).reduced_volume - reduced

        end = -np.log(LARGEST_ELONGATION) if oblate else np.log(LARGEST_ELONGATION)
        if not excess(0.0) * excess(end) <= 0.0:
            raise ValueError(f"no spheroid has the reduced volume {reduced:g} and leaning {leaning:g}.")
        shape = cls(1.0, float(np.exp(brentq(excess, 0.0, end, xtol=1e-15, rtol=1e-14))), leaning)
        size = np.sqrt(area / shape.area)
        return cls(size, size * shape.polar, leaning)

    def outline(self, t: Array) -> tuple[Array, Array]:
        """(r, z)."""
        return self.equatorial * np.sin(t) * (1.0 + self.leaning * np.cos(t)), self.polar * np.cos(t)

    def slope(self, t: Array) -> tuple[Array, Array]:
        """(dr/dt, dz/dt)."""
        return self.equatorial * (np.cos(t) + self.leaning * np.cos(2.0 * t)), -self.polar * np.sin(t)

    def speed(self, t: Array) -> Array:
        """ds/dt [length]."""
        return np.hypot(*self.slope(t))

    def tangent_angle(self, t: Array) -> Array:
        """psi, from 0 to pi."""
        dr, dz = self.slope(t)
        return np.arctan2(np.maximum(-dz, 0.0), dr)

    def curvatures(self, t: Array) -> tuple[Array, Array]:
        """(psi'/h, sin(psi)/r) [1/length], equal at the poles."""
        dr, dz = self.slope(t)
        ddr, ddz = -self.equatorial * (np.sin(t) + 2.0 * self.leaning * np.sin(2.0 * t)), -self.polar * np.cos(t)
        # sin(psi)/r without the factor sin(t) that both have.
        azimuthal = self.polar / (self.equatorial * (1.0 + self.leaning * np.cos(t)) * self.speed(t))
        return (dz * ddr - dr * ddz) / self.speed(t) ** 3, azimuthal

    @property
    def area(self) -> float:
        """2 pi int r ds."""
        points, weights = _quadrature()
        t = 0.5 * np.pi * (points + 1.0)
        return float(np.pi**2 * (weights @ (self.outline(t)[0] * self.speed(t))))

    @property
    def volume(self) -> float:
        """-pi int r^2 dz = (4 pi/3) a^2 c (1 + e^2/5)."""
        return 4.0 * np.pi / 3.0 * self.equatorial**2 * self.polar * (1.0 + 0.2 * self.leaning**2)

    @property
    def reduced_volume(self) -> float:
        """V/(4 pi/3 (A/4 pi)^(3/2))."""
        return float(6.0 * np.sqrt(np.pi) * self.volume / self.area**1.5)

    @cached_property
    def _arc_length(self) -> Array:
        """s/pi as a Chebyshev series in 2 t/pi - 1."""

        def speed(x: Any) -> Any:  # numpy's annotation asks for a function of objects
            return self.speed(0.5 * np.pi * (x + 1.0))

        series = chebyshev.chebinterpolate(speed, ORDER)
        return np.asarray(0.5 * np.pi * chebyshev.chebint(series, lbnd=-1.0))

    @property
    def length(self) -> float:
        """Of the generating curve."""
        return float(chebyshev.chebval(1.0, self._arc_length))

    def parameter(self, u: Array) -> Array:
        """t at the share u of the arc length, by Newton's method."""
        t = np.pi * u
        for _ in range(50):
            miss = chebyshev.chebval(2.0 * t / np.pi - 1.0, self._arc_length) - self.length * u
            t = np.clip(t - miss / self.speed(t), 0.0, np.pi)
            if np.abs(miss).max() <= 1e-14 * self.length:
                break
        return np.where((u == 0.0) | (u == 1.0), np.pi * u, t)
