"""The movie of a run: the moving surface beside its curve over time."""

import io
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray

from shapespace.base.errors import InputError, StoreError
from shapespace.study.tables import VARIED
from shapespace.view import panels, style
from shapespace.view.figure import (
    Layout,
    Limits,
    common_limits,
    draw_arrow_key,
    draw_coat_key,
    draw_colour_bar,
    draw_length_key,
    layout_of,
    prepare_snapshot_axes,
    round_down,
)
from shapespace.view.frames import Array, frame_positions, observable, progress_measure, read_run
from shapespace.view.snapshot import Camera, SnapshotArtists, arrow_flows, make_camera, offset_of

INCHES = (8.0, 4.5)
MP4_DPI = 128  # 1024 x 576 pixels; H.264 wants even numbers
GIF_DPI = 80  # a gif is held in memory as a whole
_TYPE_SCALE = 1.35  # beside the type of a printed figure
_SURFACE_BOX = (0.01, 0.02, 0.46, 0.96)  # left, bottom, width, height on the page
_CLOCKS_LEFT = 0.665
_CODECS = {  # by preference: which are built in differs between installations
    "libx264": ["-crf", "18", "-preset", "veryfast"],
    "libopenh264": ["-b:v", "6M"],
    "mpeg4": ["-q:v", "3"],
}


def save_movie(
    dataset: xr.Dataset,
    path: str | os.PathLike[str],
    progress: Callable[[int, int], None] | None = None,
    seconds: float = 8.0,
    fps: int = 25,
) -> Path:
    """Write the movie of a stored run and return where it is.

    `path` ends in .mp4 or .gif. Where no ffmpeg is found (on the PATH, or from imageio-ffmpeg) an .mp4 becomes a .gif
    beside it: use the returned path. Frames are equally spaced in a mix of shape change and time; `progress(done,
    total)` is called after each. The file appears only when it is complete. Raises InputError for a dataset or path
    that cannot be used, StoreError where the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".mp4", ".gif"):
        raise InputError(f"path = '{target}' must end in .mp4 or .gif.")
    if not (np.isfinite(seconds) and fps >= 1 and round(seconds * fps) > 1):
        raise InputError(f"seconds = {seconds}, fps = {fps} make no movie; at least 2 frames are needed.")
    ffmpeg = find_ffmpeg() if target.suffix.lower() == ".mp4" else None
    if ffmpeg is None:
        target = target.with_suffix(".gif")
    with style.house_style(_TYPE_SCALE):
        dpi = GIF_DPI if ffmpeg is None else MP4_DPI
        scene = Scene(dataset, round(seconds * fps), dpi)
        with _writing(scene.figure, target, ffmpeg, fps) as writer:
            for k in range(scene.frames):
                scene.show(k)
                writer.grab_frame()
                if progress is not None:
                    progress(k + 1, scene.frames)
    return target


def find_ffmpeg() -> str | None:
    """The system's ffmpeg, else the one that comes with imageio-ffmpeg, else None."""
    system = shutil.which("ffmpeg")
    if system:
        return system
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())  # an extra, not a dependency
    except (ImportError, RuntimeError):  # RuntimeError: installed without a binary for this platform
        return None


@cache
def best_codec(ffmpeg: str) -> str:
    """The first codec of our list that this ffmpeg can write."""
    listing = subprocess.run([ffmpeg, "-hide_banner", "-encoders"], capture_output=True, text=True, check=False).stdout
    return next((codec for codec in _CODECS if f" {codec} " in listing), "mpeg4")


