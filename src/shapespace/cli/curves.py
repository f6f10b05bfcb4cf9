"""The command `curve`: folds and branch points followed in a second key."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from shapespace.cli.progress import ProgressDisplay, Way
from shapespace.cli.shared import (
    GAVE_UP,
    INTERRUPTED,
    AsJson,
    again,
    app,
    described,
    examples,
    finite,
    kept,
    print_lines,
    read_values,
    stored,
    tell,
    tell_missed,
)

if TYPE_CHECKING:
    from shapespace.study.curve_store import Curve


@app.command(
    name="curve",
    help_epilogue=examples(
        "shapespace curve results/sphere:pitchfork-1 --vary turnover_rate --start 5 --stop 12",
        "shapespace curve results/division:fold-1 --vary peclet --stop 250 --at 400,300 --out results/folds",
        "shapespace plot results/folds",
    ),
)
def curve_command(
    origin: Annotated[
        str, Parameter(name="STORE:LABEL", help="A fold or branch point of a branch, or a point of a curve.")
    ],
    /,
    *,
    vary: Annotated[str, Parameter(metavar="KEY2", help="The key to vary beside that of the branch.")],
    stop: Annotated[float, Parameter(metavar="B", help="Value of KEY2 at which the curve ends.")],
    start: Annotated[
        float | None,
        Parameter(
            metavar="A", help="The other value at which it ends; the default is that of the label, which lies between."
        ),
    ] = None,
    at: Annotated[str | None, Parameter(metavar="V1,V2,...", help="Values of KEY2 to stop at exactly.")] = None,
    out: Annotated[
        Path | None, Parameter(metavar="DIR", help="New directory; the default is results/NAME-KEY-KEY2.")
    ] = None,
    resume: Annotated[bool, Parameter(help="Continue the curve in DIR, or start it where there is none yet.")] = False,
    as_json: AsJson = False,
) -> int:
    """Follow a fold or a branch point in a second key; find and name cusps and other special points on the way."""
    from shapespace.study.curves import curve
    from shapespace.study.run import free_path
    from shapespace.study.starts import find_start

    values = read_values(at)
    known = find_start(origin)
    name = "-".join(filter(None, [known.scenario.name, known.key, vary]))
    path = out or (Path("results") / name if resume else free_path(name))
    keys, ways = (known.key or "", vary), (Way(stop), Way(start))
    try:
        with ProgressDisplay() as display:
            found = curve(
                origin,
                vary,
                stop,
                start=start,
                at=values,
                out=path,
                resume=resume,
                progress=lambda point, count: display.update(
                    f"{count} points, {_at(keys, point.parameters.tolist())} {point.label}".rstrip(),
                    ways[point.leg].share(float(point.parameters[1])),
                    bool(point.label),
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
    return _report(found)


def _report(found: "Curve") -> int:
    """Say on stderr what was missed or went wrong; the exit status."""
    lines = []
    for one in found.missed:
        ends = [_at(found.keys, one[name]) for name in ("parameters_before", "parameters_after")]
        lines.append(f"a {one['kind']} between {ends[0]} and {ends[1]} was not located.")
    tell_missed(lines)
    if found.outcome is None or found.outcome.is_success:
        return 0
    tell(f"the curve ended early ({found.outcome}): {found.outcome.advice} {kept(found.store)}")
    return GAVE_UP


def _at(keys: tuple[str, str], values: "list[float]") -> str:
    return ", ".join(f"{key} = {value:.8g}" for key, value in zip(keys, values, strict=True))


def _record(found: "Curve") -> dict[str, Any]:
    """What --json prints."""
    assert found.outcome is not None
    last = found.points[-1].observables if found.points else {}
    return {
        **described(found.outcome, found.scenario, last),
        "store": None if found.store is None else str(found.store),
        "keys": [*found.keys],
        "kind": found.of,
        "special_points": [
            {
                "label": point.label,
                "kind": point.kind,
                "parameters": dict(zip(found.keys, point.parameters.tolist(), strict=True)),
                "parameter_error": {
                    key: error if math.isfinite(error) else None
                    for key, error in zip(found.keys, point.parameter_errors.tolist(), strict=True)
                },
                "observables": finite(point.observables),
            }
            for point in found.special_points
        ],
        "points": [
            {
                "parameters": dict(zip(found.keys, point.parameters.tolist(), strict=True)),
                "observables": finite(point.observables),
                "label": point.label,
            }
            for point in found.points
            if point.is_step
        ],
        "missed": list(found.missed),
    }


def _summarise(found: "Curve") -> None:
    from rich.table import Table

    table = Table("label", found.keys[0], "error", found.keys[1], "error", box=None, header_style="bold")
    for point in found.special_points:
        cells = zip(point.parameters, point.parameter_errors, strict=True)
        table.add_row(point.label, *(text for value, error in cells for text in (f"{value:.10g}", f"{error:.1g}")))
    assert found.outcome is not None
    count = sum(point.is_step for point in found.points)
    print_lines(
        table,
        f"{found.outcome}: {found.outcome.advice}",
        f"{count} points on a curve of {found.of}s; {stored(found.store)}",
    )
