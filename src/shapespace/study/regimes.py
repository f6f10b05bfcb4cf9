"""Regimes of stationary states: with or without a neck, symmetric or not, stable or not, swimming or at rest.

A regime is a set of flags. Of one state one flag of each aspect is set, or none where that is not known or does not apply;
several states at one point have the flags of all of them, so that both flags of an aspect may be.
"""

from collections.abc import Mapping, Sequence
from enum import IntFlag

MOVING = 1e-6
"""Speeds below this, in units of length over time of the scenario's scales, are round-off."""


class Regime(IntFlag):
    """What a state is like; stored as a number."""

    NO_NECK = 1
    NECK = 2
    SYMMETRIC = 4
    ASYMMETRIC = 8
    STABLE = 16
    UNSTABLE = 32
    RESTING = 64
    SWIMMING = 128

    @property
    def words(self) -> str:
        """Of one flag."""
        assert self.name is not None
        return self.name.lower().replace("_", " ")


ASPECTS = (
    Regime.NO_NECK | Regime.NECK,
    Regime.SYMMETRIC | Regime.ASYMMETRIC,
    Regime.STABLE | Regime.UNSTABLE,
    Regime.RESTING | Regime.SWIMMING,
)
SHAPE = ASPECTS[0]
"""The aspect that may change without a bifurcation."""


def regime_of(is_symmetric: bool | None, measured: Mapping[str, float], n_unstable: int | None) -> Regime:
    """Of one state. is_symmetric, n_unstable: None where that does not apply. measured: dimensionless observables."""
    regime = Regime.NECK if "neck_radius" in measured else Regime.NO_NECK
    if is_symmetric is not None:
        regime |= Regime.SYMMETRIC if is_symmetric else Regime.ASYMMETRIC
    if n_unstable is not None:
        regime |= Regime.UNSTABLE if n_unstable else Regime.STABLE
    if "velocity" in measured:
        regime |= Regime.SWIMMING if abs(measured["velocity"]) > MOVING else Regime.RESTING
    return regime


def telling_aspects(codes: Sequence[int]) -> Regime:
    """The aspects in which some of these regimes differ; at least the first that applies."""
    found = Regime(0)
    for aspect in ASPECTS:
        if len({code & aspect for code in codes}) > 1:
            found |= aspect
    applying = (aspect for aspect in ASPECTS if any(code & aspect for code in codes))
    return found or next(applying, Regime(0))


def describe(code: int, aspects: int = 255) -> str:
    """In words, `neck, stable & unstable`, of these aspects; where there is no state, `no state`."""
    if not code:
        return "no state"
    parts = ([flag for flag in aspect if flag & code & aspects] for aspect in ASPECTS)
    return ", ".join(" & ".join(Regime(flag).words for flag in flags) for flags in parts if flags)
