"""Pictures of results, stored or in memory: what `ss.plot` and `ss.movie` do."""

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
from shapespace.study.manifests import holds_store, noun_of
from shapespace.study.modes import find_modes
from shapespace.study.search_store import Search, Tried, open_search
from shapespace.study.stored_starts import stored_start
from shapespace.study.tables import branch_dataset, names_state, search_dataset, state_dataset
from shapespace.view import style
from shapespace.view.branch import plot_branch
from shapespace.view.budget import plot_budget
from shapespace.view.curve import plot_curve
from shapespace.view.diagram import plot_diagram
from shapespace.view.figure import plot_run
from shapespace.view.mode import plot_mode
from shapespace.view.movie import save_movie
from shapespace.view.states import plot_states


class HasDataset(Protocol):
    """A run: anything with a dataset."""

    @property
    def dataset(self) -> xr.Dataset:
        """Fields and observables of all frames."""


Source = HasDataset | xr.Dataset | str | Path
"""A run, its dataset, or the directory of a stored one."""
Stored = Branch | Curve | Diagram | Search
"""Other results, which have no course in time."""
FILMED = ("run", "branch")


def _dataset_of(source: Source) -> xr.Dataset:
    if isinstance(source, xr.Dataset):
        return source
    return open_dataset(source) if isinstance(source, str | Path) else source.dataset


def film_of(source: Source | Branch) -> xr.Dataset:
    """What a movie shows: a run over time, or the states along a branch, where the key takes the place of time.

    Where the branch turns, so that a value of the key comes twice, its arclength does, and the key is shown beside it.
    """
    if isinstance(source, str | Path):
        noun = noun_of(source)
        if noun not in FILMED and (noun or not holds_store(source)):
            what = f"holds a {noun}" if noun else "holds no run or branch"
            raise InputError(
                f"{source}: {what}; a movie shows a run or the states along a branch: give a directory that `shapespace run` or "
                "`shapespace branch` made."
            )
        source = open_branch(source) if noun == "branch" else source
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
    words = {"words": str(along.name)}
    return data.assign_coords(time=("state", along.to_numpy(), along.attrs | words)).swap_dims(state="time")


_OPENED: dict[str, Callable[[str | Path], Branch | Curve | Diagram | Search]] = {
    "branch": open_branch,
    "curve": open_curve,
    "diagram": open_diagram,
    "search": open_search,
}


def _figure(source: Source | Stored, observable: str | None) -> Figure:
    if isinstance(source, str | Path) and (noun := noun_of(source)) in _OPENED:
        source = _OPENED[noun](source)
    if isinstance(source, Branch):
        return plot_branch(source, observable)
    if isinstance(source, Diagram):
        return plot_diagram(source, observable)
    if observable is not None:
        raise InputError(f"observable {observable}: is for the figure of a branch or a diagram; leave it away.")
    if isinstance(source, Curve):
        return plot_curve(source)
    if isinstance(source, Search):
        return plot_states(search_dataset(source), [_told(state) for state in source.states])
    if isinstance(source, str | Path) and names_state(source):
        return _point_figure(str(source))
    data = _dataset_of(source)
    # A stored state is a run that has not begun, with the flow that its forces drive.
    is_state = data.sizes.get("time") == 1 and bool(np.isfinite(data["normal_velocity"]).all())
    return plot_states(data, [str(data.attrs["scenario"])]) if is_state else plot_run(data)


def _told(state: Tried) -> str:
    """A state of a search in words."""
    if state.n_unstable is None:
        return state.label
    return f"{state.label}: {'stable' if state.n_unstable == 0 else f'{state.n_unstable} growing'}"


def _point_figure(text: str) -> Figure:
    """Of the state that `STORE:LABEL` names, titled by its label and its values of the keys that vary."""
    start = stored_start(text)
    values = start.scenario.values()
    told = [style.quantity_value(start.scenario.scales, key, float(values[key]), ".6g") for key in start.keys]
    return plot_states(state_dataset(start), [", ".join([Path(text).name, *told])])


def plot(
    source: Source | Stored,
    out: str | Path | None = None,
    *,
    observable: str | None = None,
    mode: int | None = None,
    budget: bool = False,
) -> Figure:
    """The figure of a result, stored or not; also written to `out` (.png, .pdf, .svg) if given.

    source: a run, a branch, a curve, a diagram or a search, its directory, that of a stored state, or `DIR:LABEL` for one state
    of a store. observable: of a branch, what to draw against the key; of a diagram, what to map. mode: number of a mode of
    `DIR:LABEL` of a branch or of a stored state, to draw instead. budget: of a run or a stored state, what goes into energy and
    heat and what supplies it.
    """
    if mode is not None:
        if observable is not None or budget or not isinstance(source, str | Path):
            raise InputError(
                f"mode {mode}: is drawn from a stored state, without observable and budget; give its directory, or DIR:LABEL."
            )
        figure = plot_mode(find_modes(str(source)), mode)
    elif budget:
        is_other = isinstance(source, str | Path) and (noun_of(source) in _OPENED or names_state(source))
        if observable is not None or is_other or isinstance(source, Stored):
            raise InputError("budget: is for the figure of a run or of a state that `steady` stored; leave it away.")
        figure = plot_budget(_dataset_of(source))
    else:
        figure = _figure(source, observable)
    if out is not None:
        figure.savefig(out)
    return figure


def movie(source: Source | Branch, out: str | Path, progress: Callable[[int, int], None] | None = None) -> Path:
    """Write the movie of a run, or of the states along a branch, as .mp4, or .gif without ffmpeg; returns the path written."""
    return save_movie(film_of(source), Path(out), progress)
