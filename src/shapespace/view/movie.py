"""The movie of a run: the moving surface beside its curve over time."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

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
from numpy.typing import NDArray

from shapespace.base.errors import InputError, StoreError
from shapespace.view import panels, style
from shapespace.view.figure import (
    Layout,
    common_limits,
    draw_arrow_key,
    draw_coat_key,
    draw_colour_bar,
    draw_length_key,
    layout_of,
    prepare_snapshot_axes,
    round_down,
)
from shapespace.view.frames import frame_positions, observable, progress_measure, read_run
from shapespace.view.snapshot import Camera, SnapshotArtists, make_camera, offset_of

INCHES = (8.0, 4.5)
MP4_DPI = 160  # 1280 x 720 pixels; H.264 wants even numbers
GIF_DPI = 80  # a gif is held in memory as a whole
_SURFACE_BOX = (0.01, 0.02, 0.46, 0.96)  # left, bottom, width, height on the page
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

    `path` ends in .mp4 or .gif. Where no ffmpeg is found (on the PATH, or from imageio-ffmpeg) an .mp4 becomes a .gif beside it: use
    the returned path. Frames are equally spaced in a mix of shape change and time. `progress(done, total)` is called per frame.
    The file appears only when it is complete. Raises InputError for a dataset or path that cannot be used, StoreError where
    the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".mp4", ".gif"):
        raise InputError(f"path = '{target}' must end in .mp4 or .gif.")
    if not (np.isfinite(seconds) and seconds > 0 and fps >= 1 and round(seconds * fps) >= 2):
        raise InputError(f"seconds = {seconds}, fps = {fps} make no movie; at least 2 frames are needed.")
    ffmpeg = find_ffmpeg() if target.suffix.lower() == ".mp4" else None
    if ffmpeg is None:
        target = target.with_suffix(".gif")
    with style.house_style():
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
        import imageio_ffmpeg  # an extra, not a dependency  # noqa: PLC0415

        return str(imageio_ffmpeg.get_ffmpeg_exe())
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
        raise StoreError(f"cannot write '{target}': '{target.parent}' is not a writable directory; choose another path.")
    writer: AbstractMovieWriter
    if ffmpeg is None:
        writer = PillowWriter(fps=fps)
    else:
        codec = best_codec(ffmpeg)
        arguments = [*_CODECS[codec], "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
        writer = FFMpegWriter(fps=fps, codec=codec, extra_args=arguments)
    try:
        with mpl.rc_context({"animation.ffmpeg_path": ffmpeg or "ffmpeg", "savefig.bbox": None}):
            with writer.saving(figure, str(part), figure.dpi):
                yield writer
        os.replace(part, target)
    except (OSError, subprocess.CalledProcessError) as error:
        raise StoreError(f"cannot write '{target}': {_last_line(error)}; free some space or choose another path.") from error
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
        self._values = np.interp(positions, np.arange(curve.size), curve)
        self._camera = make_camera(self._run, self._profiles, arrow_width=1.6 / 72)
        self._swims = layout.with_swim and self._camera.swim_scale > 0
        self._limits = common_limits(self._profiles, self._camera, with_swim=self._swims)
        self.figure = Figure(figsize=INCHES, dpi=dpi)
        FigureCanvasAgg(self.figure)
        self._build_moving(self._draw_still(layout, dpi))

    def _draw_still(self, layout: Layout, dpi: int) -> Axes:
        """Draw what does not move, make it the backdrop, and return the axes of the curve."""
        still = Figure(figsize=INCHES, dpi=dpi)
        canvas = FigureCanvasAgg(still)
        run, camera = self._run, self._camera
        surface = still.add_axes(_SURFACE_BOX)
        prepare_snapshot_axes(surface, self._limits)
        draw_arrow_key(surface, run, camera, self._limits)
        draw_length_key(surface, run, camera, self._limits)
        if run.is_open:
            draw_coat_key(surface)
        elif run.regulator:
            draw_colour_bar(still, still.add_axes((0.485, 0.16, 0.014, 0.68)), run, camera)
        curve = still.add_axes((0.655, 0.15, 0.255 if layout.twin else 0.315, 0.56))
        panels.draw_curve(curve, run, layout.curve, layout.twin, [])
        self._clocks = [Clock(still, self.figure, run.dataset["time"], 0.89, 16, style.INK)]
        if self._swims:
            self._clocks.append(Clock(still, self.figure, run.dataset["velocity"], 0.80, 11, style.GREEN))
        canvas.draw()
        self.figure.add_artist(Backdrop(np.array(canvas.buffer_rgba())))
        return curve

    def _build_moving(self, curve: Axes) -> None:
        """The artists that move, on bare axes in the same places."""
        surface = self.figure.add_axes(_SURFACE_BOX)
        prepare_snapshot_axes(surface, self._limits)
        units = style.units_of(self._run.dataset["radius"])
        self._ruler = Ruler(surface, self._camera, self._limits, units) if self._swims else None
        self._artists = SnapshotArtists(surface, self._camera, with_swim=self._swims)
        over = self.figure.add_axes(curve.get_position(), xlim=curve.get_xlim(), ylim=curve.get_ylim())
        over.set_axis_off()
        (self._dot,) = over.plot([], [], "o", color=style.BLUE, markersize=9, markeredgecolor="white", zorder=6)

    def show(self, k: int) -> None:
        """Move every artist to frame k."""
        profile = self._profiles[k]
        self._artists.show(profile, offset_of(self._camera, profile))
        self._dot.set_data([profile.time], [self._values[k]])
        for clock, value in zip(self._clocks, (profile.time, profile.swim), strict=False):
            clock.show(value)
        if self._ruler is not None:
            self._ruler.show(profile.centre)


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
    """`symbol = value units`: symbol and units stand on the still figure, the digits move."""

    def __init__(self, still: Figure, moving: Figure, variable: xr.DataArray, y: float, size: float, colour: str) -> None:
        shared = {"fontsize": size, "color": colour, "va": "baseline"}
        end = 0.655 + 0.0095 * size
        still.text(0.655, y, f"{style.symbol_of(variable)} =", ha="left", **shared)
        still.text(end + 0.0006 * size, y, style.units_of(variable), ha="left", **shared)
        self._digits = moving.text(end, y, "", ha="right", **shared)
        span = float(np.abs(variable.values).max()) or 1.0
        self._decimals = max(0, 2 - int(np.floor(np.log10(span))))

    def show(self, value: float) -> None:
        """Set the digits."""
        self._digits.set_text(style.fixed(value, self._decimals))


class Ruler:
    """Faint lines at round heights of the lab frame, which pass by a surface that the camera follows."""

    def __init__(self, axes: Axes, camera: Camera, limits: tuple[float, float, float, float], units: str) -> None:
        self._limits, self._units = limits, units
        self._cos = float(np.cos(camera.elevation))
        self._step = round_down(camera.size)
        self._lines = LineCollection([], colors=style.FAINT, linewidths=0.7, zorder=0)
        axes.add_collection(self._lines, autolim=False)
        count = int((limits[3] - limits[2]) / (self._step * self._cos)) + 2
        self._labels = [axes.text(limits[0], 0, "", fontsize=8, color="#70757C", va="bottom") for _ in range(count)]

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
