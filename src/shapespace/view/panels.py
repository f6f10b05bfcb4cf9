"""The diagrams around the snapshots: the curve over time, and profiles of velocity and curvature over u."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, NullLocator

from shapespace.study.telling import LEAST_CHANGE
from shapespace.view import limits, style
from shapespace.view.frames import Array, Profile, Run, observable, progress_measure
from shapespace.view.labels import label_points

GROWTH = "growth speed"  # not an observable: the normal velocity of the apex
_OWN_SCALE_FACTOR = {"velocity": 10.0, "curvature": 4.0}  # between the ranges of a row: more, and each has its own
_EARLY = 0.03  # part of the run's time
_REST = 0.01  # velocities below this part of the row's largest are rest: not magnified
_LEAST_GROWTH = 1e-5  # part of the largest growth speed at which its logarithmic axis ends
_INSET_FACTOR = 8.0  # a peak this much above its surroundings is shown enlarged

VELOCITIES = (("tangential_velocity", style.RED, "-"), ("normal_velocity", style.BLUE, (0, (4, 1.2))))
CURVATURES = (("azimuthal_curvature", style.PURPLE, "-"), ("meridional_curvature", style.ORANGE, (0, (4, 1.2))))


def draw_curve(axes: Axes, run: Run, name: str, twin: str | None, marked: Sequence[int]) -> None:
    """An observable over time, dots at the `marked` frames, and a second series on the right axis."""
    values, colour = observable(run.dataset, name), colour_of(name)
    axes.plot(run.time, values, color=colour, zorder=3)
    axes.plot(run.time[marked], values[marked], "o", color=colour, markersize=4, markeredgecolor="white", zorder=4)
    axes.set_xlabel(style.axis_label(run.dataset["time"]))
    axes.set_ylabel(style.axis_label(run.dataset[name]), color=colour)
    axes.tick_params(axis="y", labelcolor=colour)
    _scale_time(axes, run, values)
    axes.margins(x=0.015)
    _scale_values(axes, values, run.scales.factor(name))
    if twin is not None:
        _draw_twin(axes, run, twin, early_time(run, values))


def colour_of(name: str) -> str:
    """Growth in red as the flow arrows, swimming in green as its arrow, all else in blue."""
    return {GROWTH: style.RED, "velocity": style.GREEN}.get(name, style.BLUE)


def _scale_values(axes: Axes, values: Array, scale: float) -> None:
    """The y axis of a series, whose round-off is not magnified."""
    low, high = limits.not_magnified(float(np.nanmin(values)), float(np.nanmax(values)), scale)
    axes.set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))


def _scale_time(axes: Axes, run: Run, values: Array) -> None:
    """Logarithmic time, linear near 0, where most of the change takes up too small a part of a linear axis."""
    early = early_time(run, values)
    if early > 0:
        inches = axes.get_position().width * axes.figure.bbox.width / axes.figure.dpi
        limits.scale_by_powers(axes, "x", early, (0.0, run.time[-1]), room=0.45 / inches)


def early_time(run: Run, values: Array) -> float:
    """The power of ten below the time of the first changes, if half of all change is over very early; else 0."""
    change = progress_measure(run, values, time_share=0.0)
    first, half = (float(np.interp(part, change, run.time)) for part in (0.03, 0.5))
    if run.time[0] != 0 or half > _EARLY * run.time[-1]:
        return 0.0
    return float(10.0 ** np.floor(np.log10(first)))


def number_dots(axes: Axes, run: Run, name: str, marked: Sequence[int]) -> None:
    """Numbers beside the dots of `draw_curve`; to be called last."""
    values = observable(run.dataset, name)
    labels = [(str(number), run.time[k], values[k]) for number, k in enumerate(marked, start=1)]
    label_points(axes, labels, fontsize=8, fontweight="bold", color=colour_of(name))


def _draw_twin(axes: Axes, run: Run, twin: str, early: float) -> None:
    """A second series on the right axis; growth is logarithmic where time is, as it starts like a power of time."""
    right = axes.twinx()
    right.spines["right"].set_visible(True)
    if twin == GROWTH:
        values = run.fields["normal_velocity"][:, 0]
        text = f"growth speed ({style.units_of(run.dataset['normal_velocity'])})"
    else:
        values = observable(run.dataset, twin)
        text = style.axis_label(run.dataset[twin])
    colour = colour_of(twin)
    right.plot(run.time, values, color=colour, linestyle=(0, (4, 1.2)), zorder=2)
    right.set_ylabel(text, color=colour)
    right.tick_params(axis="y", labelcolor=colour)
    if twin == GROWTH and early > 0 and values.max() == np.abs(values).max() > 0:
        right.set_yscale("log", nonpositive="mask")
        right.set_ylim(_LEAST_GROWTH * values.max(), 2.0 * values.max())
        right.yaxis.set_minor_locator(NullLocator())
    else:
        _scale_values(right, values, run.scales.factor("normal_velocity" if twin == GROWTH else twin))
    axes.set_zorder(right.get_zorder() + 1)
    axes.patch.set_visible(False)


def draw_profiles(
    row: Sequence[Axes], run: Run, profiles: Sequence[Profile], variables: Sequence[tuple[str, str, object]], words: str
) -> None:
    """One row of panels over u, one per snapshot; equal scales unless the ranges differ too much to be read."""
    for axes, profile in zip(row, profiles, strict=True):
        axes.axhline(0, color=style.FAINT, linewidth=0.6, zorder=1)
        for name, colour, dashes in variables:
            label = style.symbol_of(run.dataset[name])
            axes.plot(profile.u, values_of(profile, name), color=colour, linestyle=dashes, linewidth=1.1, label=label)
        axes.set_xlim(0, 1)
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10], min_n_ticks=3))
    size = float(run.fields["radius"].max())
    least, rest = (1.0 / size, 0.0) if words == "curvature" else (0.0, _REST)
    ranges = [_range(profile, variables, least) for profile in profiles]
    scale = run.scales.factor(variables[0][0])
    common = limits.not_magnified(min(low for low, _ in ranges), max(high for _, high in ranges), scale)
    widths = np.array([high - low for low, high in ranges])
    seen = widths > max(rest * widths.max(), LEAST_CHANGE * scale)
    apart = bool(seen.any()) and widths.max() > _OWN_SCALE_FACTOR[words] * widths[seen].min()
    for k, (axes, (low, high)) in enumerate(zip(row, ranges, strict=True)):
        if not apart:
            low, high = common
        elif not seen[k]:
            low, high = rest * common[0], rest * common[1]
        pad = 0.08 * (high - low) or 1.0
        axes.set_ylim(low - pad, high + pad)
        axes.tick_params(labelleft=apart or k == 0)
    row[0].set_ylabel(f"{words} ({style.units_of(run.dataset[variables[0][0]])})")


def values_of(profile: Profile, name: str) -> Array:
    """A field of a profile by its name in the dataset."""
    values: dict[str, Array] = {
        "tangential_velocity": profile.tangential,
        "normal_velocity": profile.normal,
        "azimuthal_curvature": profile.azimuthal_curvature,
        "meridional_curvature": profile.meridional_curvature,
    }
    return values[name]


def _range(profile: Profile, variables: Sequence[tuple[str, str, object]], least: float) -> tuple[float, float]:
    """Lowest and highest value, zero included; at least `least` apart, so that round-off is not magnified."""
    values = np.concatenate([[0.0], *(values_of(profile, name) for name, _, _ in variables)])
    low, high = float(values.min()), float(values.max())
    missing = max(0.0, least - (high - low))
    return low - 0.5 * missing, high + 0.5 * missing


def draw_neck_inset(axes: Axes, profile: Profile) -> Axes | None:
    """The meridional curvature around its peak near u = 1/2, stretched in u; None where there is no such peak."""
    curvature, u = profile.meridional_curvature, profile.u
    middle = np.abs(u - 0.5) < 0.15
    peak = np.abs(np.where(middle, curvature, 0.0))
    outside = float(np.abs(curvature[~middle]).max())
    k = int(np.argmax(peak))
    if peak[k] < _INSET_FACTOR * outside:
        return None
    around = np.abs(u - 0.5)[middle & (peak > 0.1 * peak[k])].max()
    power = int(np.floor(np.log10(around)))
    half = float(np.ceil(around * 10.0**-power))
    _, colour, _ = CURVATURES[1]
    # Same heights as in the panel around it: its y axis serves both.
    bottom, top = (1.06 * curvature[k], 0.0) if curvature[k] < 0 else (0.0, 1.06 * curvature[k])
    inset = axes.inset_axes((0.58, bottom, 0.42, top - bottom), transform=axes.transData)
    inset.plot((u - 0.5) * 10.0**-power, curvature, color=colour, linewidth=1.1)
    inset.set_xlim(-half, half)
    inset.set_ylim(bottom, top)
    inset.set_xticks([-half, 0, half], [style.number(-half), "0", style.number(half)])
    inset.set_yticks([])
    if curvature[k] < 0:
        inset.xaxis.set_ticks_position("top")
        inset.xaxis.set_label_position("top")
        inset.spines["top"].set_visible(True)
        inset.spines["bottom"].set_visible(False)
    inset.tick_params(pad=1.0, length=2)
    factor = f"10^{{{-power}}}\\," if power else ""
    inset.set_xlabel(rf"${factor}(u-\frac{{1}}{{2}})$", fontsize=7, labelpad=3.5, x=1.0, ha="right")
    inset.set_in_layout(False)
    return inset
