"""The command line: reads arguments, calls the library, reports. Results go to stdout, the rest to stderr.

Exit status: 0 success, 1 a failed check, 2 bad input (nothing written), 3 the solver gave up (partial store kept),
130 interrupted (store ready to resume). Libraries that load slowly are imported by the commands that need them.
"""

import json
import math
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Self

from cyclopts import App, CycloptsError, Parameter

from shapespace.base.errors import InputError

if TYPE_CHECKING:
    from rich.progress import Progress

    from shapespace.study.frame import Frame
    from shapespace.study.run import Run
    from shapespace.study.scenario import Scenario

BAD_INPUT, GAVE_UP, INTERRUPTED = 2, 3, 130


def _examples(*lines: str) -> str:
    return "\n  ".join(["Examples:", *lines])


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("shapespace")
    except PackageNotFoundError:
        return "0 (not installed)"


app = App(
    name="shapespace",
    help="Dynamics and stationary shapes of axisymmetric active fluid surfaces.",
    help_epilogue=_examples(
        "shapespace run guided-division",
        "shapespace plot results/guided-division",
        "shapespace config ring-slipping --out my.toml",
        "shapespace run my.toml -s peclet=300",
    ),
    help_format="plaintext",
    version=_version,
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative=(), show_default=False),
)

Store = Annotated[Path, Parameter(name="DIR", help="Directory of a run, as `shapespace run` made it.")]


@app.command(name="scenarios", help_epilogue=_examples("shapespace scenarios"))
def list_scenarios() -> None:
    """List the built-in scenarios."""
    from shapespace.study.scenario import scenario_names, template

    for name in scenario_names():
        title = template(name).splitlines()[0].lstrip("# ")
        print(f"{name:<22}{title}")


@app.command(help_epilogue=_examples("shapespace config guided-division --out my.toml"))
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
    help_epilogue=_examples(
        "shapespace run guided-division",
        "shapespace run my.toml -s peclet=300 --until 1 --out weaker",
        "shapespace run my.toml -s peclet=300 --until 3 --out weaker --resume",
    ),
)
def run_command(
    scenario: Annotated[str, Parameter(name="NAME_OR_FILE", help="A built-in scenario or a TOML file.")],
    /,
    *,
    settings: Annotated[
        tuple[str, ...],
        Parameter(name=["--set", "-s"], metavar="KEY=VALUE", help="Change a key of the scenario; may be repeated."),
    ] = (),
    until: Annotated[str | None, Parameter(metavar="T", help="End time, short for -s until=T.")] = None,
    dt: Annotated[str | None, Parameter(metavar="DT", help="Fixed time step, short for -s dt=DT; 0: adaptive.")] = None,
    out: Annotated[Path | None, Parameter(metavar="DIR", help="New directory; the default is results/NAME.")] = None,
    resume: Annotated[bool, Parameter(help="Continue the run in DIR, or start it where there is none yet.")] = False,
    as_json: Annotated[bool, Parameter(name="--json", help="End with one line of JSON on stdout.")] = False,
) -> int:
    """Simulate a scenario; every time step is stored, so that a run can be stopped at any moment and resumed."""
    from shapespace.study.run import free_path, run

    changes = _read_settings([*settings, *(f"{k}={v}" for k, v in (("until", until), ("dt", dt)) if v is not None)])
    chosen = _find_scenario(scenario).with_overrides(changes)
    path = out or (Path("results") / chosen.name if resume else free_path(chosen.name))
    try:
        with ProgressDisplay(chosen.run.until, f"{chosen.name} in {path}") as display:
            result = run(chosen, out=path, resume=resume, progress=display.update, ready=display.start)
    except KeyboardInterrupt:
        options = [word for key, value in changes.items() for word in ("-s", f"{key}={value}")]
        words = ["shapespace", "run", scenario, *options, "--out", str(path), "--resume"]
        _tell(f"interrupted; to continue: {shlex.join(words)}")
        return INTERRUPTED
    print(json.dumps(_record(result), allow_nan=False)) if as_json else _summarise(result)
    if result.outcome.is_success:
        return 0
    _tell(f"the solver gave up ({result.outcome}): {result.outcome.advice} The partial run is in {result.store}.")
    return GAVE_UP


@app.command(
    help_epilogue=_examples(
        "shapespace plot results/guided-division", "shapespace plot results/guided-division --out division.pdf"
    )
)
def plot(
    store: Store,
    /,
    *,
    out: Annotated[Path | None, Parameter(metavar="FILE", help="Picture file; the default is DIR/figure.png.")] = None,
) -> None:
    """Draw a stored run: a curve over time, snapshots of the surface, profiles of velocity and curvature."""
    from shapespace.study.dataset import open_dataset
    from shapespace.study.files import replacing
    from shapespace.view.figure import plot_run

    figure = plot_run(open_dataset(store))
    target = out or store / "figure.png"
    if target.suffix[1:] not in (known := figure.canvas.get_supported_filetypes()):
        raise InputError(f"{target}: has no ending of a picture; end it in one of .{', .'.join(sorted(known))}.")
    with replacing(target) as partial:
        figure.savefig(partial, dpi=300)
    print(target)


@app.command(
    help_epilogue=_examples(
        "shapespace movie results/guided-division", "shapespace movie results/guided-division --out division.gif"
    )
)
def movie(
    store: Store,
    /,
    *,
    out: Annotated[Path | None, Parameter(metavar="FILE", help="Movie file; the default is DIR/movie.mp4.")] = None,
) -> None:
    """Make a movie of a stored run, as .mp4 or .gif; a gif where there is no ffmpeg."""
    from rich.console import Console
    from rich.progress import Progress

    from shapespace.study.dataset import open_dataset
    from shapespace.view.movie import save_movie

    dataset = open_dataset(store)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("drawing frames", total=None)
        written = save_movie(
            dataset, out or store / "movie.mp4", lambda done, total: bar.update(task, completed=done, total=total)
        )
    print(written)


