"""The command `branch`: stationary states followed in one key."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.cli.progress import ProgressDisplay, Way
from shapespace.cli.shared import (
    GAVE_UP,
    INTERRUPTED,
    AsJson,
    NameOrFile,
    Settings,
    StartFrom,
    again,
    app,
    described,
    examples,
    find_scenario,
    finite,
    kept,
    print_lines,
    read_settings,
    stored,
    tell,
    tell_missed,
)

AS_ASKED = 1e-7
"""Relative difference by which a point may miss a value of --at: stops at observables are as exact as the states."""

if TYPE_CHECKING:
    from shapespace.study.branch_point import BranchPoint
    from shapespace.study.branch_store import Branch


@app.command(
    name="branch",
    help_epilogue=examples(
        "shapespace branch polar-swimmer --vary peclet --start 15 --stop 30 --out results/sphere",
        "shapespace branch polar-swimmer --vary peclet --stop 60 --from results/sphere:pitchfork-1 --side 1",
        "shapespace branch guided-division --vary ring_amplitude --start 0 --stop 4.2 --at 1.5,neck_radius=0.5",
        "shapespace branch membrane-protrusion --vary height --free pulling_force --start 0.6 --stop 1.2",
    ),
)
def branch_command(
    scenario: NameOrFile,
    /,
    *,
    vary: Annotated[str, Parameter(metavar="KEY", help="The key to vary; with --free, an observable.")],
    stop: Annotated[float, Parameter(metavar="B", help="Value of the key at which the branch ends.")],
    start: Annotated[
        float | None, Parameter(metavar="A", help="Value of the key to start at; the default is that of the start.")
    ] = None,
    free: Annotated[
        str | None, Parameter(metavar="KEY", help="The key that answers while an observable is prescribed.")
    ] = None,
    at: Annotated[
        str | None,
        Parameter(metavar="V1,V2,...", help="Values to stop at exactly; of observables as NAME=VALUE."),
    ] = None,
    settings: Settings = (),
    origin: StartFrom = None,
    state: Annotated[
        str | None,
        Parameter(
            metavar="NAME", help="Start from this state: default, trivial; of vesicles prolate, oblate, stomatocyte."
        ),
    ] = None,
    side: Annotated[
        int, Parameter(metavar="1|-1|0", help="From a branch point: the other branch to one or the other side.")
    ] = 0,
    both: Annotated[bool, Parameter(help="Also the other way from A, as far as B is on this side.")] = False,
    no_stability: Annotated[bool, Parameter(help="Without growth rates, in about a third of the time.")] = False,
    out: Annotated[
        Path | None, Parameter(metavar="DIR", help="New directory; the default is results/NAME-KEY.")
    ] = None,
    resume: Annotated[bool, Parameter(help="Continue the branch in DIR, or start it where there is none yet.")] = False,
    as_json: AsJson = False,
) -> int:
    """Follow a stationary state while one key changes, through folds; find and name the special points on the way."""
    from shapespace.study.branching import branch
    from shapespace.study.run import free_path
    from shapespace.study.starts import find_start

    values = _read_places(at)
    changes = read_settings(settings)
    chosen = find_scenario(scenario).with_overrides(changes)
    if origin is not None:
        chosen = find_start(origin).placing(chosen, {*changes, vary})
    name = f"{chosen.name}-{vary}"
    path = out or (Path("results") / name if resume else free_path(name))
    way = Way(stop)
    try:
        with ProgressDisplay() as display:
            found = branch(
                chosen,
                vary,
                stop,
                start=start,
                free=free,
                at=values,
                origin=origin,
                state=state,
                side=side,
                both=both,
                stability=not no_stability,
                out=path,
                resume=resume,
                progress=lambda point, count: display.update(
                    _described(vary, point, count), way.share(point.parameter), bool(point.label)
                ),
                ready=lambda count: display.start(
                    f"continuing {path} after {count} points" if count else f"starting {path}"
                ),
            )
    except KeyboardInterrupt:
        tell(f"interrupted; to continue: {again(path)}")
        return INTERRUPTED
    if as_json:
        print(json.dumps(_record(found), allow_nan=False))
    else:
        _summarise(found)
    return _report(found, values, stability=not no_stability)


def _report(found: "Branch", places: Sequence[float | tuple[str, float]], stability: bool) -> int:
    """Say on stderr what was missed, of `places` too, or went wrong; the exit status."""
    unknown = [point for point in found.points if stability and point.is_step and point.n_unstable is None]
    for outcome in dict.fromkeys(Outcome(point.spectrum) for point in unknown):
        places = [point.parameter for point in unknown if point.spectrum == outcome]
        tell(
            f"the growth rates of {len(places)} points are not known, the first at {found.key} = {places[0]:.8g} "
            f"({outcome}): {outcome.advice}"
        )
    tell_missed(
        [
            f"a {one['kind']} between {found.key} = {one['parameter_before']:.8g} and {one['parameter_after']:.8g} was not "
            f"located ({one['outcome']})."
            for one in found.missed
        ]
    )
    for place in places:
        name, value = place if isinstance(place, tuple) else (found.key, place)
        met = (one.parameter if name == found.key else one.observables.get(name, math.nan) for one in found.points)
        if not any(math.isclose(one, value, rel_tol=AS_ASKED, abs_tol=AS_ASKED) for one in met):
            tell(f"--at {name}={value:.8g}: the branch did not come there.")
    if found.outcome is None or found.outcome.is_success:
        return 0
    words = [f"the branch ended early ({found.outcome}): {found.outcome.advice}", found.detail]
    tell(" ".join([*filter(None, words), kept(found.store)]))
    return GAVE_UP


def _read_places(text: str | None) -> list[float | tuple[str, float]]:
    """The values of --at: numbers, and (observable, value) pairs."""
    try:
        return [_read_place(part) for part in text.split(",")] if text else []
    except ValueError:
        raise InputError(
            f"--at {text}: must be numbers with commas between them, or NAME=VALUE of observables, e.g. --at 1.5,height=0.6."
        ) from None


def _read_place(text: str) -> float | tuple[str, float]:
    name, equals, value = (part.strip() for part in text.rpartition("="))
    return (name, float(value)) if equals else float(text)


def _described(key: str, point: "BranchPoint", count: int) -> str:
    """A point in a line."""
    growing = "" if point.n_unstable is None else f", n_unstable {point.n_unstable}"
    began = f" from the state {point.began}" if point.began else ""
    return f"{count} points, {key} = {point.parameter:.8g}{growing} {point.label}{began}".rstrip()


def _record(found: "Branch") -> dict[str, Any]:
    """What --json prints."""
    from shapespace.study.modes import neutral_modes

    assert found.outcome is not None
    last = found.points[-1].observables if found.points else {}
    return {
        **described(found.outcome, found.scenario, last),
        "store": None if found.store is None else str(found.store),
        "vary": found.key,
        "free": found.free,
        "began": found.began,
        "special_points": [
            {
                "label": point.label,
                "kind": point.kind,
                "parameter": point.parameter,
                **_freed(found, point),
                "parameter_error": point.parameter_error if math.isfinite(point.parameter_error) else None,
                "observables": finite(point.observables),
                "growth_rates": point.growth_rates.tolist(),
                "growth_rate_errors": point.growth_rate_errors.tolist(),
                "parities": list(point.parities),
                "neutral_modes": neutral_modes(found.scenario_at(point), point.neutral),
                "n_unstable_before": point.n_unstable_before,
                "n_unstable_after": point.n_unstable_after,
            }
            for point in found.special_points
        ],
        "points": [
            {
                "parameter": point.parameter,
                **_freed(found, point),
                "observables": finite(point.observables),
                "n_unstable": point.n_unstable,
                "label": point.label,
            }
            for point in found.points
            if point.is_step
        ],
        "missed": list(found.missed),
    }


def _freed(found: "Branch", point: "BranchPoint") -> dict[str, float]:
    """The value of the key that answers, by its name, where there is one."""
    return {} if found.free is None or point.freed is None else {found.free: point.freed}


def _summarise(found: "Branch") -> None:
    from rich.table import Table

    table = Table(
        "label", found.key, "error", "growing before", "after", "leading rate", "mode", box=None, header_style="bold"
    )
    for point in found.special_points:
        counts = ["?" if n is None else str(n) for n in (point.n_unstable_before, point.n_unstable_after)]
        rate = f"{point.growth_rates[0][0]:.6g}" if len(point.growth_rates) else ""
        parity = next(iter(point.parities), None) or ""
        table.add_row(point.label, f"{point.parameter:.10g}", f"{point.parameter_error:.1g}", *counts, rate, parity)
    assert found.outcome is not None
    count = sum(point.is_step for point in found.points)
    began = f" from the state {found.began}" if found.began else ""
    print_lines(table, f"{found.outcome}: {found.outcome.advice}", f"{count} points{began}; {stored(found.store)}")
