"""The figure of a run: a curve over time, snapshots of the surface, profiles of velocity and curvature below them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from shapespace.view import panels, style
from shapespace.view.frames import Profile, Run, observable, progress_measure, read_run, snapshot_frames
from shapespace.view.snapshot import (
    Camera,
    SnapshotArtists,
    arrow_flows,
    extent,
    fastest_flow,
    make_camera,
    offset_of,
    swim_arrow,
)

SNAPSHOTS = 5
Limits = tuple[float, float, float, float]  # left, right, bottom, top


@dataclass(frozen=True)
class Layout:
    """What the figure of one scenario shows: the observable of the curve, a second one, and extras of the snapshots."""

    curve: str
    twin: str | None = None
    with_swim: bool = False
    with_inset: bool = False

    @property
    def observables(self) -> tuple[str, ...]:
        """The observables that the dataset must hold."""
        return (self.curve, *([self.twin] if self.twin and self.twin != panels.GROWTH else []))


_LAYOUTS = {
    "membrane-protrusion": Layout("height", twin=panels.GROWTH),
    "ring-slipping": Layout("ring_position", twin="velocity", with_swim=True),
    "polar-swimmer": Layout("velocity", twin="polarity", with_swim=True),
    "guided-division": Layout("equator_radius", with_inset=True),
    "vesicle": Layout("bending_energy"),
}
_BY_MODEL = {"open-membrane": "membrane-protrusion", "vesicle": "vesicle"}
_GENERIC_CURVES = ("equator_radius", "height", "neck_radius", "ring_position", "length", "area", "velocity")


def layout_of(dataset: xr.Dataset) -> Layout:
    """The layout by scenario name; for others by model and by which observables there are."""
    scenario = str(dataset.attrs.get("scenario", ""))
    if scenario in _LAYOUTS:
        return _LAYOUTS[scenario]
    if (model := dataset.attrs.get("kind", dataset.attrs.get("model"))) in _BY_MODEL:
        return _LAYOUTS[_BY_MODEL[model]]
    curve = next((name for name in _GENERIC_CURVES if name in dataset), _GENERIC_CURVES[0])
    is_swimmer = curve != "velocity" and swims(dataset)
    return Layout(curve, twin="velocity" if is_swimmer else None, with_swim=is_swimmer, with_inset=True)


def swims(dataset: xr.Dataset) -> bool:
    """Whether a surface moves along its axis at a speed that could be seen beside its flow."""
    if not {"velocity", "normal_velocity"} <= set(dataset.variables):
        return False
    return float(np.abs(dataset["velocity"]).max()) > 1e-3 * float(np.abs(dataset["normal_velocity"]).max())


def plot_run(dataset: xr.Dataset) -> Figure:
    """The figure of a stored run at 180 mm width; save it with `figure.savefig(path, dpi=300)`.

    Layout by `dataset.attrs['scenario']`, else by its model: (a) an observable over time; (b) snapshots at instructive
    times, all on one scale, over their profiles of velocity and curvature. Raises InputError for a dataset that cannot
    be drawn.
    """
    layout = layout_of(dataset)
    run = read_run(dataset, layout.observables)
    with style.house_style():
        return _build(run, layout, snapshot_frames(progress_measure(run, observable(dataset, layout.curve)), SNAPSHOTS))


def _build(run: Run, layout: Layout, chosen: Sequence[int]) -> Figure:
    """Three parts, each laid out on its own: the snapshots need not leave room for the numbers of the panels."""
    profiles = [run.profile(float(k)) for k in chosen]
    camera = make_camera(run, profiles)
    cameras = [camera.for_flow(f) if f > 0 else camera for f in arrow_flows(profiles, camera)]
    limits = common_limits(profiles, cameras, with_swim=layout.with_swim)
    columns = len(profiles)
    cell_mm = (style.WIDTH_MM - 18) / max(columns, 3)
    snapshots_mm = float(np.clip(cell_mm * (limits[3] - limits[2]) / (limits[1] - limits[0]), 18, 80)) + 13
    heights_mm = [48.0, snapshots_mm, 84.0 if layout.with_inset else 66.0]
    figure = style.new_figure(1.0, sum(heights_mm))
    parts = figure.subfigures(3, 1, height_ratios=heights_mm, squeeze=False)
    top, middle, bottom = np.asarray(parts)[:, 0]
    curve = top.add_subplot()
    panels.draw_curve(curve, run, layout.curve, layout.twin, chosen)
    curve.set_title("(a)", loc="left", fontweight="bold", fontsize=9)
    _draw_snapshots(middle, run, layout, profiles, cameras, limits)
    _draw_panels(bottom, run, layout, profiles)
    middle.suptitle("(b)", x=0.004, ha="left", fontweight="bold", fontsize=9)
    panels.number_dots(curve, run, layout.curve, chosen)
    return figure


def _draw_panels(part: SubFigure, run: Run, layout: Layout, profiles: Sequence[Profile]) -> None:
    """Velocities over curvatures, one column per snapshot."""
    widths = [1.0] * (len(profiles) - 1) + [1.25 if layout.with_inset else 1.0]
    heights = [1.0, 1.6 if layout.with_inset else 1.0]
    grid = part.add_gridspec(2, len(profiles), height_ratios=heights, width_ratios=widths)
    rows = [[part.add_subplot(grid[row, k]) for k in range(len(profiles))] for row in (0, 1)]
    panels.draw_profiles(rows[0], run, profiles, panels.VELOCITIES, "velocity")
    panels.draw_profiles(rows[1], run, profiles, panels.CURVATURES, "curvature")
    for row in rows:
        row[0].legend(loc="best", borderpad=0.1, labelspacing=0.2, handletextpad=0.4, borderaxespad=0.2)
    for axes in rows[0]:
        axes.tick_params(labelbottom=False)
    for axes in rows[1]:
        axes.set_xlabel(style.symbol_of(run.dataset["mesh_coordinate"]))
    if layout.with_inset:
        panels.draw_neck_inset(rows[1][-1], profiles[-1])


def common_limits(profiles: Sequence[Profile], cameras: Sequence[Camera], *, with_swim: bool) -> Limits:
    """(left, right, bottom, top) that hold every snapshot with its arrows, and a strip below for the keys."""
    pairs = zip(profiles, cameras, strict=True)
    extents = np.array([extent(p, camera, offset_of(camera, p), with_swim=with_swim) for p, camera in pairs])
    size = cameras[0].size
    strip = (0.42 if _is_one(cameras) else 0.68) * size
    if with_swim and cameras[0].swim_scale > 0:  # for the numbers beyond the tips of the arrows
        extents[:, 2:] += np.array([-0.25, 0.25]) * size
    half = float(np.abs(extents[:, :2]).max())
    return -half, half, float(extents[:, 2].min()) - strip, float(extents[:, 3].max())


def prepare_snapshot_axes(axes: Axes, limits: Limits) -> None:
    """Equal scales, the common limits, no frame."""
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(limits[0], limits[1])
    axes.set_ylim(limits[2], limits[3])
    axes.set_axis_off()


def _draw_snapshots(
    part: SubFigure,
    run: Run,
    layout: Layout,
    profiles: Sequence[Profile],
    cameras: Sequence[Camera],
    limits: Limits,
) -> None:
    """The row of snapshots with their times, keys and colour bar."""
    time = run.dataset["time"]
    columns = len(profiles)
    grid = part.add_gridspec(1, columns + 1, width_ratios=[1.0] * columns + [0.07])
    row = [part.add_subplot(grid[0, k]) for k in range(columns)]
    stamps = style.time_stamps([p.time for p in profiles], style.symbol_of(time), style.units_of(time))
    one_scale = _is_one(cameras)
    for number, (axes, profile, camera, stamp) in enumerate(zip(row, profiles, cameras, stamps, strict=True), start=1):
        SnapshotArtists(axes, camera, with_swim=layout.with_swim).show(profile, offset_of(camera, profile))
        prepare_snapshot_axes(axes, limits)
        axes.set_title(f"$\\bf{{{number}}}$   {stamp}", pad=3)
        if layout.with_swim:
            label_speed(axes, run, camera, profile)
        if (one_scale and number == 1) or (not one_scale and _flows(profile, camera)):
            draw_arrow_key(axes, run, camera, limits, line=0 if one_scale else 1)
    camera = cameras[0]
    draw_length_key(row[1] if one_scale else row[0], run, camera, limits)
    if columns > 2 and one_scale:
        row[2].text(0, limits[2] + 0.16 * camera.size, "same scale in all", va="center", ha="center")
    if run.is_open:
        draw_coat_key(row[-1], camera, limits)
    elif run.regulator:
        draw_colour_bar(part, part.add_subplot(grid[0, -1]), run, camera)


def _is_one(cameras: Sequence[Camera]) -> bool:
    """Whether all have the same scale of arrows."""
    return len({camera.arrow_scale for camera in cameras}) == 1


def _flows(profile: Profile, camera: Camera) -> bool:
    """Whether any arrow is long enough to be drawn."""
    return fastest_flow(profile, camera.is_open) * camera.arrow_scale >= camera.shortest_arrow


def draw_coat_key(axes: Axes, camera: Camera, limits: Limits, *, on_top: bool = False) -> None:
    """What yellow means on an open membrane, in the line of the other keys or in the upper corner."""
    size = camera.size
    x, y = limits[1] - 0.62 * size, limits[3] - 0.2 * size if on_top else limits[2] + 0.09 * size
    axes.add_patch(
        Rectangle((x, y), 0.14 * size, 0.14 * size, facecolor=style.COAT, edgecolor=style.INK, linewidth=0.5)
    )
    axes.text(x + 0.2 * size, y + 0.07 * size, "coat", va="center", ha="left")


def draw_colour_bar(part: Figure | SubFigure, axes: Axes, run: Run, camera: Camera) -> Colorbar:
    """The scale of the regulator; an arrow on top says that a small region exceeds it."""
    bar = part.colorbar(camera.colours, cax=axes, extend="max" if camera.colours_exceed else "neither")
    if run.regulator:
        bar.set_label(style.axis_label(run.dataset[run.regulator]))
    bar.outline.set_linewidth(0.6)
    return bar


def label_speed(axes: Axes, run: Run, camera: Camera, profile: Profile) -> None:
    """The swimming speed in green beyond the tip of its arrow; nothing where the arrow is too short to be drawn."""
    if abs(profile.swim) * camera.swim_scale < camera.shortest_swim:
        return
    tail, vector = swim_arrow(profile, camera, offset_of(camera, profile))
    x, y = (tail + vector)[0]
    text = f"{style.number(abs(profile.swim), 2)} {style.units_of(run.dataset['velocity'])}"
    side, va = (-1, "top") if profile.swim < 0 else (1, "bottom")
    axes.text(x, y + 0.08 * side * camera.size, text, color=style.GREEN, va=va, ha="center")


def draw_arrow_key(axes: Axes, run: Run, camera: Camera, limits: Limits, line: int = 0) -> None:
    """A reference arrow for the flow, in a line of the keys counted from below."""
    if camera.arrow_scale == 0:
        return
    speed = round_down(camera.longest_arrow / camera.arrow_scale)
    y = limits[2] + (0.16 + 0.26 * line) * camera.size
    x = limits[0] + 0.06 * camera.size
    length = speed * camera.arrow_scale
    camera.quiver(axes, np.array([[x], [y], [length], [0.0]]), style.RED)
    text = f"{style.number(speed)} {style.units_of(run.dataset['tangential_velocity'])}"
    axes.text(x + length + 0.08 * camera.size, y, text, va="center", ha="left", color=style.RED)


def draw_length_key(axes: Axes, run: Run, camera: Camera, limits: Limits, at: float = 0.1) -> None:
    """A length bar below a snapshot, from `at` of its width on; all snapshots share its scale."""
    length = round_down(0.7 * camera.size)
    y = limits[2] + 0.16 * camera.size
    x = limits[0] + at * (limits[1] - limits[0])
    axes.add_line(Line2D([x, x + length], [y, y], color=style.INK, linewidth=1.6, solid_capstyle="butt"))
    text = f"{style.number(length)} {style.units_of(run.dataset['radius'])}"
    axes.text(x + length + 0.08 * camera.size, y, text, va="center", ha="left")


def round_down(value: float) -> float:
    """The largest of 1, 2, 3, 5 times a power of ten that is not above `value` > 0."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(m for m in (5, 3, 2, 1) if m * power <= value * (1 + 1e-9)) * power)
