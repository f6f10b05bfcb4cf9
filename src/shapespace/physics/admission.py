"""What a law must be to enter a model, tested before anything is computed: ValueError names the law and what is wrong."""

import difflib
import warnings
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.base.units import Dimension
from shapespace.geometry.curve import Geometry
from shapespace.geometry.motion import Rates
from shapespace.physics.laws import Law
from shapespace.physics.quantities import LOCAL_QUANTITIES, local_values
from shapespace.physics.smoothness import rough_place
from shapespace.physics.term import CHANNELS, Ledger, Site

SAMPLES = 64
TOLERANCE = 1e-8
"""Relative, of homogeneity: laws are evaluated to round-off."""
_POWER_DENSITY = Dimension(-2, 1, -1)
_UNIT_OF = {Ledger.ENERGY: (Dimension(-2, 1), "E/L^2"), Ledger.RATE: (Dimension(-2, 0, -1), "1/(L^2 T)")}
UNITS = (1.7, 0.6, 1.3, 2.1)
"""The old units of length, energy, time and concentration in other ones, as unlike as can be."""


def check_law(law: Law, values: Mapping[str, float], dimensions: Mapping[str, Dimension]) -> None:
    """ValueError unless the law is finite, poles included, of the right shape and unit, and obeys the second law.

    values, dimensions: of the model's parameters. Homogeneity: an energy depends on no motion, a dissipation is quadratic in
    it and never negative, a power linear. Tested on many shapes and motions that have nothing to do with each other.
    """
    unknown = [name for name in law.constants if name not in values]
    if unknown:
        names = [*LOCAL_QUANTITIES, *values]
        near = difflib.get_close_matches(unknown[0], names, n=1, cutoff=0.0)[0]
        raise ValueError(
            f"{law.name}: {unknown[0]} is neither a local quantity nor a parameter; the nearest is {near}."
        )
    moving = [name for name in law.quantities if LOCAL_QUANTITIES[name].is_motion]
    if law.ledger is Ledger.ENERGY and moving:
        raise ValueError(
            f"{law.name}: an energy cannot depend on the motion ({moving[0]}); make it a dissipation or power."
        )
    if law.ledger is Ledger.ENERGY and "concentration_gradient" in law.quantities:
        raise ValueError(f"{law.name}: an energy of concentration_gradient is not supported; use concentration.")
    local = local_values(law.quantities, _sites(), at_pole=False)
    arguments = {name: np.asarray(value) for name, value in local.items()}
    constants = {name: values[name] for name in law.constants}
    value = _finite(law, arguments, constants, "inside")
    for end, angle in enumerate((0.0, np.pi)):
        limits = local_values(law.quantities, _sites(pole=angle), at_pole=True)
        where = f"at the pole u = {end}, where radius = 0, tangent_angle = {angle:.3g} and all else has its limit"
        _finite(law, {name: np.asarray(v) for name, v in limits.items()}, constants, where)
    _check_motion(law, arguments, constants, value)
    _check_unit(law, arguments, constants, value, dimensions)
    check_second_law(law, values)
    _warn_where_rough(law, arguments, constants)


def check_second_law(law: Law, values: Mapping[str, float]) -> None:
    """ValueError where a law breaks reciprocity or the second law with these values of the parameters."""
    arguments = {name: np.asarray(v) for name, v in local_values(law.quantities, _sites()).items()}
    constants = {name: values[name] for name in law.constants}
    if law.check is not None:
        try:
            law.check(arguments, constants)
        except ValueError as error:
            raise ValueError(f"{law.name}: {error}") from None
    if law.ledger not in CHANNELS:
        return
    value = _finite(law, arguments, constants, "inside")
    if value.min() < -TOLERANCE * np.abs(value).max():
        given = ", ".join(f"{name} = {arguments[name][value.argmin()]:.3g}" for name in law.quantities)
        raise ValueError(
            f"{law.name}: breaks the second law: it is {value.min():.3g} < 0 at {given} with "
            f"{', '.join(f'{name} = {number:g}' for name, number in constants.items())}; a dissipation is never negative."
        )


