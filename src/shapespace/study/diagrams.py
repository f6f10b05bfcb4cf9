"""Maps of stationary states over two keys: a coarse skeleton first, then tile by tile, each from the skeleton alone."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from shapespace.analysis.sheets import spread_sheets, states_at
from shapespace.analysis.stationary import Stationary
from shapespace.analysis.sweeping import Index, Sweep
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.boundaries import Progress as CurveProgress
from shapespace.study.boundaries import follow_boundaries
from shapespace.study.cluster import Cluster
from shapespace.study.diagram_store import CODES, Anchors, Diagram, DiagramRequest, DiagramStore, open_diagram
from shapespace.study.grid import Axis, Grid
from shapespace.study.keyed import KeyedProblem
from shapespace.study.named import check_has_isolated_states
from shapespace.study.paths import StateName, read_state_name
from shapespace.study.records import holds_store
from shapespace.study.scenario import Scenario
from shapespace.study.settling import key_values
from shapespace.study.starts import Start, find_starts
from shapespace.study.steady import steady, steady_near
from shapespace.study.tiles import Done, Surveyor, observable_names
from shapespace.study.workers import Workers, available_cores

MAX_NAMED = 4
"""Points where the named state is looked for from the scenario's own reference: each costs seconds."""

MAX_BRANCHES = 16

Progress = Callable[[Done], None]
"""Called after each tile."""


def diagram(
    scenario: Scenario,
    x: Axis | str,
    y: Axis | str,
    *,
    out: str | Path,
    states: Sequence[str] = ("default",),
    stability: bool = False,
    boundaries: bool = False,
    branches: int = 0,
    origins: Sequence[str | Path] = (),
    adaptive: bool = False,
    workers: int | None = None,
    dask: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    curve_progress: CurveProgress | None = None,
    ready: Callable[[int, int], None] | None = None,
) -> Diagram:
    """Stationary states of a scenario over a grid of two keys, x and y as `key=from:to:count`, in a Zarr store.

    states: names of states, as of `steady`; each is followed from where it is found first. stability: store the number of
    growing modes too. boundaries: follow the folds and branch points that bound its regions, also of a diagram that is
    complete; they come with `Diagram.boundaries`. branches: up to so many states at each point, in the order of their bending
    energy: all that folds connect with those named, and with those of the stores `origins` (`STORE` or `STORE:LABEL`).
    adaptive: compute only where the kind of the states changes, and give other points the kind of those around, with outcome
    `inferred` and without values. workers: processes, by default one for each core; dask: address of a scheduler whose
    workers compute instead; the map does not depend on them. `out` is the directory of the store, new or empty; with `resume`
    a store there is continued. ready: told how many points are done of how many. InputError before anything is computed;
    where a process cannot be kept alive, WorkerError.
    """
    grid = Grid(*(Axis.read(one, flag) if isinstance(one, str) else one for flag, one in (("-x", x), ("-y", y))))
    request = make_request(scenario, grid, states, stability, branches, origins, adaptive)
    engine = _engine(workers, dask)
    begin = DiagramStore.resume if resume and holds_store(out) else DiagramStore.create
    with engine, begin(out, scenario, request, observable_names(scenario, grid.keys)) as store:
        missing = store.missing_tiles
        sizes = {tile: (1 if branches else len(states)) * _size(grid, tile) for tile in grid.tiles}
        if ready is not None:
            ready(sum(sizes.values()) - sum(sizes[tile] for tile in missing), sum(sizes.values()))
        lay_anchors(store)
        for done in engine.map(store.path, missing):
            if progress is not None:
                progress(done)
        if missing or store.outcome is None:
            store.finish(Outcome.COMPLETE)
        found = open_diagram(out)
        if boundaries and found.unexplained is None:
            follow_boundaries(store, found, curve_progress)
    return open_diagram(out)


