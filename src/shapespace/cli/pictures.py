"""Commands that look at what is stored: `plot`, `movie`, `export`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.cli.shared import Store, StoreOrLabel, app, examples


@app.command(
    help_epilogue=examples(
        "shapespace plot results/guided-division",
        "shapespace plot results/guided-division --out division.pdf",
        "shapespace plot results/guided-division --budget",
        "shapespace plot results/sphere:pitchfork-1",
        "shapespace plot results/sphere:pitchfork-1 --mode 0",
    )
)
def plot(
    store: StoreOrLabel,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(metavar="FILE", help="Picture file; the default is DIR/figure.png, of a label DIR/LABEL.png."),
    ] = None,
    mode: Annotated[
        int | None,
        Parameter(
            metavar="N", help="Draw mode N, from 0, of DIR:LABEL of a branch, or of a state that `steady` stored."
        ),
    ] = None,
    budget: Annotated[
        bool, Parameter(help="Of a run or a state: energy, dissipation by channel and what supplies it (budget.png).")
    ] = False,
    observable: Annotated[
        str | None,
        Parameter(
            name=["--observable", "--of"],
            metavar="NAME",
            help="Of a branch: what to draw against the key that varies; of a diagram: what to map.",
        ),
    ] = None,
) -> None:
    """Draw what is stored.

    Of a run a curve over time, snapshots of the surface, profiles of velocity and curvature; of a branch an observable
    against the key that varies, solid where it is stable, with its special points; of a curve the plane of its two keys; of
    a diagram a map of an observable over that plane; of a search, a stored state or a labelled point the surface with its
    flow and its profiles; of a mode the state displaced by it, the velocity of that motion, and profiles along the curve;
    with --budget what goes into energy and heat, what supplies it, and what the energy law leaves over.
    """
    from shapespace.study.files import replacing
    from shapespace.view.show import plot as draw

    figure = draw(store, observable=observable, mode=mode, budget=budget)
    folder, _, label = (store, "", "") if Path(store).is_dir() else store.rpartition(":")
    what = [label, f"mode-{mode}" if mode is not None else "budget" if budget else "" if label else "figure"]
    target = out or Path(folder) / f"{'-'.join(filter(None, what))}.png"
    if target.suffix[1:] not in (known := figure.canvas.get_supported_filetypes()):
        raise InputError(f"{target}: has no ending of a picture; end it in one of .{', .'.join(sorted(known))}.")
    with replacing(target) as partial:
        figure.savefig(partial, dpi=300)
    print(target)


@app.command(
    help_epilogue=examples(
        "shapespace movie results/guided-division", "shapespace movie results/guided-division --out division.gif"
    )
)
def movie(
    store: Store,
    /,
    *,
    out: Annotated[Path | None, Parameter(metavar="FILE", help="Movie file; the default is DIR/movie.mp4.")] = None,
) -> None:
    """Make a movie of a stored run, or of the states along a branch, as .mp4 or .gif; a gif where there is no ffmpeg."""
    from rich.console import Console
    from rich.progress import Progress

    from shapespace.view.show import movie as save_movie

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("drawing frames", total=None)
        written = save_movie(
            store, out or store / "movie.mp4", lambda done, total: bar.update(task, completed=done, total=total)
        )
    print(written)


@app.command(
    help_epilogue=examples(
        "shapespace export results/guided-division division.nc",
        "shapespace export results/guided-division --vtk",
        "shapespace export results/division --csv",
        "shapespace export results/division:fold-1 --ply",
    )
)
def export(
    store: StoreOrLabel,
    file: Annotated[
        Path | None,
        Parameter(name="FILE", help="File, or folder of meshes; the default is named as the store and lies beside it."),
    ] = None,
    /,
    *,
    netcdf: Annotated[bool, Parameter(help="All of it as one self-describing file; also by the ending .nc.")] = False,
    csv: Annotated[
        bool, Parameter(help="Numbers over times, states or points of a grid; also by the ending .csv.")
    ] = False,
    vtk: Annotated[bool, Parameter(help="Meshes with fields, and series.pvd, for ParaView.")] = False,
    ply: Annotated[bool, Parameter(help="A mesh for each time or state, with fields and colours.")] = False,
) -> None:
    """Write a run, a branch, a curve, a diagram or one state of them in a form that other programs read."""
    from rich.console import Console
    from rich.progress import Progress

    from shapespace.view.export import FORMS
    from shapespace.view.export import export as write

    asked = [
        form for form, wanted in zip(("netcdf", "csv", "vtk", "ply"), (netcdf, csv, vtk, ply), strict=True) if wanted
    ]
    if not asked and file is not None:
        asked = [form for ending, form in FORMS.items() if file.suffix == ending and form in ("netcdf", "csv")]
    if len(asked) != 1:
        what = f"{file}: does not tell the form by its ending; end it in .nc or .csv, or give" if file else "give"
        raise InputError(f"{what if not asked else 'give only'} one of --netcdf, --csv, --vtk, --ply.")
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("writing meshes", total=None)
        written = write(
            store, file, form=asked[0], progress=lambda done, total: bar.update(task, completed=done, total=total)
        )
    print(written)