def _warn_where_rough(law: Law, arguments: Mapping[str, Array], constants: Mapping[str, float]) -> None:
    """Warn of steps and kinks; ValueError where the function cannot be differentiated at all."""
    if not arguments:
        return
    try:
        place = rough_place(lambda **local: jnp.asarray(law.function(**local, **constants)), arguments)
    except (jax.errors.JAXTypeError, TypeError) as error:
        raise ValueError(
            f"{law.name}: cannot be differentiated ({str(error).splitlines()[0]}); write it with jax.numpy, without if."
        ) from None
    if place is not None:
        where = ", ".join(f"{name} = {value:.3g}" for name, value in place.items())
        warnings.warn(
            f"{law.name}: is not smooth: its value or slope jumps near {where}. Newton's method may fail there; round it off, "
            "e.g. sqrt(x^2 + small^2) for |x|, (1 + tanh(x/width))/2 for a step.",
            stacklevel=2,
        )


def _sites(pole: float | None = None) -> Site:
    """Unrelated shapes and motions (SAMPLES,), or such at the pole with this tangent angle."""
    rng = np.random.default_rng(0)

    def between(low: float, high: float) -> Traced:
        return jnp.asarray(rng.uniform(low, high, SAMPLES))

    r = between(0.4, 2.0) if pole is None else jnp.zeros(SAMPLES)
    psi = between(-np.pi, np.pi) if pole is None else jnp.full(SAMPLES, pole)
    shape = Geometry(r, psi, between(-2.0, 2.0), between(0.5, 3.0), between(0.0, 1.2))
    rates, gradients = (Rates(*(between(-2.0, 2.0) for _ in range(6))) for _ in range(2))
    if pole is not None:
        rates = rates._replace(r=r, meridional_velocity=r, azimuthal_velocity=r)
    return Site(shape, rates, gradients, between(0.2, 3.0), between(-2.0, 2.0))


def _finite(law: Law, arguments: Mapping[str, Array], constants: Mapping[str, float], where: str) -> Array:
    with np.errstate(all="ignore"):
        value = np.asarray(law.function(**arguments, **constants), dtype=float)
    if value.shape not in ((SAMPLES,), ()):
        raise ValueError(
            f"{law.name}: must return one number per point, came with shape {value.shape} for {SAMPLES} points."
        )
    if not np.isfinite(value).all():
        raise ValueError(f"{law.name}: is not finite {where}; write it so that it has a limit there.")
    return np.broadcast_to(value, (SAMPLES,))


def _check_motion(law: Law, arguments: Mapping[str, Array], constants: Mapping[str, float], value: Array) -> None:
    if law.ledger in (Ledger.ENERGY, Ledger.RATE):
        return
    degree = 2 if law.ledger in CHANNELS else 1
    faster = {name: (-3.0 if LOCAL_QUANTITIES[name].is_motion else 1.0) * given for name, given in arguments.items()}
    scaled = _finite(law, faster, constants, "at a faster motion")
    if not np.allclose(scaled, (-3.0) ** degree * value, rtol=TOLERANCE, atol=TOLERANCE * np.abs(value).max()):
        word = "quadratic in velocities and strain rates (a dissipation)" if degree == 2 else "linear in them (a power)"
        raise ValueError(
            f"{law.name}: must be {word}; at -3 times the motion it is not {(-3) ** degree} times as large."
        )


def _check_unit(
    law: Law,
    arguments: Mapping[str, Array],
    constants: Mapping[str, float],
    value: Array,
    dimensions: Mapping[str, Dimension],
) -> None:
    """In other units the law must give the same density: its number changes as its dimension says."""
    in_other = {name: given * _unit(LOCAL_QUANTITIES[name].dimension) for name, given in arguments.items()}
    scaled = law.function(**in_other, **{name: v * _unit(dimensions[name]) for name, v in constants.items()})
    wanted, unit = _UNIT_OF.get(law.ledger, (_POWER_DENSITY, "E/(L^2 T)"))
    if not np.allclose(scaled, _unit(wanted) * value, rtol=TOLERANCE, atol=TOLERANCE * np.abs(value).max()):
        given = ", ".join(law.constants)
        raise ValueError(
            f"{law.name}: its unit is not {unit}; check its powers of lengths and times, or the units of {given}."
        )


def _unit(dimension: Dimension) -> float:
    """The number that one old unit of a dimension is in other units."""
    return float(np.prod([u**n for u, n in zip(UNITS, dimension, strict=True)]))
