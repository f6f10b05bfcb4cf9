"""The figure of a diagram: an observable, the number of growing modes or regimes as colours over the plane of the two keys."""

from itertools import cycle, islice

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, CenteredNorm, Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_store import (
    ABOUT_SOLUTION,
    CODES,
    COUNT,
    NOT_COMPUTED,
    OUTCOME,
    REGIME,
    UNSTABLE,
    Diagram,
)
from shapespace.study.regimes import describe, telling_aspects
from shapespace.study.telling import most_telling
from shapespace.view import style
from shapespace.view.curve import draw_curve
from shapespace.view.limits import not_magnified

HEIGHT_MM = 90.0
HATCH = "////"
COUNTED = {UNSTABLE: "growing modes", COUNT: "states"}
MOST_COUNTED = 8
"""Counts beyond this share a colour."""


def plot_diagram(diagram: Diagram, observable: str | None = None) -> Figure:
    """One map for each state, side by side in one scale; hatched where there is none, white where nothing is computed.

    The observable is the most telling one that applies where none is given; `regime` is one map of all states together, and the
    choice for adaptive maps, which have observables at some points only. Boundaries are drawn over it where they were followed.
    """
    if observable == REGIME or (observable is None and diagram.request.adaptive):
        return plot_regimes(diagram)
    data, (x, y) = diagram.dataset, diagram.request.grid.keys
    names = [str(name) for name in data.data_vars if name not in (OUTCOME, *ABOUT_SOLUTION)]
    is_state = data[OUTCOME].isin([CODES[Outcome.CONVERGED], CODES[Outcome.INFERRED]])
    name = observable or _telling(diagram, data.where(is_state))
    if name not in names:
        raise InputError(f"{name}: is no observable of this diagram; choose one of {', '.join(names)}.")
    # What is told of all states at a point together has one map and no state that could be missing.
    is_of_all = "state" in data[OUTCOME].dims and "state" not in data[name].dims
    states = ("",) if is_of_all else diagram.request.labels
    values = (data[name] if is_of_all else data[name].where(is_state)).transpose(..., y, x)
    maps = values.to_numpy().reshape(len(states), *values.shape[-2:])
    outcomes = data[OUTCOME].transpose(..., y, x).to_numpy().reshape(-1, *values.shape[-2:])
    scales = diagram.scenario.scales
    norm, colours = _scale(name, maps, 1.0 if name in COUNTED else scales.factor(name))
    with style.house_style():
        figure = style.new_figure(min(0.4 + 0.4 * len(maps), 1.2), HEIGHT_MM)
        panels = figure.subplots(1, len(maps), squeeze=False, sharey=True)[0]
        for axes, one, codes, state in zip(panels, maps, outcomes, states, strict=False):
            image = axes.pcolormesh(data[x], data[y], one, norm=norm, cmap=colours, rasterized=True)
            if not is_of_all:
                _mark_missing(axes, data[x].to_numpy(), data[y].to_numpy(), codes)
            draw_boundaries(axes, diagram)
            axes.set_xlabel(style.quantity_label(scales, x))
            axes.set_title(state if len(maps) > 1 else "")
        panels[0].set_ylabel(style.quantity_label(scales, y))
        bar = figure.colorbar(image, ax=panels, label=COUNTED.get(name) or style.quantity_label(scales, name))
        if isinstance(norm, BoundaryNorm):
            bar.set_ticks([0.5 * (a + b) for a, b in zip(norm.boundaries, norm.boundaries[1:], strict=False)])
            bar.set_ticklabels([str(count) for count in range(len(norm.boundaries) - 1)])
        bar.outline.set_visible(False)
        _add_legend(figure)
    return figure


def plot_regimes(diagram: Diagram) -> Figure:
    """What the states at each point are like, all of them together, in the aspects that differ somewhere."""
    codes, (x, y) = diagram.regimes, diagram.request.grid.keys
    with style.house_style():
        figure = style.new_figure(0.7, 1.2 * HEIGHT_MM)
        axes = figure.add_subplot()
        draw_regimes(axes, diagram, codes)
        draw_boundaries(axes, diagram)
        axes.set_xlabel(style.quantity_label(diagram.scenario.scales, x))
        axes.set_ylabel(style.quantity_label(diagram.scenario.scales, y))
        _add_legend(figure, columns=1)
    return figure


def _add_legend(figure: Figure, columns: int = 6) -> None:
    """What is drawn on the maps, each once."""
    handles = {label: one for axes in figure.axes for one, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    if handles:
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)


def draw_regimes(axes: Axes, diagram: Diagram, codes: np.ndarray) -> None:
    """Regimes (n_y, n_x) as colours, each named in the legend's handles."""
    x, y = diagram.request.grid.keys
    aspects = telling_aspects(sorted({*codes.ravel().tolist()} - {0}))
    reduced = codes & int(aspects)
    present = sorted({*reduced.ravel().tolist()})
    numbers = np.searchsorted(present, reduced)
    chosen = ["white"] * (0 in present) + [*islice(cycle(style.REGIMES), len(present) - (0 in present))]
    colours: Colormap = ListedColormap(chosen)
    norm = BoundaryNorm(np.arange(len(present) + 1) - 0.5, colours.N)
    data = diagram.dataset
    axes.pcolormesh(data[x], data[y], numbers, norm=norm, cmap=colours, rasterized=True)
    for number, code in enumerate(present):
        axes.fill([], [], facecolor=chosen[number], edgecolor=style.FAINT, lw=0.4, label=describe(code))


def draw_boundaries(axes: Axes, diagram: Diagram) -> None:
    """The curves that bound regions, within the range of the map."""
    keys = diagram.request.grid.keys
    limits = axes.get_xlim(), axes.get_ylim()
    seen: set[str] = set()
    for curve in diagram.boundaries:
        draw_curve(axes, curve, keys, named=curve.of not in seen)
        seen.add(curve.of)
    if diagram.boundaries:
        axes.set(xlim=limits[0], ylim=limits[1])


def _telling(diagram: Diagram, states: xr.Dataset) -> str:
    """The first of TELLING that changes over the map."""
    return most_telling(diagram.scenario, lambda name: float(states[name].max() - states[name].min()))


def _scale(name: str, values: np.ndarray, scale: float) -> tuple[Normalize, Colormap]:
    """Counts in steps, signed values from the middle outwards, others from pale to dark; all told apart without hue.

    scale: of the quantity, so that round-off is not magnified.
    """
    known = values[np.isfinite(values)]
    least, most = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    if name in COUNTED:
        colours = style.regulator_map()
        return BoundaryNorm(np.arange(min(most, MOST_COUNTED) + 2) - 0.5, colours.N), colours
    least, most = not_magnified(least, most, scale)
    if least < 0.0 < most and min(-least, most) > 0.01 * max(-least, most):
        return CenteredNorm(halfrange=max(-least, most)), style.signed_map()
    dark_end = style.regulator_map()
    return Normalize(least, most), dark_end if abs(most) >= abs(least) else dark_end.reversed()


def _mark_missing(axes: Axes, x: np.ndarray, y: np.ndarray, codes: np.ndarray) -> None:
    failed = ~np.isin(codes, (NOT_COMPUTED, CODES[Outcome.CONVERGED], CODES[Outcome.INFERRED]))
    if not failed.any():
        return
    axes.pcolor(x, y, np.ma.masked_where(~failed, codes), hatch=HATCH, facecolor="none", edgecolor=style.FAINT, lw=0.0)
    axes.add_patch(
        Rectangle((0.0, 0.0), 0.0, 0.0, facecolor="white", edgecolor=style.FAINT, hatch=HATCH, label="no state")
    )
