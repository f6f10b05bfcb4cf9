"""The command `reproduce`: figures of the paper from the experiments, with a table of what it says and what we get."""

import json
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Annotated, Any

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.cli.shared import AsJson, app, examples, print_lines, tell

FAILED = 1
ALL = "all"
PREFIX = "fig_"


def experiments_folder() -> Path:
    """Of the experiments: in the package where it was installed from a wheel, else in the source tree."""
    package = Path(__file__).parents[1]
    for folder in (package / "experiments", package.parents[1] / "experiments"):
        if (folder / "common.py").is_file():
            return folder
    raise InputError(
        f"reproduce: {package} comes without its experiments; run it from a source tree or a released wheel."
    )


def figure_names(folder: Path) -> list[str]:
    """Of all figures, as the command takes them: 3a, 5abcd and so on."""
    return sorted(path.stem.removeprefix(PREFIX) for path in folder.glob(f"{PREFIX}*.py"))


def _names(word: str, known: Sequence[str]) -> list[str]:
    """Those of a figure or of some of its parts: 5a is part of 5abcd, 7 is 7a, 7b and so on."""
    word = word.lower().removeprefix(PREFIX)
    asked = re.fullmatch(r"(s?\d+)([a-z]*)", word)
    parts = [(name, match) for name in known if (match := re.fullmatch(r"(s?\d+)([a-z]*)", name))]
    found = [name for name, match in parts if asked and match[1] == asked[1] and {*asked[2]} <= {*match[2]}]
    if word in (ALL, *known):
        return [*known] if word == ALL else [word]
    if not found:
        raise InputError(f"{word}: is no figure; choose some of {', '.join(known)}, or all.")
    return found


@app.command(
    help_epilogue=examples(
        "shapespace reproduce 7b 7d --quick",
        "shapespace reproduce all",
    )
)
def reproduce(
    *figures: Annotated[str, Parameter(metavar="FIG", help="Names such as 3a, 7 for all of 7a to 7d, or all.")],
    quick: Annotated[
        bool, Parameter(help="Coarse and in seconds to minutes: leave out what takes long, above all growth rates.")
    ] = False,
    out: Annotated[
        Path, Parameter(metavar="DIR", help="Directory for data and figures, in a folder for each figure.")
    ] = Path("results"),
    as_json: AsJson = False,
) -> int:
    """Make figures of the paper, and a table: what the paper says, what we get, agreement.

    What an earlier call has finished in DIR is read from there. Exit status 1 where something asserted does not hold.
    """
    folder = experiments_folder()
    known = figure_names(folder)
    if not figures:
        raise InputError(f"reproduce: needs figures; give some of {', '.join(known)}, or all.")
    wanted = [*dict.fromkeys(name for one in figures for name in _names(one, known))]
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    records = [_reproduced(name, out, quick, as_json) for name in wanted]
    failed = [record["figure"] for record in records if not record["holds"]]
    if as_json:
        print(json.dumps({"figures": records}, allow_nan=False))
    else:
        count = sum(len(record["rows"]) for record in records)
        agreeing = sum(row["verdict"] == "agrees" for record in records for row in record["rows"])
        failing = sum(not row["holds"] for record in records for row in record["rows"])
        print_lines(f"{len(records)} figures, {count} statements: {agreeing} agree with the paper, {failing} fail")
    if failed:
        tell(f"not as asserted: {', '.join(failed)}.")
    return FAILED if failed else 0


def _reproduced(name: str, out: Path, quick: bool, as_json: bool) -> dict[str, Any]:
    """Make one figure; its record."""
    stem = PREFIX + name
    path = out / (stem + ("-quick" if quick else ""))
    path.mkdir(parents=True, exist_ok=True)
    tell(f"figure {name} ...")
    began = monotonic()
    rows = import_module(stem).run(path, quick)
    seconds = monotonic() - began
    if not as_json:
        print_lines(import_module("common").table_of(rows), f"figure {name}: {seconds:.0f} s; {path / (stem + '.png')}")
    names = {"claim": "claim", "paper": "paper", "here": "ours", "error": "error", "verdict": "verdict"}
    about = [{**{key: getattr(row, name) for key, name in names.items()}, "holds": bool(row.holds)} for row in rows]
    return {
        "figure": name,
        "folder": str(path),
        "seconds": seconds,
        "holds": all(row.holds for row in rows),
        "rows": about,
    }
