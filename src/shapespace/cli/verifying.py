"""The command `verify`: are the numbers right?"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from shapespace.cli.progress import ProgressDisplay
from shapespace.cli.shared import AsJson, app, examples, print_lines

if TYPE_CHECKING:
    from rich.table import Table

    from shapespace.study.verification.record import Verification


@app.command(
    help_epilogue=examples("shapespace verify --quick", "shapespace verify --html verification.html"),
)
def verify(
    *,
    quick: Annotated[bool, Parameter(help="Only what takes a minute in all.")] = False,
    html: Annotated[
        Path | None, Parameter(metavar="FILE", help="Write the table as a self-contained HTML page.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compute what is known in closed form or published, and print it beside that; exit status 1 where one fails."""
    from shapespace.study.files import storage, write_atomically
    from shapespace.study.verification.table import verify as run_benchmarks
    from shapespace.view.verification import verification_html

    if html is not None:
        # Before minutes of work: that a file can be written there.
        with storage(html):
            html.touch()
    with ProgressDisplay() as display:
        display.start("computing what is known")
        done = run_benchmarks(quick=quick, progress=display.update)
    if html is not None:
        with storage(html):
            write_atomically(html, verification_html(done).encode())
        print_lines(str(html))
    print(json.dumps(done.as_dict(), allow_nan=False)) if as_json else print_lines(_table(done), "", done.verdict)
    return 0 if done.passed else 1


def _table(done: "Verification") -> "Table":
    from rich.table import Table
    from rich.text import Text

    from shapespace.view.verification import shown, small

    table = Table("", "what", "value", "reference", "error", "tolerance", "source", box=None, header_style="bold")
    for result in done.results:
        table.add_row("", Text(f"{result.title} ({result.seconds:.1f} s)", style="bold"))
        for row in result.rows:
            numbers = (shown(row.value), shown(row.reference), small(row.error), small(row.tolerance))
            table.add_row("ok" if row.passed else "FAILED", f"  {row.name}", *numbers, row.note or row.source)
    return table
