"""The figure of states: each in a row, its surface with flow and pattern beside its profiles, all on one scale."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from shapespace.view import panels, style
from shapespace.view.figure import (
    common_limits,
    draw_arrow_key,
    draw_coat_key,
    draw_colour_bar,
    draw_length_key,
    label_speed,
    prepare_snapshot_axes,
    swims,
)
from shapespace.view.frames import Profile, Run, read_run
from shapespace.view.limits import not_magnified
from shapespace.view.snapshot import SnapshotArtists, arrow_flows, make_camera, offset_of

SURFACE_MM = 44.0
"""Width of a drawn surface with its keys."""


def plot_states(dataset: xr.Dataset, titles: Sequence[str]) -> Figure:
    """The states of a dataset with fields (state or time, point), with a title for each.

    Raises InputError for a dataset that cannot be drawn.
    """
    if "state" in dataset.dims:
        dataset = dataset.rename_dims(state="time").assign_coords(time=np.arange(float(dataset.sizes["state"])))
    run = read_run(dataset, least=1)
    with style.house_style():
        return _build(run, titles)


def _build(run: Run, titles: Sequence[str]) -> Figure:
    profiles = [run.profile(float(k)) for k in range(len(titles))]
    camera = make_camera(run, profiles)
    cameras = [camera.for_flow(f) if f > 0 else camera for f in arrow_flows(profiles, camera)]
    with_swim = swims(run.dataset)
    limits = common_limits(profiles, cameras, with_swim=with_swim)
    if run.is_open:  # for the key of the coat
        limits = (*limits[:3], limits[3] + 0.3 * camera.size)
    height = float(np.clip(SURFACE_MM * (limits[3] - limits[2]) / (limits[1] - limits[0]), 36.0, 70.0)) + 14.0
    figure = style.new_figure(1.0, height * len(profiles))
    has_bar, has_pattern = run.regulator is not None and not run.is_open, run.regulator is not None
    widths = [1.3] + [0.05] * has_bar + [0.8, 0.8] + [0.8] * has_pattern
    parts = list(np.asarray(figure.subfigures(len(profiles), 1, squeeze=False))[:, 0])
    rows = [list(part.subplots(1, len(widths), width_ratios=widths)) for part in parts]
    columns = [list(column) for column in zip(*rows, strict=True)]
    for part, axes, profile, one, title in zip(parts, columns[0], profiles, cameras, titles, strict=True):
        part.suptitle(title, x=0.004, ha="left", fontsize=8.5)
        SnapshotArtists(axes, one, with_swim=with_swim).show(profile, offset_of(one, profile))
        prepare_snapshot_axes(axes, limits)
        draw_length_key(axes, run, one, limits, at=0.6)
        draw_arrow_key(axes, run, one, limits)
        if with_swim:
            label_speed(axes, run, one, profile)
        if run.is_open:
            draw_coat_key(axes, one, limits, on_top=True)
    if has_bar:
        for part, axes in zip(parts, columns[1], strict=True):
            draw_colour_bar(part, axes, run, camera)
    first = 1 + has_bar
    _draw_column(columns[first], run, profiles, panels.VELOCITIES, "velocity")
    _draw_column(columns[first + 1], run, profiles, panels.CURVATURES, "curvature")
    if has_pattern:
        _draw_pattern(columns[first + 2], run, profiles)
    for axes in rows[-1][first:]:
        axes.set_xlabel(style.axis_label(run.dataset["mesh_coordinate"]))
    return figure


def _draw_column(
    column: Sequence[Axes],
    run: Run,
    profiles: Sequence[Profile],
    variables: Sequence[tuple[str, str, object]],
    words: str,
) -> None:
    """Profiles of some fields, with their scale at each."""
    panels.draw_profiles(column, run, profiles, variables, words)
    for axes in column:
        axes.tick_params(labelleft=True)
        axes.set_ylabel(column[0].get_ylabel())
    column[0].legend(loc="best", borderpad=0.1, labelspacing=0.2, handletextpad=0.4)


def _draw_pattern(column: Sequence[Axes], run: Run, profiles: Sequence[Profile]) -> None:
    """The concentration or the coat along each surface, on one scale."""
    assert run.regulator is not None
    patterns = [profile.regulator for profile in profiles if profile.regulator is not None]
    values = np.concatenate([np.zeros(1), *patterns])
    low, high = not_magnified(float(values.min()), float(values.max()), run.scales.factor(run.regulator))
    pad = 0.08 * (high - low)
    for axes, profile, pattern in zip(column, profiles, patterns, strict=True):
        axes.plot(profile.u, pattern, color=style.INK, linewidth=1.1)
        axes.set(xlim=(0.0, 1.0), ylim=(low - pad, high + pad))
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        units = style.units_of(run.dataset[run.regulator])
        axes.set_ylabel(style.symbol_of(run.dataset[run.regulator]) + (f" ({units})" if units else ""))
