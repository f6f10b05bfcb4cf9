"""The figure of budgets: energy, what supplies and dissipates it, what the energy law leaves over, the regulator's amount."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from shapespace.base.errors import InputError
from shapespace.view import style
from shapespace.view.limits import scale_by_powers

LINES = {
    "energy_rate": ("dF/dt", style.INK, "-"),
    "shear_dissipation": ("shear", style.BLUE, "-"),
    "bulk_dissipation": ("bulk", style.PURPLE, "-"),
    "bending_dissipation": ("bending", style.ORANGE, "-"),
    "friction_dissipation": ("friction", style.GREEN, "-"),
    "chemical_dissipation": ("reaction", style.RED, "-"),
    "force_power": ("forces", style.ORANGE, "--"),
    "boundary_power": ("ends", style.BLUE, "--"),
    "chemical_power": ("activity", style.RED, "--"),
}
"""Words, colour and line of what goes into energy and heat (solid) and of what supplies it (dashed)."""
PANEL_MM = 42.0
_QUIET = 1e-2
"""Where the dissipation ends below this part of its largest value, powers are logarithmic above it."""
_EARLY = 0.03
"""Where half of what is dissipated is so early a part of the run, time is logarithmic."""


def plot_budget(dataset: xr.Dataset) -> Figure:
    """The budgets of a run over time, or of a single state as bars. InputError for a dataset without them."""
    if "dissipation" not in dataset:
        raise InputError("the budgets: are not stored in this run; run it again with this shapespace.")
    with style.house_style():
        return _plot_state(dataset) if dataset.sizes["time"] == 1 else _plot_run(dataset)


def _plot_run(dataset: xr.Dataset) -> Figure:
    count = 4 if "amount" in dataset else 3
    figure = style.new_figure(0.8, count * PANEL_MM)
    rows: Sequence[Axes] = figure.subplots(count, 1, sharex=True)
    time, heat = dataset["time"].values, dataset["dissipation"].values
    rows[0].plot(time, dataset["energy"], color=style.INK)
    rows[0].set_ylabel(style.axis_label(dataset["energy"]))
    for name in _moving(dataset):
        words, colour, line = LINES[name]
        rows[1].plot(time, dataset[name], color=colour, linestyle=line, label=words)
    rows[1].axhline(0.0, color=style.FAINT, linewidth=0.6, zorder=1)
    if heat[-1] < _QUIET * np.nanmax(heat):
        powers = np.concatenate([dataset[name].values for name in _moving(dataset)])
        span = float(np.nanmin(powers, initial=0.0)), float(np.nanmax(powers, initial=0.0))
        scale_by_powers(rows[1], "y", _QUIET * float(np.nanmax(heat)), span, room=0.1)
    rows[1].set_ylabel(f"power ({style.units_of(dataset['dissipation'])})")
    rows[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="into heat, supply (dashed)")
    rest = np.abs(dataset["energy_residual"].values)
    rows[2].plot(time, np.where(rest > 0.0, rest, np.nan), color=style.RED, label="rest of the energy law")
    rows[2].plot(time, heat, color=style.INK, label="dissipation")
    rows[2].set_yscale("log")
    rows[2].set_ylabel(f"power ({style.units_of(dataset['dissipation'])})")
    rows[2].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    if count > 3:
        rows[3].plot(time, dataset["amount"], color=style.INK)
        rows[3].set_ylabel(style.axis_label(dataset["amount"]))
        rows[3].yaxis.set_major_locator(MaxNLocator(4))
    _scale_time(rows[-1], dataset)
    rows[-1].set_xlabel(style.axis_label(dataset["time"]))
    return figure


def _moving(dataset: xr.Dataset) -> list[str]:
    """The powers that are there and not zero all the time."""
    return [name for name in LINES if name in dataset and np.nanmax(np.abs(dataset[name].values), initial=0.0) > 0.0]


def _scale_time(axes: Axes, dataset: xr.Dataset) -> None:
    """Logarithmic time, linear near 0, where most is dissipated in a small first part of the run."""
    time, heat = dataset["time"].values, np.nan_to_num(dataset["dissipation"].values)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (heat[1:] + heat[:-1]) * np.diff(time))])
    half = float(np.interp(0.5 * share[-1], share, time))
    if time[0] == 0.0 and 0.0 < half < _EARLY * time[-1]:
        early = float(10.0 ** np.floor(np.log10(half / 10.0)))
        scale_by_powers(axes, "x", early, (0.0, float(time[-1])), room=0.08)
        axes.set_xlim(0.0, time[-1])


def _plot_state(dataset: xr.Dataset) -> Figure:
    """A bar for each power of one state: what dissipates, what supplies (pale), what is left over."""
    names = [*_moving(dataset), "energy_residual"]
    words = [*(LINES[name][0] for name in names[:-1]), "rest of the energy law"]
    figure = style.new_figure(0.6, 18.0 + 7.0 * len(names))
    axes = figure.subplots()
    values = np.abs([float(dataset[name][0]) for name in names])
    colours = [*(LINES[name][1] for name in names[:-1]), style.FAINT]
    bars = axes.barh(range(len(names)), values, color=colours)
    axes.bar_label(bars, [style.number(float(value)) for value in values], padding=3)
    axes.margins(x=0.25)
    for bar, name in zip(bars, names, strict=True):
        bar.set_alpha(0.45 if name in LINES and LINES[name][2] == "--" else 1.0)
    if values[-1] >= abs(float(dataset["dissipation"][0])):
        axes.set_title("at equilibrium: these powers are round-off", fontsize="medium")
    axes.set_yticks(range(len(names)), words)
    axes.invert_yaxis()
    axes.set_xlabel(f"power ({style.units_of(dataset['dissipation'])})")
    return figure
