"""Commands about scenarios and their dynamics: `scenarios`, `config`, `run`."""

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.cli.progress import ProgressDisplay
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
    from shapespace.base.outcome import Outcome
    from shapespace.study.run import Run


@app.command(name="scenarios", help_epilogue=examples("shapespace scenarios"))
def list_scenarios() -> None:
    """List the built-in scenarios."""
    from shapespace.study.plugins import load_installed
    from shapespace.study.scenario import scenario_names, template

    load_installed()
    for name in scenario_names():
        title = template(name).splitlines()[0].lstrip("# ")
        print(f"{name:<22}{title}")


@app.command(
    help_epilogue=examples(
        "shapespace config guided-division --out my.toml",
        'shapespace config vesicle --units length="10 um" --units energy="85 pN nm" --units time="1 s"',
    )
)
def config(
    name: Annotated[str, Parameter(help="A built-in scenario.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="New file to write to; the default is stdout.")] = None,
    units: Annotated[
        tuple[str, ...],
        Parameter(
            metavar="BASE=SIZE",
            help="In physical units: how large the scenario's unit of length, energy, time or concentration is; repeat for each.",
        ),
    ] = (),
) -> None:
    """Write the commented TOML file of a built-in scenario, to be changed and given to `shapespace run`."""
    from shapespace.study.files import storage, write_atomically
    from shapespace.study.scenario import template

    text = template(name, read_settings(units, "--units", "length=10 um"))
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
    from shapespace.study.pace import Pace
    from shapespace.study.run import free_path, run

    changes = read_settings([*settings, *(f"{k}={v}" for k, v in (("until", until), ("dt", dt)) if v is not None)])
    chosen = chosen_scenario(scenario, changes, start)
    path = out or (Path("results") / chosen.name if resume else free_path(chosen.name))
    title, pace = f"{chosen.name} in {path}", Pace(chosen.run.until)
    try:
        with ProgressDisplay() as display:
            result = run(
                chosen,
                out=path,
                resume=resume,
                start=start,
                progress=lambda frame, steps: display.update(
                    pace.describe(frame, steps), frame.time / chosen.run.until
                ),
                ready=lambda count: display.start(
                    f"continuing {title} after {count} frames" if count else f"starting {title}"
                ),
            )
    except KeyboardInterrupt:
        options = [word for key, value in changes.items() for word in ("-s", f"{key}={value}")]
        options += ["--from", start] if start is not None else []
        words = ["shapespace", "run", scenario, *options, "--out", str(path), "--resume"]
        tell(f"interrupted; to continue: {shlex.join(words)}")
        return INTERRUPTED
    outcome = result.outcome
    assert outcome is not None
    print(json.dumps(_record(result, outcome), allow_nan=False)) if as_json else _summarise(result, outcome)
    if result.warning:
        tell(result.warning)
    if outcome.is_success:
        return 0
    tell(f"the solver gave up ({outcome}): {outcome.advice} The partial run is in {result.store}.")
    return GAVE_UP


def _record(run: "Run", outcome: "Outcome") -> dict[str, object]:
    return {
        **described(outcome, run.scenario, run.observables),
        "store": str(run.store),
        "steps": run.steps,
        "wall_time": run.wall_time,
    }


def _summarise(run: "Run", outcome: "Outcome") -> None:
    print_observables(run.scenario, run.observables)
    print_lines(
        f"{outcome}: {outcome.advice}",
        f"{run.steps} steps, {run.wall_time:.1f} s; stored in {run.store}",
    )
