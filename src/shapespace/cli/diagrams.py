"""The command `diagram`: a map of stationary states over two keys."""

import json
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from shapespace.base.errors import WorkerError
from shapespace.cli.progress import ProgressDisplay
from shapespace.cli.shared import (
    GAVE_UP,
    INTERRUPTED,
    AsJson,
    NameOrFile,
    Settings,
    again,
    app,
    examples,
    find_scenario,
    print_lines,
    read_settings,
    tell,
    whole,
)

if TYPE_CHECKING:
    from shapespace.study.curve_store import Curve
    from shapespace.study.diagram_store import Diagram
    from shapespace.study.tiles import Done

AXIS = "KEY=FROM:TO:COUNT"


@app.command(
    name="diagram",
    help_epilogue=examples(
        "shapespace diagram polar-swimmer -x peclet=25:300:40 -y inverse_hydrodynamic_length=0.1:10:40",
        "shapespace diagram guided-division -x ring_amplitude=0:4:20 -y peclet=200:450:20 --stability --workers 1",
        "shapespace diagram polar-swimmer -x peclet=15:60:30 -y turnover_rate=5:15:30 --state trivial,default --boundaries",
        "shapespace diagram guided-division -x turnover_rate=30:45:40 -y peclet=300:450:40 --stability --adaptive",
        "shapespace plot results/polar-swimmer-diagram --observable regime",
        "shapespace plot results/polar-swimmer-diagram --observable velocity",
    ),
)
def diagram_command(
    scenario: NameOrFile,
    /,
    *,
    x: Annotated[str, Parameter(name=["-x", "--x"], metavar=AXIS, help="The key that varies to the right.")],
    y: Annotated[str, Parameter(name=["-y", "--y"], metavar=AXIS, help="The key that varies upwards.")],
    settings: Settings = (),
    state: Annotated[
        str, Parameter(metavar="NAMES", help="States to map, as of `steady`, with commas between them.")
    ] = "default",
    branches: Annotated[
        int,
        Parameter(
            metavar="N",
            converter=whole,
            help="Up to N states at each point: all that folds connect with those of --state, --from and --deflate.",
        ),
    ] = 0,
    origins: Annotated[
        tuple[str, ...],
        Parameter(name="--from", metavar="STORE[:LABEL]", help="With --branches: stored states to start from as well."),
    ] = (),
    deflate: Annotated[
        int,
        Parameter(
            metavar="M", converter=whole, help="With --branches: search by deflation at M places spread over the map."
        ),
    ] = 0,
    adaptive: Annotated[
        bool,
        Parameter(
            help="Compute only where the kind of the states changes; points between get the kind of those around."
        ),
    ] = False,
    stability: Annotated[bool, Parameter(help="Store the number of growing modes of each state too.")] = False,
    boundaries: Annotated[
        bool, Parameter(help="Follow the folds and branch points that bound regions; drawn over the map by `plot`.")
    ] = False,
    workers: Annotated[
        int | None,
        Parameter(metavar="N", converter=whole, help="Processes on this machine; the default is one for each core."),
    ] = None,
    dask: Annotated[
        str | None,
        Parameter(metavar="ADDRESS", help="Compute on the workers of this Dask scheduler, e.g. tcp://host:8786."),
    ] = None,
    out: Annotated[
        Path | None, Parameter(metavar="DIR", help="New directory; the default is results/NAME-diagram.")
    ] = None,
    resume: Annotated[
        bool, Parameter(help="Continue the diagram in DIR, or start it where there is none yet.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Map the stationary states over two keys into a Zarr store."""
    from shapespace.study.diagrams import diagram
    from shapespace.study.run import free_path

    chosen = find_scenario(scenario).with_overrides(read_settings(settings))
    name = f"{chosen.name}-diagram"
    path = out or (Path("results") / name if resume else free_path(name))
    began = monotonic()
    try:
        with ProgressDisplay() as display:
            rate = _Rate(display, path)
            found = diagram(
                chosen, x, y, out=path, states=state.split(","), stability=stability, boundaries=boundaries,
                branches=branches, origins=origins, adaptive=adaptive, deflate=deflate,
                workers=workers, dask=dask, resume=resume,
                ready=rate.begin, progress=rate.update, curve_progress=rate.follow, waiting=rate.wait,
            )  # fmt: skip
    except KeyboardInterrupt:
        tell(f"interrupted; to continue: {again(path)}")
        return INTERRUPTED
    except WorkerError as error:
        elsewhere = "" if dask is None else ", here or with the --dask ADDRESS of a cluster that lives"
        tell(f"{error} To continue{elsewhere}: {again(path, '--dask')}")
        return GAVE_UP
    seconds = monotonic() - began
    if as_json:
        print(json.dumps(_record(found, rate, seconds), allow_nan=False))
    else:
        _summarise(found, rate, seconds)
    if not found.converged:
        tell("no point of the grid has a state of this name; choose other values, or another --state.")
        return GAVE_UP
    return 0


class _Rate:
    """How many points a second, and how long the rest takes."""

    def __init__(self, display: ProgressDisplay, path: Path) -> None:
        self._display, self._path = display, path
        self._done, self._total, self._points = 0, 0, 0
        self._start = self._last = monotonic()
        self._began: float | None = None
        self._workers = ""
        self.computed = 0

    def begin(self, done: int, total: int) -> None:
        """Take note of what is there already."""
        self._done, self._total = done, total
        start = f"continuing {self._path} after {done} of {total} points" if done else f"starting {self._path}"
        self._display.start(start)

    def follow(self, found: "Curve") -> None:
        """Take note of a boundary."""
        self._display.update(f"followed a curve of {found.of}s", is_notable=True)

    def wait(self, workers: int) -> None:
        """Take note of how many workers a cluster has."""
        self._workers = f", {workers} worker{'s' * (workers != 1)}"
        if not workers:
            self._display.update("waiting for workers: the scheduler has none", self._share)

    def update(self, tile: "Done") -> None:
        """Take note of a tile."""
        self._last = monotonic()
        if self._began is None:
            # What came before the first tile is no measure of the others.
            self._began = self._last - tile.seconds
        self._points += tile.points
        self.computed += tile.points - tile.inferred
        rate = self._points / max(self._last - self._began, 1e-9)
        done = self._done + self._points
        left = (self._total - done) / rate
        text = f"{done} of {self._total} points, {rate:.1f} a second, {left:.0f} s left{self._workers}"
        self._display.update(text, self._share)

    @property
    def _share(self) -> float:
        return (self._done + self._points) / max(self._total, 1)

    @property
    def whole(self) -> float | None:
        """Computed points a second from the start of the command to the last one, None where there are none."""
        return self.computed / max(self._last - self._start, 1e-9) if self.computed else None


def _record(found: "Diagram", rate: _Rate, seconds: float) -> dict[str, Any]:
    """What --json prints."""
    return {
        "store": str(found.store),
        "scenario": found.scenario.name,
        "parameters": found.scenario.values(),
        "keys": [*found.request.grid.keys],
        "states": [*found.request.labels],
        "points": found.points,
        "computed": rate.computed,
        "converged": found.converged,
        "inferred": found.inferred,
        "seconds": seconds,
        "points_per_second": rate.whole,
        "boundaries": [_boundary(one) for one in found.boundaries],
        "unexplained": None if found.unexplained is None else len(found.unexplained),
        "failed": found.failed,
    }


def _boundary(found: "Curve") -> dict[str, Any]:
    return {
        "store": str(found.store),
        "kind": found.of,
        "keys": [*found.keys],
        "points": sum(point.is_step for point in found.points),
        "special_points": [
            {"label": point.label, "parameters": dict(zip(found.keys, point.parameters.tolist(), strict=True))}
            for point in found.special_points
        ],
    }


def _summarise(found: "Diagram", rate: _Rate, seconds: float) -> None:
    from collections import Counter

    counts = Counter(one["outcome"] for one in found.failed).most_common()
    counts += [("inferred from those around", found.inferred)] if found.request.adaptive else []
    ends = "".join(f", {count} {name}" for name, count in counts)
    print_lines(
        f"{found.points} points: {found.converged} converged{ends}",
        f"computed {rate.computed} in {seconds:.1f} s{'' if rate.whole is None else f', {rate.whole:.1f} a second'}",
        *(f"bounded by {one.of}s: {one.store}" for one in found.boundaries),
        *([f"{len(found.unexplained)} changes between neighbours lie on no such curve"] if found.unexplained else []),
        f"stored in {found.store}",
    )
