"""End conditions: for each rate, essential (the state is pinned) or natural (its flux is given) at either end."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from shapespace.base.arrays import Traced

ParameterValue = Callable[[Any], Traced | float]


@dataclass(frozen=True)
class Pinned:
    """The state equals `value(parameters)`; the rate is not varied at this end."""

    value: ParameterValue = lambda p: 0.0


@dataclass(frozen=True)
class Free:
    """The flux vanishes: the natural condition."""


@dataclass(frozen=True)
class Traction:
    """The isotropic tension at the end equals `tension(parameters)`: a reservoir feeds the surface (Table 3)."""

    tension: ParameterValue


End = Pinned | Free | Traction
Ends = Mapping[str, tuple[End, End]]
"""For each rate ("r", "z", "psi", "v", "v_phi", "species") the conditions at u = 0 and u = 1."""


def check_ends(ends: Ends, required: tuple[str, ...]) -> None:
    """Raise ValueError naming rates whose ends are missing, and ends that belong to no rate."""
    missing = [name for name in required if name not in ends]
    surplus = [name for name in ends if name not in required]
    if missing or surplus:
        raise ValueError(
            f"end conditions must be given for exactly {required}; missing {missing}, surplus {surplus}. "
            "Give (at u = 0, at u = 1) as Pinned, Free or Traction for each."
        )


def check_count(fields: int, scalars: tuple[str, ...], ends: list[str], integrals: list[str]) -> None:
    """Raise ValueError unless conditions and unknowns balance: n_ends + n_integrals = n_fields + n_scalars."""
    given, needed = len(ends) + len(integrals), fields + len(scalars)
    if given != needed:
        word = "missing" if given < needed else "surplus"
        raise ValueError(
            f"{abs(needed - given)} condition(s) {word}: {fields} fields and the scalars {scalars} need {needed}, given are "
            f"{given}: {ends + integrals}. Each scalar needs its own: length -> gauge alpha(0) = 0, pressure -> volume, "
            "tension -> area, velocity -> frame z(0) + z(1) = 0."
        )
