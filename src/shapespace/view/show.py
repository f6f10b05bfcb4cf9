"""Pictures of runs, branches, curves and diagrams, stored or in memory: what `ss.plot` and `ss.movie` do."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from shapespace.base.errors import InputError
from shapespace.study.branch_store import Branch, open_branch
from shapespace.study.curve_store import Curve, open_curve
from shapespace.study.dataset import open_dataset
from shapespace.study.diagram_store import Diagram, open_diagram
from shapespace.study.modes import find_modes
from shapespace.study.records import noun_of
from shapespace.study.tables import branch_dataset
from shapespace.view.branch import plot_branch
from shapespace.view.budget import plot_budget
from shapespace.view.curve import plot_curve
from shapespace.view.diagram import plot_diagram
from shapespace.view.figure import plot_run
from shapespace.view.mode import plot_mode
from shapespace.view.movie import save_movie


class HasDataset(Protocol):
    """A run: anything with a dataset."""

    @property
    def dataset(self) -> xr.Dataset:
        """Fields and observables of all frames."""


Source = HasDataset | xr.Dataset | str | Path
"""A run, its dataset, or the directory of a stored run."""


def _dataset_of(source: Source) -> xr.Dataset:
    if isinstance(source, xr.Dataset):
        return source
    return open_dataset(source) if isinstance(source, str | Path) else source.dataset


def film_of(source: Source | Branch) -> xr.Dataset:
    """What a movie shows: a run over time, or the states along a branch, where the key takes the place of time.

    Where the branch turns, so that a value of the key comes twice, its arclength does.
    """
    if isinstance(source, str | Path) and noun_of(source) == "branch":
        source = open_branch(source)
    if not isinstance(source, Branch):
        return _dataset_of(source)
    data = branch_dataset(source)
    steps = np.diff(data["arclength"])
    data = data.isel(state=np.flatnonzero(np.concatenate([[True], steps > 0.0])))
    along = data[source.key]
    change = np.diff(along)
    if (change < 0.0).all():
        data = data.isel(state=slice(None, None, -1))
        along, change = data[source.key], -change
    if not (change > 0.0).all():
        along = data["arclength"].assign_attrs(symbol="s", units="1")
    words = {"words": str(along.name).replace("_", " ")}
    return data.assign_coords(time=("state", along.to_numpy(), along.attrs | words)).swap_dims(state="time")


_OPENED: dict[str, Callable[[str | Path], Branch | Curve | Diagram]] = {
    "branch": open_branch,
    "curve": open_curve,
    "diagram": open_diagram,
}


def _figure(source: Source | Branch | Curve | Diagram, observable: str | None) -> Figure:
    if isinstance(source, str | Path) and (noun := noun_of(source)) in _OPENED:
        source = _OPENED[noun](source)
    if isinstance(source, Branch):
        return plot_branch(source, observable)
    if isinstance(source, Diagram):
        return plot_diagram(source, observable)
    if observable is not None:
        raise InputError(f"observable = {observable!r}: is for the figure of a branch or a diagram; leave it away.")
    return plot_curve(source) if isinstance(source, Curve) else plot_run(_dataset_of(source))


def plot(
    source: Source | Branch | Curve | Diagram,
    out: str | Path | None = None,
    *,
    observable: str | None = None,
    mode: int | None = None,
    budget: bool = False,
) -> Figure:
    """The figure of a run, a branch, a curve or a diagram, stored or not; also written to `out` (.png, .pdf, .svg) if given.

    observable: of a branch, what to draw against the key; of a diagram, what to map. mode: number of a mode of a stored state to
    draw instead, `source` being `DIR:LABEL` of a branch or `DIR` of a state.
    budget: of a run or a state, what goes into energy and heat and what supplies it.
    """
    if budget:
        if mode is not None or isinstance(source, Branch | Curve | Diagram):
            raise InputError("budget = True: is for the figure of a run or of a stored state; leave it away.")
        figure = plot_budget(_dataset_of(source))
    elif mode is None:
        figure = _figure(source, observable)
    elif isinstance(source, str | Path):
        figure = plot_mode(find_modes(str(source)), mode)
    else:
        raise InputError(f"mode = {mode}: is drawn from a stored state; give its directory, or DIR:LABEL.")
    if out is not None:
        figure.savefig(out)
    return figure


def movie(source: Source | Branch, out: str | Path, progress: Callable[[int, int], None] | None = None) -> Path:
    """Write the movie of a run, or of the states along a branch, as .mp4, or .gif without ffmpeg; returns the path written."""
    return save_movie(film_of(source), Path(out), progress)
