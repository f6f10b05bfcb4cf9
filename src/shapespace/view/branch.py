"""The figure of a branch: an observable against the key that varies, solid where stable, special points marked and named."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import Branch
from shapespace.view import style

TELLING = ("neck_radius", "velocity", "height")
"""Observables in the order in which they are tried; a symmetric surface does not swim, and its velocity tells nothing."""
LEAST_CHANGE = 1e-6
MARKS = {"fold": "s", "pitchfork": "D", "transcritical": "D", "branch-point": "D", "hopf": "o", "user": "|", "end": ""}
"""By kind; physical ends and stalls are crosses."""
HEIGHT_MM = 110.0


def plot_branch(branch: Branch, observable: str | None = None) -> Figure:
    """The branch diagram; the observable is the most telling one that applies where none is given."""
    name = observable or telling_observable(branch)
    known = [point for point in branch.points if name in point.observables]
    if not known:
        names = ", ".join(branch.points[0].observables) if branch.points else "none"
        raise InputError(f"{name}: is no observable of this branch; choose one of {names}.")
    with style.house_style():
        figure = Figure(figsize=(style.WIDTH_MM * 0.75 * style.MM, HEIGHT_MM * style.MM), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        for stretch in stretches(branch.points, name):
            _draw_stretch(axes, stretch, name)
        specials = [point for point in known if point in branch.special_points]
        _draw_specials(axes, specials, name)
        axes.margins(0.06, 0.1)
        axes.set_xlabel(_label(branch, branch.key))
        axes.set_ylabel(_label(branch, name))
        axes.legend(handles=_legend(branch), loc="best")
    return figure


def telling_observable(branch: Branch) -> str:
    """The first of TELLING that exists on most of the branch and changes along it."""
    for name in TELLING:
        values = [point.observables[name] for point in branch.points if name in point.observables]
        if 2 * len(values) > len(branch.points) and np.ptp(values) > LEAST_CHANGE:
            return name
    return "height"


def stretches(points: Sequence[BranchPoint], name: str) -> list[list[BranchPoint]]:
    """Runs of neighbours that have the observable and one stability, each with the special point that ends it."""
    found: list[list[BranchPoint]] = []
    for point in points:
        if name not in point.observables:
            found.append([])
            continue
        if not found or not found[-1]:
            found.append([point])
            continue
        found[-1].append(point)
        if point.label and point.n_unstable_before != point.n_unstable_after:
            found.append([point])
    return [stretch for stretch in found if len(stretch) > 1]


def _draw_stretch(axes: Axes, stretch: Sequence[BranchPoint], name: str) -> None:
    """Solid where nothing grows, dashed where something does, dotted where that is not known."""
    inner = [point.n_unstable for point in stretch if point.is_step] or [None]
    known = [count for count in inner if count is not None]
    line = ":" if not known else "-" if max(known) == 0 else "--"
    x, y = zip(*((point.parameter, point.observables[name]) for point in stretch), strict=True)
    axes.plot(x, y, line, color=style.BLUE if line == "-" else style.INK)


def _draw_specials(axes: Axes, points: Sequence[BranchPoint], name: str) -> None:
    for number, point in enumerate(points):
        mark = MARKS.get(point.kind, "X")
        x, y = point.parameter, point.observables[name]
        axes.plot(x, y, mark, color=style.RED, markersize=4.0, zorder=3)
        if point.kind != "end":
            offset = (5, 5 if number % 2 == 0 else -9)
            axes.annotate(point.label, (x, y), offset, textcoords="offset points", fontsize=6.5)


def _label(branch: Branch, name: str) -> str:
    quantity = QUANTITIES[name]
    attributes = {"symbol": quantity.symbol, "units": branch.scenario.scales.unit(name)}
    return style.axis_label(xr.DataArray(0.0, name=name, attrs=attributes), words=name.replace("_", " "))


def _legend(branch: Branch) -> list[Line2D]:
    """What the lines and marks mean, of those that occur."""
    counts = {point.n_unstable for point in branch.points if point.is_step}
    lines = []
    if 0 in counts:
        lines.append(Line2D([], [], color=style.BLUE, label="stable"))
    if counts - {0, None}:
        lines.append(Line2D([], [], color=style.INK, linestyle="--", label="unstable"))
    if None in counts:
        lines.append(Line2D([], [], color=style.INK, linestyle=":", label="stability not known"))
    return lines
