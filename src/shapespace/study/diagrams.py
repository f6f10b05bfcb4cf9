"""Maps of stationary states over two keys: a coarse skeleton first, then tile by tile, each from the skeleton alone."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from shapespace.analysis.sweeping import Index
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.boundaries import Progress as CurveProgress
from shapespace.study.boundaries import follow_boundaries
from shapespace.study.cluster import Cluster
from shapespace.study.diagram_anchors import lay_anchors
from shapespace.study.diagram_request import DiagramRequest
from shapespace.study.diagram_store import Diagram, DiagramStore, open_diagram
from shapespace.study.grid import Axis, Grid
from shapespace.study.keyed import KeyedProblem
from shapespace.study.manifests import holds_store
from shapespace.study.named import check_has_isolated_states
from shapespace.study.paths import read_state_name
from shapespace.study.scenario import Scenario
from shapespace.study.starts import find_starts
from shapespace.study.tiles import Done, observable_names
from shapespace.study.workers import Workers, available_cores

MAX_BRANCHES, MAX_SEARCHES = 16, 64

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
    deflate: int = 0,
    workers: int | None = None,
    dask: str | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    curve_progress: CurveProgress | None = None,
    ready: Callable[[int, int], None] | None = None,
    waiting: Callable[[int], None] | None = None,
) -> Diagram:
    """Stationary states of a scenario over a grid of two keys, x and y as `key=from:to:count`, in a Zarr store.

    states: names of states, as of `steady`; each is followed from where it is found first. stability: store the number of
    growing modes too. boundaries: follow the folds and branch points that bound its regions, also of a diagram that is
    complete; they come with `Diagram.boundaries`. branches: up to so many states at each point, in the order of their bending
    energy: all that folds connect with those named, with those of the stores `origins` (`STORE` or `STORE:LABEL`), and with those
    that a search by deflation finds at each of `deflate` places spread over the map.
    adaptive: compute only where the kind of the states changes, and give other points the kind of those around, with outcome
    `inferred` and without values. workers: processes, by default one for each core; dask: address of a scheduler whose
    workers compute instead; the map does not depend on them. `out` is the directory of the store, new or empty; with `resume`
    a store there is continued. ready: told how many points are done of how many; waiting: of a cluster how many workers it has,
    at first and while no tile is finished. InputError before anything is computed; where a process cannot be kept alive,
    WorkerError.
    """
    grid = Grid(*(Axis.read(one, flag) if isinstance(one, str) else one for flag, one in (("-x", x), ("-y", y))))
    request = make_request(scenario, grid, states, stability, branches, origins, adaptive, deflate)
    engine = _engine(workers, dask, Path(out))
    begin = DiagramStore.resume if resume and holds_store(out) else DiagramStore.create
    with engine, begin(out, scenario, request, observable_names(scenario, grid.keys)) as store:
        missing = store.missing_tiles
        sizes = {tile: (1 if branches else len(states)) * _size(grid, tile) for tile in grid.tiles}
        if ready is not None:
            ready(sum(sizes.values()) - sum(sizes[tile] for tile in missing), sum(sizes.values()))
        if missing or store.outcome is None:
            store.enter()
        lay_anchors(store)
        for done in engine.map(store.path, missing, waiting or (lambda count: None)):
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
    deflate: int = 0,
) -> DiagramRequest:
    """What is asked for, checked: InputError where it cannot be had."""
    names = tuple(str(read_state_name(name, scenario.kind)) for name in states)
    if not names or len(set(names)) < len(names):
        raise InputError(f"--state {','.join(states)}: must name different states; give each once.")
    if not 0 <= branches <= MAX_BRANCHES:
        raise InputError(f"--branches {branches}: must be 1 to {MAX_BRANCHES}, or 0 for the named states alone.")
    for option, is_given in ((f"--from {origins[0]}" if origins else "", origins), (f"--deflate {deflate}", deflate)):
        if is_given and not branches:
            raise InputError(f"{option}: adds states to those of --branches N; give that too.")
    if adaptive and branches:
        raise InputError(f"--adaptive and --branches {branches}: adaptive maps follow named states; give only one.")
    if not 0 <= deflate <= MAX_SEARCHES:
        raise InputError(f"--deflate {deflate}: must be 1 to {MAX_SEARCHES}, or 0 for no searches.")
    for origin in origins:
        find_starts(origin, scenario)
    for corner in grid.corners(scenario):
        check_has_isolated_states(corner)
    KeyedProblem.of(scenario, grid.keys)
    return DiagramRequest(grid, names, stability, branches, tuple(map(str, origins)), adaptive, deflate)


def _size(grid: Grid, tile: Index) -> int:
    return int(np.prod([one.stop - one.start for one in grid.span(tile)]))


def _engine(workers: int | None, dask: str | None, out: Path) -> Workers | Cluster:
    """What computes tiles."""
    if dask is not None:
        if workers is not None:
            raise InputError(f"--workers {workers} and --dask {dask}: the cluster has its own workers; give only one.")
        return Cluster(dask, out)
    count = available_cores() if workers is None else workers
    if count < 1:
        raise InputError(f"--workers {count}: must be at least 1; give a larger number.")
    return Workers(count)