@contextmanager
def _writing(figure: Figure, target: Path, ffmpeg: str | None, fps: int) -> Iterator[AbstractMovieWriter]:
    """A writer into a temporary file beside `target`, moved there at the end and removed on failure."""
    part = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    if not target.parent.is_dir() or not os.access(target.parent, os.W_OK):
        raise StoreError(
            f"cannot write '{target}': '{target.parent}' is not a writable directory; choose another path."
        )
    settings: dict[Any, Any] = {"animation.ffmpeg_path": ffmpeg or "ffmpeg", "savefig.bbox": None}
    writer: AbstractMovieWriter
    if ffmpeg is None:
        writer = PillowWriter(fps=fps)
    else:
        codec = best_codec(ffmpeg)
        arguments = [*_CODECS[codec], "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
        writer = FFMpegWriter(fps=fps, codec=codec, extra_args=arguments)
    try:
        with mpl.rc_context(settings), writer.saving(figure, str(part), figure.dpi):
            yield writer
        part.replace(target)
    except (OSError, subprocess.CalledProcessError) as error:
        raise StoreError(
            f"cannot write '{target}': {_last_line(error)}; free some space or choose another path."
        ) from error
    finally:
        part.unlink(missing_ok=True)


def _last_line(error: OSError | subprocess.CalledProcessError) -> str:
    """What went wrong, in one line."""
    text = getattr(error, "stderr", None) or str(error)
    lines = (text.decode(errors="replace") if isinstance(text, bytes) else str(text)).strip().splitlines()
    return lines[-1] if lines else type(error).__name__


class Scene:
    """The figure of the movie; `show(k)` moves its few artists to frame k of `frames`.

    All that stands still is drawn once, on a figure of its own whose pixels then are the backdrop: five times faster.
    """

    def __init__(self, dataset: xr.Dataset, frames: int, dpi: int) -> None:
        layout = layout_of(dataset)
        self.frames = frames
        self._run = read_run(dataset, layout.observables)
        curve = observable(dataset, layout.curve)
        positions = frame_positions(progress_measure(self._run, curve), frames)
        self._profiles = [self._run.profile(float(p)) for p in positions]
        self._colour = panels.colour_of(layout.curve)
        self._early = panels.early_time(self._run, curve)
        self._values = np.interp(positions, np.arange(curve.size), curve)
        # Where arclength takes the place of time, the key is shown as well.
        varied = str(dataset.attrs.get(VARIED, ""))
        self._varied = varied if varied and varied != dataset["time"].attrs.get("words") else None
        if self._varied is not None:
            self._keys = np.interp(positions, np.arange(curve.size), observable(dataset, self._varied))
        self._camera = make_camera(self._run, self._profiles, arrow_width=1.6 / 72)
        self._swims = layout.with_swim and self._camera.swim_scale > 0
        self._flows = _smoothed(arrow_flows(self._profiles, self._camera, rest=1e-3, ignored=0.3))
        cameras = [self._camera.for_flow(f) if f > 0 else self._camera for f in self._flows]
        left, right, bottom, top = common_limits(self._profiles, cameras, with_swim=self._swims)
        ruler = 0.45 * self._camera.size if self._swims else 0.0
        coat_key = 0.3 * self._camera.size if self._run.is_open else 0.0
        self._limits = (left - ruler, right + ruler, bottom, top + coat_key)
        self.figure = Figure(figsize=INCHES, dpi=dpi)
        FigureCanvasAgg(self.figure)
        self._build_moving(self._draw_still(layout, dpi))

    def _draw_still(self, layout: Layout, dpi: int) -> Axes:
        """Draw what does not move, make it the backdrop, and return the axes of the curve."""
        still = Figure(figsize=INCHES, dpi=dpi)
        run, camera = self._run, self._camera
        surface = still.add_axes(_SURFACE_BOX)
        prepare_snapshot_axes(surface, self._limits)
        self._flow_key = self._draw_flow_key(surface)
        draw_length_key(surface, run, camera, self._limits, at=0.62)
        if run.is_open:
            draw_coat_key(surface, camera, self._limits, on_top=True)
        elif run.regulator:
            draw_colour_bar(still, still.add_axes((0.485, 0.16, 0.013, 0.68)), run, camera)
        curve = still.add_axes((_CLOCKS_LEFT, 0.15, 0.235 if layout.twin else 0.305, 0.54))
        panels.draw_curve(curve, run, layout.curve, layout.twin, [])
        self._clocks = [Clock(still, self.figure, run.dataset["time"], 0.9, 17, style.INK, self._early)]
        if self._varied is not None:
            self._clocks.append(Clock(still, self.figure, run.dataset[self._varied], 0.82, 13, style.INK))
        if self._swims:
            y = 0.82 if self._varied is None else 0.75
            self._clocks.append(Clock(still, self.figure, run.dataset["velocity"], y, 13, style.GREEN))
        self.figure.add_artist(Backdrop(_pixels(still)))
        return curve

    def _draw_flow_key(self, surface: Axes) -> Text | None:
        """A reference arrow; where its speed changes in the course of the movie, the text that will say it."""
        if np.ptp(self._flows) == 0:
            draw_arrow_key(surface, self._run, self._camera, self._limits)
            return None
        size = self._camera.size
        x, y = self._limits[0] + 0.06 * size, self._limits[2] + 0.16 * size
        self._camera.quiver(surface, np.array([[x], [y], [self._camera.longest_arrow], [0.0]]), style.RED)
        return Text(x + self._camera.longest_arrow + 0.08 * size, y, "", va="center", ha="left", color=style.RED)

    def _build_moving(self, curve: Axes) -> None:
        """The artists that move, on bare axes in the same places."""
        surface = self.figure.add_axes(_SURFACE_BOX)
        prepare_snapshot_axes(surface, self._limits)
        units = style.units_of(self._run.dataset["radius"])
        self._ruler = Ruler(surface, self._camera, self._limits, units) if self._swims else None
        self._artists = SnapshotArtists(surface, self._camera, with_swim=self._swims)
        if self._flow_key is not None:
            surface.add_artist(self._flow_key)
        over = self.figure.add_axes(curve.get_position().bounds)
        over.set_axis_off()
        points = np.stack([[p.time for p in self._profiles], self._values], -1)
        self._dots = curve.transAxes.inverted().transform(curve.transData.transform(points))
        (self._dot,) = over.plot([], [], "o", color=self._colour, markersize=9, markeredgecolor="white", clip_on=False)
        over.set(xlim=(0, 1), ylim=(0, 1))

    def show(self, k: int) -> None:
        """Move every artist to frame k."""
        profile = self._profiles[k]
        self._artists.show(profile, offset_of(self._camera, profile), float(self._flows[k]))
        self._dot.set_data(*self._dots[k : k + 1].T)
        values = [profile.time, *([] if self._varied is None else [float(self._keys[k])]), profile.swim]
        for clock, value in zip(self._clocks, values, strict=False):
            clock.show(value)
        if self._ruler is not None:
            self._ruler.show(profile.centre)
        if self._flow_key is not None:
            units = style.units_of(self._run.dataset["tangential_velocity"])
            self._flow_key.set_text(f"{style.number(float(self._flows[k]), 2)} {units}")


def _smoothed(flows: Array) -> Array:
    """A running maximum, averaged over the same window: nowhere below `flows`, and without jumps."""
    half = 5
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(flows, 2 * half, mode="edge"), 2 * half + 1)
    windows = np.lib.stride_tricks.sliding_window_view(windows.max(axis=-1), 2 * half + 1)
    return np.asarray(windows.mean(axis=-1), dtype=np.float64)