def make_request(
    scenario: Scenario,
    grid: Grid,
    states: Sequence[str],
    stability: bool,
    branches: int = 0,
    origins: Sequence[str | Path] = (),
    adaptive: bool = False,
) -> DiagramRequest:
    """What is asked for, checked: InputError where it cannot be had."""
    names = tuple(str(read_state_name(name, scenario.kind)) for name in states)
    if not names or len(set(names)) < len(names):
        raise InputError(f"--state {','.join(states)}: must name different states; give each once.")
    if not 0 <= branches <= MAX_BRANCHES:
        raise InputError(
            f"--branches {branches}: must be 1 to {MAX_BRANCHES}; choose another number, or leave it away."
        )
    if origins and not branches:
        raise InputError(f"--from {origins[0]}: adds states to those of --branches N; give that too.")
    if adaptive and branches:
        raise InputError(f"--adaptive and --branches {branches}: adaptive maps follow named states; give only one.")
    for origin in origins:
        find_starts(origin, scenario)
    for corner in grid.corners(scenario):
        check_has_isolated_states(corner)
    KeyedProblem.of(scenario, grid.keys)
    return DiagramRequest(grid, names, stability, branches, tuple(map(str, origins)), adaptive)


def lay_anchors(store: DiagramStore) -> None:
    """Store what is missing of the anchors."""
    request, scenario = store.request, store.scenario
    if request.branches:
        if len(store) < request.branches:
            for anchors in make_sheet_anchors(scenario, request)[len(store) :]:
                store.append(anchors)
        return
    for name in request.states[len(store) :]:
        sweep, failure = _skeleton(scenario, request.grid, StateName(name))
        found = [sweep.found.get(tile) for tile in request.grid.tiles]
        reasons = [sweep.reasons.get(tile, failure) for tile in request.grid.tiles]
        store.append(_anchors(name, found, reasons))


def make_sheet_anchors(scenario: Scenario, request: DiagramRequest) -> list[Anchors]:
    """All states in the middle of each tile, as many records as there may be states at a point."""
    grid = request.grid
    values = grid.values(grid.x.anchors, grid.y.anchors)
    starts: list[tuple[Index, Stationary]] = []
    for name in request.states:
        sweep, _ = _skeleton(scenario, grid, StateName(name))
        starts += sweep.found.items()
    for origin in request.origins:
        starts += [
            (at, state)
            for start in find_starts(origin, scenario)
            for at, state in _placed(scenario, grid, values, start)
        ]
    sheets = spread_sheets(values, starts)
    states = [states_at(sheets, tile) for tile in grid.tiles]
    records = []
    for number, label in enumerate(request.labels):
        found = [one[number] if number < len(one) else None for one in states]
        records.append(_anchors(label, found, [Outcome.NO_STATE] * len(found)))
    return records


def _placed(scenario: Scenario, grid: Grid, values: Array, start: Start) -> list[tuple[Index, Stationary]]:
    """A stored state as one at the anchor nearest to its own values of the keys, where it is one there."""
    own = key_values(start.scenario, grid.keys)
    steps = np.array([grid.x.step, grid.y.step])
    at = min(np.ndindex(*values.shape[:2]), key=lambda one: float(np.linalg.norm((values[one] - own) / steps)))
    there = scenario.with_overrides(dict(zip(grid.keys, values[at].tolist(), strict=True)))
    found = steady_near(there, start)
    if not found.outcome.is_success:
        return []
    surveyor = Surveyor(scenario, grid.keys, stability=False)
    return [(at, surveyor.state(found.problem.base.mesh, found.found.x, np.asarray(values[at])))]


def _size(grid: Grid, tile: Index) -> int:
    return int(np.prod([one.stop - one.start for one in grid.span(tile)]))


def _engine(workers: int | None, dask: str | None) -> Workers | Cluster:
    """What computes tiles."""
    if dask is not None:
        if workers is not None:
            raise InputError(f"--workers {workers} and --dask {dask}: the cluster has its own workers; give only one.")
        return Cluster(dask)
    count = available_cores() if workers is None else workers
    if count < 1:
        raise InputError(f"--workers {count}: must be at least 1; give a larger number.")
    return Workers(count)


def _skeleton(scenario: Scenario, grid: Grid, name: StateName) -> tuple[Sweep, Outcome]:
    """The named state in the middle of each tile, and why there is none where none was tried.

    It is found by its name where the grid is nearest to the scenario's own values, followed from there from tile to tile, and
    looked for by name again where that does not lead.
    """
    surveyor = Surveyor(scenario, grid.keys, stability=False)
    values = grid.values(grid.x.anchors, grid.y.anchors)
    sweep = Sweep(values)
    own = key_values(scenario, grid.keys)
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
        keys = dict(zip(grid.keys, values[at].tolist(), strict=True))
        found = steady(scenario.with_overrides(keys), state=name)
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
