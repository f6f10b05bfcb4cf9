"""Which observable tells most about a set of states: what pictures draw where none is asked for."""

from collections.abc import Callable, Sequence

from shapespace.study.scenario import Scenario

TELLING = {
    "open-membrane": ("height",),
    "closed-surface": ("velocity", "equator_radius"),
    "vesicle": ("bending_energy",),
}
"""By kind of model, observables in the order in which they are tried: the velocity of a symmetric surface tells nothing."""
LEAST_CHANGE = 1e-6
"""In units of the solver's scales."""


def most_telling(scenario: Scenario, change: Callable[[str], float], known: Sequence[str] = ()) -> str:
    """The first of TELLING, those `known` left out, that changes by more than LEAST_CHANGE; the last one where none does.

    change: largest less smallest value of an observable over the states, in the scenario's units.
    """
    names = [name for name in TELLING[scenario.kind] if name not in known] or ["bending_energy"]
    return next((name for name in names if change(name) > LEAST_CHANGE * scenario.scales.factor(name)), names[-1])
