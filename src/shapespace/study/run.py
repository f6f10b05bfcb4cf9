"""Run a scenario: make or continue its store, and append every accepted time step before anyone hears of it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.frame import Frame
from shapespace.study.manifests import holds_store
from shapespace.study.presenting import AbstractAnimation, Plotted, Summary, quantities_table, the_presenter
from shapespace.study.scenario import Scenario
from shapespace.study.starts import Start, find_start
from shapespace.study.store import RunStore, is_free

if TYPE_CHECKING:
    import xarray as xr

# Called after each new frame with the frame and the number of steps so far.
Progress = Callable[[Frame, int], None]

# As many frames as a multistep method needs to go on as if it had not been stopped.
HISTORY = 4

# Ends that a resumed run keeps, since nothing more would happen.
_FINAL = {Outcome.STATIONARY, Outcome.NECK_CLOSED, Outcome.SELF_INTERSECTING}


@dataclass(frozen=True)
class Run(Plotted):
    """How a run ended, None where it is not finished, and what it left. `steps` counts from the initial state, `wall_time` is in
    seconds of this call, zero for a run that was only read.

    `observables` are those of the last frame, in the scenario's units. `frames` are there only for a run without store.
    """

    outcome: Outcome | None
    scenario: Scenario
    store: Path | None
    observables: dict[str, float]
    steps: int
    wall_time: float
    frames: tuple[Frame, ...] = ()

    @property
    def dataset(self) -> "xr.Dataset":
        """All frames as fields along the curve and observables over time, with units."""
        # Imported late: xarray takes longer to load than a stored run to be found finished.
        from shapespace.study.dataset import make_dataset, open_dataset

        if self.store is None:
            return make_dataset(self.scenario, self.frames, self.outcome)
        return open_dataset(self.store)

    @property
    def warning(self) -> str | None:
        """One line where the last state is not as finely resolved as was asked for."""
        error, asked = self.observables.get("discretisation_error", 0.0), self.scenario.numerics.mesh_tolerance
        if error <= asked:
            return None
        return (
            f"discretisation_error = {error:.3g} at the end: exceeds mesh_tolerance = {asked:g}, and thin parts such as a neck "
            f"may be far from right; run it anew with -s mesh_tolerance={asked / 10.0:g} or more elements."
        )

    def summary(self) -> Summary:
        """Scenario, outcome, time, observables, and the last state's outline."""
        from shapespace.study.dataset import meridian_of

        facts = {
            "outcome": f"{self.outcome}: {self.outcome.advice}" if self.outcome else "unfinished",
            "time": f"{self.observables['time']:.6g}",
            "steps": f"{self.steps}, {self.wall_time:.1f} s" if self.wall_time else str(self.steps),
            "store": str(self.store or "in memory"),
        }
        facts |= {"warning": self.warning} if self.warning else {}
        tables = {"observables at the end": quantities_table(self.scenario.scales, self.observables)}
        return Summary(f"Run of {self.scenario.name}", facts, tables, meridian_of(self.scenario, self.state().frame))

    def animate(self, seconds: float = 8.0) -> AbstractAnimation:
        """The movie, as `shapespace.movie` makes it, for a notebook to play or to save."""
        return the_presenter().animation(self, seconds)

    def state(self, number: int = -1) -> Start:
        """A frame, the last one by default, for another run or a stationary state to start from."""
        frame = self.frames[number] if self.store is None else RunStore.open(self.store).read(number)
        return Start(f"frame {number} of a run", self.scenario, frame)


def run(
    scenario: Scenario,
    *,
    out: str | Path | None = None,
    resume: bool = False,
    start: Start | str | Path | None = None,
    progress: Progress | None = None,
    ready: Callable[[int], None] | None = None,
) -> Run:
    """Simulate a scenario to its end and return the Run; its outcome says whether the solver gave up.

    `out` is the directory of the store, new or empty; without it the frames are kept in memory. With `resume` a store
    in `out` is continued; one that has already ended as asked is left as it is. InputError and StoreError before
    anything is computed; StoreError when the disk fills up, with all frames so far intact. `start` is a stored state to
    begin with in place of the scenario's initial one: `STORE` or `STORE:LABEL`, or one in memory (`Run.state`,
    `Steady.perturbed`). `ready` is called once when the store is,
    with the number of its frames; `progress` after each new frame.
    """
    began = perf_counter()
    first = None
    if start is not None:
        first = start if isinstance(start, Start) else find_start(start)
        first.check_fits(scenario)
    if out is None:
        if resume:
            raise InputError("resume = True: needs the directory of a stored run; give it as out.")
        frames: list[Frame] = []
        outcome = _simulate(scenario, [], 0, frames.append, progress, first)
        return Run(
            outcome, scenario, None, _observables(frames[-1]), len(frames) - 1, perf_counter() - began, tuple(frames)
        )
    begin = RunStore.resume if resume and holds_store(out) else RunStore.create
    with begin(out, scenario) as store:
        if ready is not None:
            ready(len(store))
        outcome = _advance(store, progress, first)
        last = _observables(store.read(-1))
        return Run(outcome, store.scenario, store.path, last, len(store) - 1, perf_counter() - began)


def open_run(path: str | Path) -> Run:
    """A stored run or state, finished or not. StoreError where there is none, or nothing in it yet."""
    store = RunStore.open(path)
    last = find_start(store.path).frame
    return Run(store.outcome, store.scenario, store.path, _observables(last), len(store) - 1, 0.0)


def store_frame(path: str | Path, scenario: Scenario, frame: Frame, outcome: Outcome) -> None:
    """Store one state as a run that has not started to move."""
    with RunStore.create(path, scenario) as store:
        store.append(frame)
        store.finish(outcome)


def free_path(name: str, root: str | Path = "results") -> Path:
    """The first of root/name, root/name-2, ... in which a new run can be created."""
    path, number = Path(root) / name, 1
    while not is_free(path):
        number += 1
        path = Path(root) / f"{name}-{number}"
    return path


def _observables(frame: Frame) -> dict[str, float]:
    return {"time": frame.time, **frame.observables}


def _advance(store: RunStore, progress: Progress | None, start: Start | None) -> Outcome:
    """Bring a store to its scenario's end, where it is not there yet."""
    history = store.last(HISTORY)
    if store.outcome in _FINAL:
        return store.outcome
    settings = store.scenario.run
    end = None
    if history and history[-1].time >= settings.until * (1 - 1e-12):
        end = Outcome.REACHED_END
    elif len(store) > settings.max_steps:
        end = Outcome.MAX_STEPS
    if end is None or end != store.outcome:
        end = end or _simulate(store.scenario, history, len(store), store.append, progress, start)
        store.finish(end)
    return end


def _simulate(
    scenario: Scenario,
    history: list[Frame],
    count: int,
    record: Callable[[Frame], None],
    progress: Progress | None,
    start: Start | None,
) -> Outcome:
    """Record frame after frame; `count` frames are there already, of which `history` are the last."""
    # Imported late: with it comes the array library, which a bad request should not have to wait for.
    from shapespace.study.simulation import Simulation

    # The simulation counts its own steps; the limit is on those of the whole run.
    left = scenario.run.max_steps - max(0, count - 1)
    simulation = Simulation(scenario.with_overrides({"max_steps": left}), history, start.frame if start else None)
    for number, frame in enumerate(simulation, start=count):
        record(frame)
        if progress is not None:
            progress(frame, number)
    return simulation.outcome
