"""Physical units: what the numbers of a scenario mean, the reading of values such as `20 pN nm`, and labels of results.

A scenario that declares units has one of length, energy, time and, where it matters, concentration; every plain number that
goes in or comes out is in these and their powers (a tension in pN/um, where length is in um and energy in pN um).
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from shapespace.base.errors import InputError

if TYPE_CHECKING:
    from pint import Quantity, UnitRegistry

THERMAL_ENERGY = "kT = boltzmann_constant * 298.15 kelvin = k_BT"
"""Beside the units of pint; at 25 degrees Celsius 4.116 pN nm. (Of pint's own prefixes and units kT would be a kilotesla.)"""

_OF = {"length": "[length]", "energy": "[energy]", "time": "[time]"}
_EXAMPLES = {"length": "um", "energy": "pN um", "time": "s", "concentration": "1/um^2"}
_FACTOR = re.compile(r"([^\W\d]+|%)(?:\^(-?\d{1,2}))?")
_MICRO = re.compile(r"(?<![A-Za-z])u(?=(?:m|s|g|N|M|J|Pa|l|L|mol)(?![A-Za-z]))")
_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*[*\s]?\s*(\S.*?)\s*")


class Dimension(NamedTuple):
    """Exponents of length, energy, time and concentration."""

    length: int = 0
    energy: int = 0
    time: int = 0
    concentration: int = 0


def read_factors(text: str) -> dict[str, int]:
    """The powers of the names in a product such as `E T/L^2`, `pN*um`, `1/(um s)`; ValueError where it is none."""
    plain = text.replace("**", "^").replace("²", "^2").replace("³", "^3").replace("·", " ").replace("*", " ")
    above, slash, below = (part.strip() for part in plain.partition("/"))
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    elif " " in below:
        raise ValueError("several units below the stroke need brackets")
    if not (below if slash else above):
        raise ValueError("nothing is named")
    powers: dict[str, int] = {}
    for part, sign in ((above, 1), (below, -1)):
        for factor in part.split():
            found = _FACTOR.fullmatch(factor)
            if found is None and factor != "1":
                raise ValueError(f"{factor} is no unit with a power")
            if found is not None:
                powers[found[1]] = powers.get(found[1], 0) + sign * int(found[2] or 1)
    return powers


def write_factors(powers: Iterable[tuple[str, int]]) -> str:
    """The product as text: `kappa tau/R0^2`, `1/(um s)`, `1`."""
    above: list[str] = []
    below: list[str] = []
    for name, power in powers:
        if power:
            (above if power > 0 else below).append(name if abs(power) == 1 else f"{name}^{abs(power)}")
    text = " ".join(above) or "1"
    return f"{text}/{' '.join(below) if len(below) == 1 else '(' + ' '.join(below) + ')'}" if below else text


def with_micro(text: str) -> str:
    """A unit as it is printed: micro, which files write u, as a Greek letter; powers with ^."""
    return _MICRO.sub("μ", text.replace("**", "^").replace("µ", "μ"))


def read_dimension(text: str) -> Dimension:
    """The dimension of a unit as the glossary writes it, `E T/L^2`, `1/L`, `1`. InputError where it is none."""
    letters = {"L": "length", "E": "energy", "T": "time", "C": "concentration"}
    try:
        return Dimension(**{letters[letter]: power for letter, power in read_factors(text).items()})
    except (ValueError, KeyError):
        raise InputError(f"unit = {text!r}: must be of L, E, T, C and their powers, e.g. E T/L^2.") from None


@dataclass(frozen=True)
class Units:
    """The units that a scenario declares; concentration may be left out. Made by `declare`, which checks what they are."""

    length: str
    energy: str
    time: str
    concentration: str = ""

    @classmethod
    def declare(cls, stated: Mapping[str, object]) -> Self:
        """The units in a [units] section. InputError names what is missing, unknown, or not of its kind."""
        for name, text in stated.items():
            if name not in _EXAMPLES:
                raise InputError(
                    f"{name} = {text!r}: is no unit that a file declares; [units] has {', '.join(_EXAMPLES)}."
                )
            if not isinstance(text, str) or not text.strip():
                raise InputError(f'{name} = {text!r}: must be a unit as text, e.g. {name} = "{_EXAMPLES[name]}".')
        for name in _OF:
            if name not in stated:
                raise InputError(f'{name}: is missing from [units]; add a line such as {name} = "{_EXAMPLES[name]}".')
        made = cls(**{name: str(text) for name, text in stated.items()})
        for name, text in made.as_dict().items():
            quantity = _quantity(name, text, text)
            if name in _OF and not quantity.check(_OF[name]):
                raise InputError(
                    f'{name} = {text!r}: is no unit of {name}; give one, e.g. {name} = "{_EXAMPLES[name]}".'
                )
        return made

    @classmethod
    def with_sizes(cls, stated: Mapping[str, object]) -> tuple[Self, dict[str, float]]:
        """The units in texts such as `10 um`, and the numbers before them (1 where there is none), which must be > 0."""
        found = {name: _VALUE.fullmatch(text) for name, text in stated.items() if isinstance(text, str)}
        sizes = {name: float(one[1]) for name, one in found.items() if one}
        for name, size in sizes.items():
            if size <= 0.0:
                raise InputError(f"{name} = {stated[name]!r}: must be > 0; give the size of the present unit.")
        declared = {
            name: one[2].replace("/", "1/", 1) if one[2].startswith("/") else one[2]
            for name, one in found.items()
            if one
        }
        return cls.declare(dict(stated) | declared), sizes

    def as_dict(self) -> dict[str, str]:
        """What was declared."""
        return {one.name: text for one in fields(self) if (text := getattr(self, one.name))}

    def label(self, dimension: Dimension) -> str:
        """The unit of a dimension as text: `pN/um`, `1`."""
        powers: dict[str, int] = {}
        for base in ("energy", "length", "time", "concentration"):
            if not (exponent := getattr(dimension, base)):
                continue
            for name, power in read_factors(getattr(self, base) or "concentration").items():
                powers[name] = powers.get(name, 0) + exponent * power
        return write_factors(powers.items())

    def read(self, name: str, text: str, dimension: Dimension) -> float:
        """The number that a value with a unit is in the declared units. InputError names the key, the value and the unit due."""
        found = _VALUE.fullmatch(text)
        label = self.label(dimension)
        due = f"in {label}" if label != "1" else "a pure number"
        if dimension.concentration and not self.concentration:
            raise InputError(
                f"{name} = {text!r}: is a concentration or depends on one, of which [units] declares no unit; add a line such "
                f'as concentration = "{_EXAMPLES["concentration"]}", or give a plain number.'
            )
        if found is None:
            raise InputError(
                f"{name} = {text!r}: must be a number, or a number with a unit such as '2.5 {label}'; change {name}."
            )
        factor = ratio(_quantity(name, found[2], text), self.pint_unit(dimension))
        if factor is None:
            raise InputError(
                f"{name} = {text!r}: must be {due}, or in a unit of the same kind, which {found[2]} is not; change {name}."
            )
        return float(found[1]) * factor

    def factor_to(self, other: "Units", dimension: Dimension) -> float:
        """What a number in these units is to be multiplied by for those; InputError where they measure different things."""
        factor = ratio(self.pint_unit(dimension), other.pint_unit(dimension))
        if factor is None:
            raise InputError(
                f"concentration = {other.concentration!r}: is not of the same kind as {self.concentration!r}; give one that is."
            )
        return factor

    def pint_unit(self, dimension: Dimension) -> "Quantity[Any]":
        """The unit of a dimension, for pint to convert."""
        one = _registry().Quantity(1.0, "")
        for base, exponent in dimension._asdict().items():
            if exponent:
                one *= _quantity(base, getattr(self, base) or "1", getattr(self, base)) ** exponent
        return one


def ratio(one: "Quantity[Any]", other: "Quantity[Any]") -> float | None:
    """How often the one holds the other; None where they measure different things."""
    if one.dimensionality != other.dimensionality:
        return None
    # Equal units cancel before any of them is replaced by base units: what needs no conversion keeps its digits.
    return float((one / other).to("").magnitude)


@cache
def _registry() -> "UnitRegistry[Any]":
    """Loaded by the first scenario that has units."""
    from pint import UnitRegistry

    registry = UnitRegistry[Any]()
    registry.define(THERMAL_ENERGY)
    return registry


def _quantity(name: str, unit: str, text: str) -> "Quantity[Any]":
    """One of a unit, with an error that names what it was to be the unit of, and as what it was given."""
    from pint.errors import PintError

    try:
        one = _registry().Quantity(1.0, "")
        for factor, power in read_factors(unit).items():
            # A unit with an offset (degC) cannot be a factor: pint raises when it is multiplied.
            one *= _registry().Quantity(1.0, factor) ** power
        one.to_base_units()
    except (PintError, ValueError, AttributeError, OverflowError, ZeroDivisionError) as error:
        why = str(error).partition(". ")[0].removesuffix(".")
        raise InputError(
            f"{name} = {text!r}: {unit!r} is no unit ({why}); give one such as pN um, 1/(um s) or Pa."
        ) from None
    return one
