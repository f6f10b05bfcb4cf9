"""The command `search`: which stationary states there are at given parameters."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from shapespace.cli.progress import ProgressDisplay
from shapespace.cli.shared import (
    GAVE_UP,
    INTERRUPTED,
    AsJson,
    NameOrFile,
    Settings,
    again,
    app,
    described,
    examples,
    find_scenario,
    finite,
    print_lines,
    read_settings,
    tell,
)

if TYPE_CHECKING:
    from shapespace.study.search_store import Search, Tried


@app.command(
    name="search",
    help_epilogue=examples(
        "shapespace search polar-swimmer -s peclet=24",
        "shapespace search guided-division -s ring_amplitude=1.8 --out results/three",
        "shapespace search guided-division -s ring_amplitude=1.8 --from results/division --json",
        "shapespace branch guided-division --vary ring_amplitude --stop 4 --from results/three:state-3",
    ),
)
def search_command(
    scenario: NameOrFile,
    /,
    *,
    settings: Settings = (),
    origins: Annotated[
        tuple[str, ...],
        Parameter(
            name="--from",
            metavar="STORE[:LABEL]",
            help="Start also from a stored run, or from all labelled points of a branch; may be repeated.",
        ),
    ] = (),
    starts: Annotated[int, Parameter(metavar="N", help="Try at most so many starts; the default is 200.")] = 200,
    out: Annotated[
        Path | None, Parameter(metavar="DIR", help="New directory; the default is results/NAME-states.")
    ] = None,
    resume: Annotated[bool, Parameter(help="Continue the search in DIR, or start it where there is none yet.")] = False,
    as_json: AsJson = False,
) -> int:
    """Search for all stationary states at these parameters, stable or not; mirror images count as one."""
    from shapespace.study.run import free_path
    from shapespace.study.searching import search_states

    chosen = find_scenario(scenario).with_overrides(read_settings(settings))
    name = f"{chosen.name}-states"
    path = out or (Path("results") / name if resume else free_path(name))
    try:
        with ProgressDisplay() as display:
            found = search_states(
                chosen,
                origins=origins,
                max_tries=starts,
                out=path,
                resume=resume,
                progress=lambda one: display.update(_described(one), is_notable=bool(one.label)),
                ready=lambda count: display.start(
                    f"continuing {path} after {count} starts" if count else f"starting {path}"
                ),
            )
    except KeyboardInterrupt:
        tell(f"interrupted; to continue: {again(path)}")
        return INTERRUPTED
    if as_json:
        print(json.dumps(_record(found), allow_nan=False))
    else:
        _summarise(found)
    assert found.outcome is not None
    if not found.states:
        tell(f"none of {len(found.tried)} starts led to a stationary state; give others with --from.")
        return GAVE_UP
    return 0


def _described(one: "Tried") -> str:
    """A try in a line."""
    growing = "" if one.n_unstable is None else f", n_unstable {one.n_unstable}"
    return f"start {one.place + 1} ({one.start}): {one.label or one.outcome}{growing}"


def _record(found: "Search") -> dict[str, Any]:
    """What --json prints."""
    from shapespace.study.modes import neutral_modes

    assert found.outcome is not None
    return {
        **described(found.outcome, found.scenario, {}),
        "store": str(found.store),
        "states": [
            {
                "label": one.label,
                "start": one.start,
                "observables": finite(one.observables),
                "growth_rates": one.growth_rates.tolist(),
                "growth_rate_errors": one.growth_rate_errors.tolist(),
                "parities": list(one.parities),
                "neutral_modes": neutral_modes(found.scenario, one.neutral),
                "n_unstable": one.n_unstable,
                "has_mirror_image": one.is_mirrored,
                "residual": one.residual,
            }
            for one in found.states
        ],
        "tried": [
            {
                "start": one.start,
                "outcome": one.outcome,
                "state": found.label_of(one),
                "iterations": one.iterations,
                "residual": one.residual if math.isfinite(one.residual) else None,
            }
            for one in found.tried
        ],
    }


def _summarise(found: "Search") -> None:
    from rich.table import Table

    headings, *rows = found.table
    table = Table(*headings, box=None, header_style="bold")
    for row in rows:
        table.add_row(*row)
    assert found.outcome is not None
    print_lines(table, "", found.counts, f"{found.outcome}: {found.outcome.advice}", f"stored in {found.store}")
