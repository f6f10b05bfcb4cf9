"""The command `explore`: stores in a browser."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.cli.shared import app, examples, tell


@app.command(
    help_epilogue=examples(
        "shapespace explore results/division",
        "shapespace explore results/*",
        "shapespace explore results/division results/folds --export division.html",
    )
)
def explore(
    *stores: Annotated[
        Path, Parameter(name="DIR", help="Directories of runs, branches, curves, searches and diagrams.")
    ],
    port: Annotated[int, Parameter(metavar="N", help="Port to listen on; the default is any free one.")] = 0,
    export: Annotated[
        Path | None, Parameter(metavar="FILE.html", help="Write one file instead, which works without this program.")
    ] = None,
    open_browser: Annotated[bool, Parameter(name="--open", help="Open the address in the browser.")] = False,
) -> None:
    """Look at what is stored: click a point and see its shape, its flow, its growth rates and their modes.

    Serves a page to this machine until interrupted, and prints its address, which holds a token.
    """
    from shapespace.app.explore import Explorer
    from shapespace.app.explore import export as write

    for path in stores:
        if not path.is_dir():
            raise InputError(f"{path}: is not a directory that holds results; give one that `shapespace` made.")
    if export is not None:
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
            task = bar.add_task("reading states", total=None)
            written = write(stores, export, lambda done, total: bar.update(task, completed=done, total=total))
        print(written)
        return
    explorer = Explorer(stores, port)
    print(explorer.address, flush=True)
    tell("serving this machine; press Ctrl-C to end.")
    if open_browser:
        import webbrowser

        webbrowser.open(explorer.address)
    explorer.serve()
