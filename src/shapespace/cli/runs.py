"""Commands about scenarios and their dynamics: `scenarios`, `config`, `run`."""

import json
import math
import shlex
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Self

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.cli.shared import (
    GAVE_UP,
    INTERRUPTED,
    AsJson,
    NameOrFile,
    Settings,
    StartFrom,
    app,
    chosen_scenario,
    described,
    examples,
    print_lines,
    print_observables,
    read_settings,
    tell,
)

if TYPE_CHECKING:
    from rich.progress import Progress

    from shapespace.study.frame import Frame
    from shapespace.study.run import Run


@app.command(name="scenarios", help_epilogue=examples("shapespace scenarios"))
def list_scenarios() -> None:
    """List the built-in scenarios."""
    from shapespace.study.scenario import scenario_names, template

    for name in scenario_names():
        title = template(name).splitlines()[0].lstrip("# ")
        print(f"{name:<22}{title}")


@app.command(help_epilogue=examples("shapespace config guided-division --out my.toml"))
def config(
    name: Annotated[str, Parameter(help="A built-in scenario.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="New file to write to; the default is stdout.")] = None,
) -> None:
    """Write the commented TOML file of a built-in scenario, to be changed and given to `shapespace run`."""
    from shapespace.study.files import storage, write_atomically
    from shapespace.study.scenario import template

    text = template(name)
    if out is None:
        print(text, end="")
        return
    with storage(out):
        if out.exists():
            raise InputError(f"{out}: is there already; choose another --out or remove it first.")
        write_atomically(out, text.encode())


@app.command(
    name="run",
    help_epilogue=examples(
        "shapespace run guided-division",
        "shapespace run my.toml -s peclet=300 --until 1 --out weaker",
        "shapespace run my.toml -s peclet=300 --until 3 --out weaker --resume",
    ),
)
def run_command(
    scenario: NameOrFile,
    /,
    *,
    settings: Settings = (),
    until: Annotated[str | None, Parameter(metavar="T", help="End time, short for -s until=T.")] = None,
    dt: Annotated[str | None, Parameter(metavar="DT", help="Fixed time step, short for -s dt=DT; 0: adaptive.")] = None,
    start: StartFrom = None,
    out: Annotated[Path | None, Parameter(metavar="DIR", help="New directory; the default is results/NAME.")] = None,
    resume: Annotated[bool, Parameter(help="Continue the run in DIR, or start it where there is none yet.")] = False,
    as_json: AsJson = False,
) -> int:
    """Simulate a scenario; every time step is stored, so that a run can be stopped at any moment and resumed."""
    from shapespace.study.run import free_path, run

    changes = read_settings([*settings, *(f"{k}={v}" for k, v in (("until", until), ("dt", dt)) if v is not None)])
    chosen = chosen_scenario(scenario, changes, start)
    path = out or (Path("results") / chosen.name if resume else free_path(chosen.name))
    try:
        with ProgressDisplay(chosen.run.until, f"{chosen.name} in {path}") as display:
            result = run(chosen, out=path, resume=resume, start=start, progress=display.update, ready=display.start)
    except KeyboardInterrupt:
        options = [word for key, value in changes.items() for word in ("-s", f"{key}={value}")]
        options += ["--from", start] if start is not None else []
        words = ["shapespace", "run", scenario, *options, "--out", str(path), "--resume"]
        tell(f"interrupted; to continue: {shlex.join(words)}")
        return INTERRUPTED
    print(json.dumps(_record(result), allow_nan=False)) if as_json else _summarise(result)
    if result.outcome.is_success:
        return 0
    tell(f"the solver gave up ({result.outcome}): {result.outcome.advice} The partial run is in {result.store}.")
    return GAVE_UP


class ProgressDisplay:
    """Where a run stands, on stderr: a bar with an ETA on a terminal, else a plain line now and then."""

    def __init__(self, until: float, title: str, seconds_between_lines: float = 5.0) -> None:
        from shapespace.study.pace import Pace

        self._until = until
        self._title = title
        self._pause = seconds_between_lines
        self._pace = Pace(until)
        self._bar: Progress | None = None
        self._told = -math.inf

    def __enter__(self) -> Self:
        return self

    def start(self, frames: int) -> None:
        """Appear: the input was good, and the store has so many frames already."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        tell(f"continuing {self._title} after {frames} frames" if frames else f"starting {self._title}")
        console = Console(stderr=True)
        if console.is_terminal:
            columns = [TextColumn("{task.percentage:>3.0f} %"), BarColumn(20), TextColumn("{task.description}")]
            self._bar = Progress(*columns, console=console, transient=True)
            self._bar.add_task("preparing ...", total=self._until)
            self._bar.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, frame: "Frame", steps: int) -> None:
        """Take note of a new frame."""
        text = self._pace.describe(frame, steps)
        if self._bar is not None:
            task = self._bar.task_ids[0]
            self._bar.update(task, completed=min(frame.time, self._until), description=text)
        elif (now := monotonic()) - self._told >= self._pause:
            self._told = now
            tell(f"{100 * min(frame.time / self._until, 1):.0f} %: {text}")


def _record(run: "Run") -> dict[str, object]:
    return {
        **described(run.outcome, run.scenario, run.observables),
        "store": str(run.store),
        "steps": run.steps,
        "wall_time": run.wall_time,
    }


def _summarise(run: "Run") -> None:
    print_observables(run.scenario, run.observables)
    print_lines(
        f"{run.outcome}: {run.outcome.advice}",
        f"{run.steps} steps, {run.wall_time:.1f} s; stored in {run.store}",
    )
