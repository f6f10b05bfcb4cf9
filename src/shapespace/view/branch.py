"""The figure of a branch: an observable against the key that varies, solid where stable, special points marked and named."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from shapespace.base.errors import InputError
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import Branch
from shapespace.study.telling import most_telling
from shapespace.view import style
from shapespace.view.labels import label_points
from shapespace.view.limits import not_magnified

MARKS = {"fold": "s", "pitchfork": "D", "transcritical": "D", "branch-point": "D", "hopf": "o", "user": "|", "end": ""}
"""By kind; physical ends and stalls are crosses."""
HEIGHT_MM = 110.0
MARGIN = 0.1
"""Above and below the lines, for labels."""


def plot_branch(branch: Branch, observable: str | None = None) -> Figure:
    """The branch diagram; the observable is the most telling one that applies where none is given."""
    name = observable or telling_observable(branch)
    known = [point for point in branch.points if name in point.observables]
    if not known:
        names = ", ".join(branch.points[0].observables) if branch.points else "none"
        raise InputError(f"{name}: is no observable of this branch; choose one of {names}.")
    with style.house_style():
        figure = style.new_figure(0.75, HEIGHT_MM)
        axes = figure.add_subplot()
        lines = draw_lines(axes, branch.points, name)
        specials = [point for point in known if point in branch.special_points]
        _draw_specials(axes, specials, name)
        axes.margins(x=0.06)
        axes.set_ylim(*_range([point.observables[name] for point in known], branch.scenario.scales.factor(name)))
        axes.set_xlabel(style.quantity_label(branch.scenario.scales, branch.key))
        axes.set_ylabel(style.quantity_label(branch.scenario.scales, name))
        axes.legend(handles=line_handles(lines), loc="best")
        label_points(axes, [(one.label, one.parameter, one.observables[name]) for one in specials if one.kind != "end"])
    return figure


def _range(values: Sequence[float], scale: float) -> tuple[float, float]:
    low, high = not_magnified(min(values), max(values), scale)
    return low - MARGIN * (high - low), high + MARGIN * (high - low)


def telling_observable(branch: Branch) -> str:
    """What answers along a branch in an observable, else the first of TELLING that changes."""
    if branch.free in branch.points[0].observables:
        return str(branch.free)
    return most_telling(
        branch.scenario,
        lambda name: float(np.ptp([point.observables[name] for point in branch.points])),
        (branch.key,),
    )


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
        last = found[-1][-1]
        found[-1].append(point)
        if point.is_step and last.is_step and _line(point.n_unstable) != _line(last.n_unstable):
            found[-1].pop()
            found.append([last, point])
        if point.label and point.n_unstable_before != point.n_unstable_after:
            found.append([point])
    return [stretch for stretch in found if len(stretch) > 1]


def draw_lines(
    axes: Axes, points: Sequence[BranchPoint], name: str, across: str | None = None, colour: str | None = None
) -> set[str]:
    """Points in the order of their branch as lines: solid where nothing grows, dashed where something does, dotted where that
    is not known; returns which. across: observable to the right in place of the parameter; colour: one for all lines.
    """
    return {_draw_stretch(axes, stretch, name, across, colour) for stretch in stretches(points, name)}


def _draw_stretch(axes: Axes, stretch: Sequence[BranchPoint], name: str, across: str | None, colour: str | None) -> str:
    inner = [point for point in stretch[1:] if point.is_step] or [point for point in stretch if point.is_step]
    # Between two special points within one step the first one knows.
    line = _line(inner[0].n_unstable if inner else stretch[0].n_unstable_after)
    x = [point.observables[across] if across else point.parameter for point in stretch]
    y = [point.observables[name] for point in stretch]
    axes.plot(x, y, line, color=colour or (style.BLUE if line == "-" else style.INK))
    return line


def _line(growing: int | None) -> str:
    return ":" if growing is None else "-" if growing == 0 else "--"


def _draw_specials(axes: Axes, points: Sequence[BranchPoint], name: str) -> None:
    for point in points:
        mark = MARKS.get(point.kind, "X")
        axes.plot(point.parameter, point.observables[name], mark, color=style.RED, markersize=4.0, zorder=3)


def line_handles(lines: set[str], stable: str = style.BLUE) -> list[Line2D]:
    """What the lines mean, for a legend, of those that were drawn. stable: colour of what is stable."""
    handles = [
        Line2D([], [], color=stable, linestyle="-", label="stable"),
        Line2D([], [], color=style.INK, linestyle="--", label="unstable"),
        Line2D([], [], color=style.INK, linestyle=":", label="stability not known"),
    ]
    return [handle for handle in handles if handle.get_linestyle() in lines]
