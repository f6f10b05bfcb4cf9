"""A chosen point of a diagram as a stationary state."""

from pathlib import Path

import numpy as np

from shapespace.base.errors import InputError
from shapespace.study.diagram_state import DiagramStates
from shapespace.study.diagram_store import Diagram, DiagramStore
from shapespace.study.steady import Steady


def state_at(diagram: Diagram | str | Path, state: str | None = None, **values: float) -> Steady:
    """The state of a diagram at the point nearest to these values of its two keys, computed again from what is known nearby.

    state: its label, as the dimension `state` has it; without it the first. InputError where the diagram has none there.
    """
    store = DiagramStore.open(diagram.store if isinstance(diagram, Diagram) else diagram)
    request = store.request
    if state is not None and state not in request.labels:
        raise InputError(f"state = {state}: is none of this diagram; choose one of {', '.join(request.labels)}.")
    if {*values} != {*request.grid.keys}:
        given = ", ".join(values) or "none"
        raise InputError(f"{store.path}: needs values of {' and '.join(request.grid.keys)}, not of {given}; give both.")
    places = []
    for axis in (request.grid.x, request.grid.y):
        value = float(values[axis.key])
        if not axis.start - 0.5 * axis.step <= value <= axis.stop + 0.5 * axis.step:
            raise InputError(
                f"{axis.key} = {value:g}: lies outside the diagram; choose {axis.start:g} to {axis.stop:g}."
            )
        places.append(int(np.abs(axis.values - value).argmin()))
    number = 0 if state is None else request.labels.index(state)
    found = DiagramStates(store).state((number, places[0], places[1]))
    return Steady(found.scenario, found.problem, found.found)
