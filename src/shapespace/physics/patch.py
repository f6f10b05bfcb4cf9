"""Profiles over material area: uniform, and the smooth patch used for coats and pulled regions."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp

from shapespace.base.arrays import Traced


class AbstractProfile(eqx.Module):
    """A quantity bound to matter, given as a function of cumulative area per 2 pi.

    The cumulative area is a material label on an incompressible surface only, whose system must have `material_area`.
    """

    @abstractmethod
    def __call__(self, area: Traced) -> Traced:
        """Value at cumulative area a [length^2 per 2 pi]."""


class Uniform(AbstractProfile):
    """The same value everywhere."""

    value: Traced

    def __call__(self, area: Traced) -> Traced:
        """value."""
        return self.value + 0.0 * area


class SmoothPatch(AbstractProfile):
    """value (1 - tanh(sharpness (a - patch_area)))/2: a patch around the apex (Eqs. scpara, pullforce)."""

    value: Traced
    patch_area: Traced
    sharpness: Traced

    def __call__(self, area: Traced) -> Traced:
        """Value at area a."""
        return 0.5 * self.value * (1.0 - jnp.tanh(self.sharpness * (area - self.patch_area)))


def patch_integral(patch_area: Traced, sharpness: Traced) -> Traced:
    """Integral over a in [0, inf) of (1 - tanh(sharpness (a - patch_area)))/2, that is log(1 + e^(2 s A))/(2 s)."""
    return jnp.logaddexp(0.0, 2.0 * sharpness * patch_area) / (2.0 * sharpness)