@app.command(help_epilogue=_examples("shapespace export results/guided-division division.nc"))
def export(
    store: Store,
    file: Annotated[Path, Parameter(name="FILE", help="NetCDF file, ending in .nc.")],
    /,
) -> None:
    """Write a stored run as one self-describing NetCDF file, readable by xarray, Python, Julia, MATLAB."""
    from shapespace.study.dataset import open_dataset
    from shapespace.study.files import storage, write_atomically

    if file.suffix != ".nc":
        raise InputError(f"{file}: is not named as a NetCDF file; end it in .nc.")
    # Made in memory: HDF5 crashes the process at its end when a disk is full under an open file.
    data = open_dataset(store).to_netcdf(engine="h5netcdf")
    with storage(file):
        write_atomically(file, bytes(data))
    print(file)


@app.command(help_epilogue=_examples("shapespace check"))
def check() -> int:
    """Check this installation: versions, double precision, a small solve, writing here, a movie writer."""
    from shapespace.study.check import probe_precision, probe_solve, probe_versions, probe_writing

    probes = {
        "versions": probe_versions,
        "double precision": probe_precision,
        "small solve": probe_solve,
        "writing": probe_writing,
        "movie writer": _probe_movie,
    }
    failed = 0
    for name, probe in probes.items():
        try:
            print(f"ok      {name}: {probe()}", flush=True)
        except _TROUBLE as trouble:
            failed += 1
            print(f"failed  {name}: {' '.join(str(trouble).split()) or type(trouble).__name__}", flush=True)
    return 1 if failed else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    tokens = _spread(sys.argv[1:] if arguments is None else arguments)
    try:
        status = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except InputError as error:
        _tell(str(error))
        return BAD_INPUT
    except CycloptsError as error:
        _tell(f"{' '.join(str(error).split())} See `shapespace --help`.")
        return BAD_INPUT
    except KeyboardInterrupt:
        _tell("interrupted.")
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of stdout has left (`| head`): not an error, but Python must not try to flush again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return status if isinstance(status, int) else 0


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

        _tell(f"continuing {self._title} after {frames} frames" if frames else f"starting {self._title}")
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
            _tell(f"{100 * min(frame.time / self._until, 1):.0f} %: {text}")


def _tell(text: str) -> None:
    print(f"shapespace: {text}", file=sys.stderr, flush=True)


def _spread(tokens: Sequence[str]) -> list[str]:
    """`-s a=1 b=2` as `-s a=1 -s b=2`."""
    result: list[str] = []
    in_settings = False
    for token in tokens:
        if in_settings and "=" in token and not token.startswith("-") and result[-1] not in ("-s", "--set"):
            result.append("-s")
        in_settings = token in ("-s", "--set") or (in_settings and "=" in token and not token.startswith("-"))
        result.append(token)
    return result


def _read_settings(settings: Sequence[str]) -> dict[str, str]:
    changes: dict[str, str] = {}
    for text in settings:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise InputError(f"-s {text}: must be KEY=VALUE without blanks, e.g. -s peclet=300.")
        if key in changes:
            raise InputError(f"{key} = {value}: is given twice, also as {changes[key]}; give it once.")
        changes[key] = value
    return changes


def _find_scenario(name_or_file: str) -> "Scenario":
    from shapespace.study.scenario import load_scenario, scenario, scenario_names

    is_file = name_or_file.endswith(".toml") or os.sep in name_or_file or Path(name_or_file).exists()
    is_name = name_or_file in scenario_names() or not is_file
    return scenario(name_or_file) if is_name else load_scenario(name_or_file)


def _record(run: "Run") -> dict[str, object]:
    """What --json prints: numbers as numbers, and only those that there are."""
    return {
        "outcome": run.outcome.value,
        "advice": run.outcome.advice,
        "scenario": run.scenario.name,
        "parameters": run.scenario.values(),
        "observables": {name: value for name, value in run.observables.items() if math.isfinite(value)},
        "store": str(run.store),
        "steps": run.steps,
        "wall_time": run.wall_time,
    }


def _summarise(run: "Run") -> None:
    from rich.console import Console
    from rich.table import Table

    from shapespace.base.scales import QUANTITIES

    table = Table("observable", "symbol", "value", "unit", box=None, header_style="bold")
    for name, value in run.observables.items():
        symbol = QUANTITIES[name].symbol if name in QUANTITIES else ""
        unit = run.scenario.scales.unit(name) if name in QUANTITIES else ""
        table.add_row(name, symbol, f"{value:.8g}", "" if unit == "1" else unit)
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(table)
    console.print(f"{run.outcome}: {run.outcome.advice}")
    console.print(f"{run.steps} steps, {run.wall_time:.1f} s; stored in {run.store}")


def _probe_movie() -> str:
    from shapespace.view.movie import find_ffmpeg

    if found := find_ffmpeg():
        return f"mp4 by {found}"
    import PIL

    return f"gif by Pillow {PIL.__version__}; for mp4 install ffmpeg or the extra shapespace[movie]"


# What a broken installation may raise; anything else is an error in this program and should be seen as one.
_TROUBLE = (ImportError, OSError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RuntimeError)

if __name__ == "__main__":
    sys.exit(main())