def _pixels(figure: Figure) -> NDArray[np.uint8]:
    """A picture of a figure, (height, width, 4)."""
    picture = io.BytesIO()
    with mpl.rc_context({"savefig.bbox": None}):
        figure.savefig(picture, format="rgba", dpi=figure.dpi)
    width, height = figure.canvas.get_width_height()
    return np.frombuffer(picture.getvalue(), np.uint8).reshape(height, width, 4)


class Backdrop(Artist):
    """Pixels (height, width, 4) laid under everything else on a figure of exactly that size."""

    def __init__(self, pixels: NDArray[np.uint8]) -> None:
        super().__init__()
        self._pixels = pixels[::-1]
        self.set_zorder(-10)

    def draw(self, renderer: RendererBase) -> None:
        """Copy the pixels to the page."""
        gc = renderer.new_gc()
        renderer.draw_image(gc, 0, 0, self._pixels)
        gc.restore()


class Clock:
    """`symbol = value units` at height `y` of the page: symbol and units stand on the still figure, digits move."""

    def __init__(
        self,
        still: Figure,
        moving: Figure,
        variable: xr.DataArray,
        y: float,
        size: float,
        colour: str,
        least: float = 0.0,
    ) -> None:
        values = np.asarray(variable.values, dtype=np.float64)
        span = least or 0.01 * float(np.abs(values).max()) or 1.0  # what two or more digits should show
        self._decimals = max(0, -int(np.floor(np.log10(span))))
        shared: dict[str, Any] = {"fontsize": size, "color": colour, "va": "baseline"}
        self.symbol = f"{style.symbol_of(variable)} = "
        left = still.text(_CLOCKS_LEFT, y, self.symbol, ha="left", **shared)
        widest = max((style.fixed(float(v), self._decimals) for v in (values.min(), values.max())), key=len)
        probe = still.text(0, 0, widest, **shared)
        page = float(still.bbox.width)
        gap = 0.3 * size * still.dpi / 72
        end = (left.get_window_extent().x1 + gap + probe.get_window_extent().width) / page
        probe.remove()
        still.text(end + gap / page, y, style.units_of(variable), ha="left", **shared)
        self._digits = moving.text(end, y, "", ha="right", **shared)

    def show(self, value: float) -> None:
        """Set the digits."""
        self._digits.set_text(style.fixed(value, self._decimals))


class Ruler:
    """Faint lines at round heights of the lab frame, which pass by a surface that the camera follows."""

    def __init__(self, axes: Axes, camera: Camera, limits: Limits, units: str) -> None:
        self._limits, self._units = limits, units
        self._cos = float(np.cos(camera.elevation))
        self._step = round_down(camera.size)
        self._lines = LineCollection([], colors=style.FAINT, linewidths=0.7, zorder=0)
        axes.add_collection(self._lines, autolim=False)
        count = int((limits[3] - limits[2]) / (self._step * self._cos)) + 2
        self._labels = [axes.text(limits[0], 0, "", fontsize=9, color="#70757C", va="bottom") for _ in range(count)]

    def show(self, centre: float) -> None:
        """Place lines and labels for a camera at height `centre`."""
        left, right, bottom, top = self._limits
        # The strip at the bottom belongs to the keys.
        low, high = bottom + 0.12 * (top - bottom), top - 0.05 * (top - bottom)
        first, last = (int(np.ceil((y / self._cos + centre) / self._step)) for y in (low, high))
        heights = {n: (n * self._step - centre) * self._cos for n in range(first, last)}
        self._lines.set_segments([[(left, y), (right, y)] for y in heights.values()])
        for label in self._labels:
            label.set_text("")
        for label, (n, y) in zip(self._labels, heights.items(), strict=False):
            label.set_y(y)
            label.set_text(f"$z$ = {style.number(n * self._step)} {self._units}")
