"""The catalogue of what a law may look at, by name: symbol, dimension, value at a point, limit at a pole and its reason."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.base.units import Dimension
from shapespace.geometry.curve import azimuthal_curvature, meridional_curvature, total_curvature
from shapespace.geometry.motion import (
    axial_velocity,
    curvature_rate,
    divergence,
    normal_velocity,
    strain_rate,
    vorticity,
)
from shapespace.physics.term import Site

_CURVATURE, _RATE, _VELOCITY = Dimension(-1), Dimension(time=-1), Dimension(1, 0, -1)


class LocalQuantity(NamedTuple):
    """One entry. at_pole: the value where r = 0, None where `value` holds there too; is_motion: linear in the rates."""

    symbol: str
    meaning: str
    dimension: Dimension
    value: Callable[[Site], Traced]
    is_motion: bool = False
    at_pole: Callable[[Site], Traced] | None = None
    reason: str = ""


def _meridional_strain(site: Site) -> Traced:
    return strain_rate(site.geometry, site.rates, site.gradients).uu


LOCAL_QUANTITIES: dict[str, LocalQuantity] = {
    "radius": LocalQuantity("r", "distance from the axis", Dimension(1), lambda s: s.geometry.r),
    "tangent_angle": LocalQuantity("psi", "tangent angle", Dimension(), lambda s: s.geometry.psi),
    "material_area": LocalQuantity(
        "a", "cumulative area over 2 pi, a material label if incompressible", Dimension(2), lambda s: s.geometry.area
    ),
    "meridional_curvature": LocalQuantity(
        "C_u^u", "meridional curvature", _CURVATURE, lambda s: meridional_curvature(s.geometry)
    ),
    "azimuthal_curvature": LocalQuantity(
        "C_phi^phi",
        "azimuthal curvature",
        _CURVATURE,
        lambda s: azimuthal_curvature(s.geometry),
        at_pole=lambda s: meridional_curvature(s.geometry),
        reason="sin(psi)/r tends to psi'/h: all directions are alike at a pole",
    ),
    "total_curvature": LocalQuantity(
        "2 H",
        "sum of the principal curvatures",
        _CURVATURE,
        lambda s: total_curvature(s.geometry),
        at_pole=lambda s: 2.0 * meridional_curvature(s.geometry),
        reason="both principal curvatures are psi'/h",
    ),
    "gaussian_curvature": LocalQuantity(
        "K",
        "Gaussian curvature",
        Dimension(-2),
        lambda s: meridional_curvature(s.geometry) * azimuthal_curvature(s.geometry),
        at_pole=lambda s: meridional_curvature(s.geometry) ** 2,
        reason="both principal curvatures are psi'/h",
    ),
    "concentration": LocalQuantity("c", "concentration", Dimension(concentration=1), lambda s: s.concentration),
    "second_concentration": LocalQuantity(
        "c_2",
        "concentration of the second species",
        Dimension(concentration=1),
        lambda s: jnp.asarray(s.second_concentration),
    ),
    "concentration_gradient": LocalQuantity(
        "c'/h",
        "concentration per arc length",
        Dimension(-1, concentration=1),
        lambda s: s.concentration_slope / s.geometry.h,
        at_pole=lambda s: 0.0 * s.geometry.h,
        reason="an axisymmetric smooth field is even about the axis",
    ),
    "normal_velocity": LocalQuantity(
        "v_n", "velocity along the outward normal", _VELOCITY, lambda s: normal_velocity(s.geometry, s.rates), True
    ),
    "tangential_velocity": LocalQuantity(
        "v_u", "velocity along the meridian", _VELOCITY, lambda s: s.rates.meridional_velocity, True
    ),
    "azimuthal_velocity": LocalQuantity(
        "v_phi", "velocity about the axis", _VELOCITY, lambda s: s.rates.azimuthal_velocity, True
    ),
    "axial_velocity": LocalQuantity(
        "v_z", "velocity along the axis", _VELOCITY, lambda s: axial_velocity(s.geometry, s.rates), True
    ),
    "meridional_strain_rate": LocalQuantity("S_uu", "strain rate along the meridian", _RATE, _meridional_strain, True),
    "azimuthal_strain_rate": LocalQuantity(
        "S_phiphi",
        "strain rate about the axis",
        _RATE,
        lambda s: strain_rate(s.geometry, s.rates, s.gradients).phiphi,
        True,
        at_pole=_meridional_strain,
        reason="all directions are alike at a pole",
    ),
    "shear_strain_rate": LocalQuantity(
        "S_uphi",
        "strain rate of azimuthal against meridional motion",
        _RATE,
        lambda s: strain_rate(s.geometry, s.rates, s.gradients).uphi,
        True,
        at_pole=lambda s: 0.0 * s.geometry.h,
        reason="v_phi is odd in r, so that v_phi' and v_phi/r cancel",
    ),
    "vorticity": LocalQuantity(
        "n.curl v",
        "twice the rate of spinning about the normal",
        _RATE,
        lambda s: vorticity(s.geometry, s.rates, s.gradients),
        True,
        at_pole=lambda s: 2.0 * s.gradients.azimuthal_velocity / s.geometry.h,
        reason="v_phi is odd in r, so that v_phi' and v_phi/r are alike",
    ),
    "curvature_rate": LocalQuantity(
        "d(2H)/dt",
        "rate of change of the sum of the curvatures of the matter",
        Dimension(-1, 0, -1),
        lambda s: curvature_rate(s.geometry, s.rates, s.gradients),
        True,
        at_pole=lambda s: (
            2.0 * (s.gradients.turning / s.geometry.h - meridional_curvature(s.geometry) * _meridional_strain(s))
        ),
        reason="both principal curvatures are alike at a pole, and so are their rates",
    ),
    "divergence": LocalQuantity(
        "div v",
        "rate of change of area",
        _RATE,
        lambda s: divergence(s.geometry, s.rates, s.gradients),
        True,
        at_pole=lambda s: 2.0 * _meridional_strain(s),
        reason="both strain rates are alike at a pole",
    ),
}


def local_values(names: tuple[str, ...], site: Site, at_pole: bool = False) -> dict[str, Traced]:
    """The values of named quantities at a point, or their limits at a pole."""
    entries = {name: LOCAL_QUANTITIES[name] for name in names}
    return {
        name: jnp.asarray(entry.at_pole(site) if at_pole and entry.at_pole else entry.value(site))
        for name, entry in entries.items()
    }
