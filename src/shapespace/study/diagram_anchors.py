"""The states that the tiles of a diagram start from: named ones in the middle of each, or all that folds and searches lead to."""

from collections.abc import Iterator, Sequence

import numpy as np

from shapespace.analysis.sheets import spread_sheets, states_at
from shapespace.analysis.stationary import Stationary
from shapespace.analysis.sweeping import Index, Sweep
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_request import DiagramRequest
from shapespace.study.diagram_shapes import Anchors
from shapespace.study.diagram_store import CODES, DiagramStore
from shapespace.study.grid import Grid
from shapespace.study.keyed import KeyedProblem
from shapespace.study.paths import StateName
from shapespace.study.scenario import Scenario
from shapespace.study.searching import search_states
from shapespace.study.settling import key_values
from shapespace.study.starts import Start, find_starts
from shapespace.study.steady import steady, steady_near
from shapespace.study.tiles import Surveyor

MAX_NAMED = 4
"""Points where the named state is looked for from the scenario's own reference: each costs seconds."""


def lay_anchors(store: DiagramStore) -> None:
    """Store what is missing of the anchors."""
    request, scenario = store.request, store.scenario
    if request.branches:
        if len(store) < request.branches:
            for anchors in make_sheet_anchors(scenario, request)[len(store) :]:
                store.append(anchors)
        return
    for name in request.states[len(store) :]:
        grid = request.grid
        sweep, failure = _skeleton(scenario, grid.keys, grid.values(grid.x.anchors, grid.y.anchors), StateName(name))
        found = [sweep.found.get(tile) for tile in request.grid.tiles]
        reasons = [sweep.reasons.get(tile, failure) for tile in request.grid.tiles]
        store.append(_anchors(name, found, reasons))


def make_sheet_anchors(scenario: Scenario, request: DiagramRequest) -> list[Anchors]:
    """All states at the places of a request, as many records as there may be states at a point."""
    grid = request.grid
    lines = grid.x.lines, grid.y.lines
    values = grid.values(*lines)
    nodes = {(int(lines[0][a]), int(lines[1][b])): (a, b) for a, b in np.ndindex(*values.shape[:2])}
    starts: list[tuple[Index, Stationary]] = []
    for name in request.states:
        sweep, _ = _skeleton(scenario, grid.keys, values, StateName(name))
        starts += sweep.found.items()
    offered = [start for origin in request.origins for start in find_starts(origin, scenario)]
    for start in (*offered, *_searched(scenario, request)):
        starts += _placed(scenario, grid, values, start)
    sheets = spread_sheets(values, starts)
    states = [states_at(sheets, nodes[place]) for place in request.places]
    records = []
    for number, label in enumerate(request.labels):
        found = [one[number] if number < len(one) else None for one in states]
        records.append(_anchors(label, found, [Outcome.NO_STATE] * len(found)))
    return records


def _searched(scenario: Scenario, request: DiagramRequest) -> Iterator[Start]:
    """The states that searches by deflation find, at places spread over the map."""
    grid = request.grid
    for i, j in grid.spread(request.deflate):
        values = grid.values(i, j).reshape(2).tolist()
        there = scenario.with_overrides(dict(zip(grid.keys, values, strict=True)))
        for state in search_states(there).states:
            assert state.frame is not None
            yield Start(f"{state.label} of the search at {values}", there, state.frame)


def _placed(scenario: Scenario, grid: Grid, values: Array, start: Start) -> list[tuple[Index, Stationary]]:
    """A stored state as one at the place nearest to its own values of the keys, where it is one there."""
    own = key_values(start.scenario, grid.keys)
    steps = np.array([grid.x.step, grid.y.step])
    at = min(np.ndindex(*values.shape[:2]), key=lambda one: float(np.linalg.norm((values[one] - own) / steps)))
    there = scenario.with_overrides(dict(zip(grid.keys, values[at].tolist(), strict=True)))
    found = steady_near(there, start)
    if not found.outcome.is_success:
        return []
    surveyor = Surveyor(scenario, grid.keys, stability=False)
    return [(at, surveyor.state(found.problem.base.mesh, found.found.x, np.asarray(values[at])))]


def _skeleton(scenario: Scenario, keys: tuple[str, str], values: Array, name: StateName) -> tuple[Sweep, Outcome]:
    """The named state at values (n_0, n_1, 2) of the keys, and why there is none where none was tried.

    It is found by its name where these are nearest to the scenario's own values, followed from there from point to point, and
    looked for by name again where that does not lead.
    """
    surveyor = Surveyor(scenario, keys, stability=False)
    sweep = Sweep(values)
    own = key_values(scenario, keys)
    spans = np.ptp(values, axis=(0, 1))
    spans[spans == 0.0] = 1.0
    known = (own - values[0, 0]) / spans
    places = {at: (values[at] - values[0, 0]) / spans for at in np.ndindex(*values.shape[:2])}
    failure = Outcome.NO_STATE
    tried: list[Array] = []
    for _ in range(MAX_NAMED):
        missing = sweep.missing
        if not missing:
            break
        seen = [*tried, *(places[at] for at in sweep.found)]
        at = max(missing, key=lambda one: _remoteness(places[one], seen, known))
        tried.append(places[at])
        there = dict(zip(keys, values[at].tolist(), strict=True))
        found = steady(scenario.with_overrides(there), state=name)
        if not found.outcome.is_success:
            failure = found.outcome if found.outcome in CODES else Outcome.NO_STATE
            continue
        start = surveyor.state(found.problem.base.mesh, found.found.x, sweep.p(at))
        sweep.begin(at, start)
        sweep.spread(at)
    return sweep, failure


def _remoteness(place: Array, seen: Sequence[Array], known: Array) -> float:
    """How far a place is from all those seen; before there is one, how near it is to the known place."""
    if not seen:
        return -float(np.linalg.norm(place - known))
    return min(float(np.linalg.norm(place - one)) for one in seen)


def _anchors(label: str, found: Sequence[Stationary | None], reasons: Sequence[Outcome]) -> Anchors:
    outcomes = tuple(
        Outcome.CONVERGED if one is not None else reason for one, reason in zip(found, reasons, strict=True)
    )
    empty = np.zeros(0)
    meshes = tuple(_mesh(one) if one is not None else empty for one in found)
    return Anchors(label, outcomes, meshes, tuple(one.x if one is not None else empty for one in found))


def _mesh(state: Stationary) -> Array:
    assert isinstance(state.problem, KeyedProblem)
    return state.problem.base.mesh
