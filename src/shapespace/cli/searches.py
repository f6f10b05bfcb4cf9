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

SHOWN = ("height", "neck_radius", "velocity")
"""Observables by which states are told apart at a glance; all are in the store."""


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
    from collections import Counter

    from rich.table import Table

    shown = [name for name in SHOWN if any(name in one.observables for one in found.states)]
    table = Table("state", *shown, "growing", "leading rate", "mirror", box=None, header_style="bold")
    for one in found.states:
        values = [_rounded(one.observables[name]) if name in one.observables else "" for name in shown]
        rate = f"{one.growth_rates[0][0]:.6g}" if len(one.growth_rates) else ""
        growing = "?" if one.n_unstable is None else str(one.n_unstable)
        table.add_row(one.label, *values, growing, rate, "other" if one.is_mirrored else "same")
    assert found.outcome is not None
    counts = Counter("new state" if one.label else one.outcome for one in found.tried)
    ends = ", ".join(f"{count} {name}" for name, count in counts.most_common())
    print_lines(table, "", f"{len(found.tried)} starts: {ends}", f"{found.outcome}: {found.outcome.advice}")
    print_lines(f"stored in {found.store}")


def _rounded(value: float) -> str:
    """Five decimals, and no minus before a zero."""
    return f"{round(value, 5) + 0.0:.5f}"
