"""Laws that users write: functions of named local quantities and parameters, as terms of the Rayleigh functional.

The arguments of a function say what it depends on: names of the catalogue (`quantities.py`), all else parameters of the
model. Densities are per area; a dissipation is the heat per area and time, of which the functional takes half.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import equinox as eqx

from shapespace.base.arrays import Array, Traced
from shapespace.geometry.curve import Geometry, area_element
from shapespace.geometry.motion import Rates
from shapespace.physics.quantities import LOCAL_QUANTITIES, local_values
from shapespace.physics.term import (
    CHANNELS,
    AbstractEnergy,
    AbstractReacting,
    AbstractTerm,
    Ledger,
    Site,
    energy_power,
)

LawFunction = Callable[..., Traced]


@dataclass(frozen=True)
class Law:
    """One law: its function, and where its power is booked. Make it with `energy`, `dissipation`, `power` or `linear_laws`.

    check: what else must hold, given the local quantities at sample points and the parameters; ValueError if it does not.
    """

    function: LawFunction
    ledger: Ledger
    check: Callable[[Mapping[str, Array], Mapping[str, float]], None] | None = None

    @property
    def name(self) -> str:
        """Of the function."""
        return self.function.__name__

    @property
    def arguments(self) -> tuple[str, ...]:
        """What the function depends on."""
        return tuple(inspect.signature(self.function).parameters)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The local quantities among its arguments."""
        return tuple(name for name in self.arguments if name in LOCAL_QUANTITIES)

    @property
    def constants(self) -> tuple[str, ...]:
        """The parameters among its arguments."""
        return tuple(name for name in self.arguments if name not in LOCAL_QUANTITIES)

    def term(self, parameters: Any) -> AbstractTerm:
        """The term with the values of its parameters, given by name."""
        values = {name: getattr(parameters, name) for name in self.constants}
        if self.ledger is Ledger.ENERGY:
            return LawEnergy(self.function, self.quantities, values)
        if self.ledger is Ledger.RATE:
            return LawRate(self.function, self.quantities, values)
        return _POWERS[self.ledger](self.function, self.quantities, values)


class LawEnergy(AbstractEnergy):
    """A free energy per area from a function of the shape and the concentration."""

    ledger: ClassVar[Ledger] = Ledger.ENERGY
    function: LawFunction = eqx.field(static=True)
    quantities: tuple[str, ...] = eqx.field(static=True)
    constants: Mapping[str, Traced]

    def density(self, geometry: Geometry, concentration: Traced | float = 0.0) -> Traced:
        """The function's value [energy/length^2]."""
        still = Rates(*[0.0 * geometry.r] * 6)
        site = Site(geometry, still, still, concentration + 0.0 * geometry.r)
        return self.function(**local_values(self.quantities, site), **self.constants) + 0.0 * geometry.r

    def power(self, site: Site) -> Traced:
        """d/dt (f r h) along the motion."""
        return energy_power(self, site)


class AbstractLawPower(AbstractTerm):
    """Half a dissipation, or the negative of a power that is supplied, per area times r h."""

    function: LawFunction = eqx.field(static=True)
    quantities: tuple[str, ...] = eqx.field(static=True)
    constants: Mapping[str, Traced]

    def power(self, site: Site) -> Traced:
        """The function's share of the functional."""
        share = 0.5 if self.ledger in CHANNELS else -1.0
        value = self.function(**local_values(self.quantities, site), **self.constants)
        return share * value * area_element(site.geometry)


class LawRate(AbstractReacting):
    """How fast a reaction goes, per area: what it does to the surface is in other terms."""

    ledger: ClassVar[Ledger] = Ledger.RATE
    function: LawFunction = eqx.field(static=True)
    quantities: tuple[str, ...] = eqx.field(static=True)
    constants: Mapping[str, Traced]

    def power(self, site: Site) -> Traced:
        """None."""
        return 0.0 * site.geometry.r

    def reaction_rate(self, site: Site) -> Traced:
        """The function's value times r h."""
        return self.function(**local_values(self.quantities, site), **self.constants) * area_element(site.geometry)


def _power_class(booked: Ledger) -> type[AbstractLawPower]:
    class LawPower(AbstractLawPower):
        ledger: ClassVar[Ledger] = booked

    return LawPower


_POWERS = {booked: _power_class(booked) for booked in (*CHANNELS, Ledger.EXTERNAL, Ledger.CHEMICAL)}


def energy(function: LawFunction) -> Law:
    """A free energy per area [E/L^2] of curvatures, material area and concentration."""
    return Law(function, Ledger.ENERGY)


def dissipation(channel: str) -> Callable[[LawFunction], Law]:
    """Heat per area and time [E/(L^2 T)], quadratic in velocities and strain rates.

    channel: shear, bulk, bending, friction or chemical.
    """
    ledgers = {ledger.value.removesuffix("_dissipation"): ledger for ledger in CHANNELS}
    if channel not in ledgers:
        raise ValueError(f"channel = {channel!r}: is none of the dissipation; choose one of {', '.join(ledgers)}.")
    return lambda function: Law(function, ledgers[channel])


def power(source: str) -> Callable[[LawFunction], Law]:
    """Power per area [E/(L^2 T)] into the surface, linear in velocities and strain rates. source: external or chemical."""
    ledgers = {"external": Ledger.EXTERNAL, "chemical": Ledger.CHEMICAL}
    if source not in ledgers:
        raise ValueError(f"source = {source!r}: supplies no power; choose one of {', '.join(ledgers)}.")
    return lambda function: Law(function, ledgers[source])
