"""Movies of made-up runs: their frames, their files, and what is refused."""

from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from matplotlib.quiver import Quiver
from PIL import Image
from tests.view.synthetic import dataset_of, dying_flow, membrane_protrusion

from shapespace.base.errors import InputError, StoreError
from shapespace.view import movie, style
from shapespace.view.movie import save_movie


def test_movie_arrow_scale_follows_a_dying_flow() -> None:
    with style.house_style():
        scene = movie.Scene(dying_flow(), 12, 64)
        scene.show(3)
        early = scene._flow_key.get_text()
        scene.show(11)
        assert scene._flow_key.get_text() != early
        assert movie.Scene(dataset_of("polar-swimmer"), 4, 64)._flow_key is None


def test_smoothed_flow_is_nowhere_exceeded() -> None:
    flows = np.random.default_rng(1).uniform(0.1, 1, 60)
    smooth = movie._smoothed(flows)
    assert smooth.shape == flows.shape
    assert np.all(smooth >= flows)
    np.testing.assert_array_equal(movie._smoothed(np.ones(3)), np.ones(3))


@pytest.mark.parametrize("scenario", ["membrane-protrusion", "polar-swimmer"])
def test_movie_has_the_frames_asked_for(scenario: str, tmp_path: Path) -> None:
    calls: list[tuple[int, int]] = []
    path = save_movie(
        dataset_of(scenario), tmp_path / "run.mp4", lambda done, total: calls.append((done, total)), 0.4, 15
    )
    assert path == tmp_path / "run.mp4"
    assert list(tmp_path.iterdir()) == [path]
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert frames == 6
    assert seconds == pytest.approx(0.4, abs=0.05)
    assert calls == [(k, 6) for k in range(1, 7)]


def test_movie_becomes_a_gif_without_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(movie, "find_ffmpeg", lambda: None)
    path = save_movie(dataset_of("guided-division"), str(tmp_path / "run.mp4"), seconds=0.5, fps=10)
    assert path == tmp_path / "run.gif"
    assert list(tmp_path.iterdir()) == [path]
    with Image.open(path) as image:
        assert image.n_frames == 5
        assert image.size == (640, 360)


def test_system_ffmpeg_comes_first_and_a_missing_one_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(movie.shutil, "which", lambda name: f"/somewhere/{name}")
    assert movie.find_ffmpeg() == "/somewhere/ffmpeg"
    monkeypatch.setattr(movie.shutil, "which", lambda name: None)
    assert movie.find_ffmpeg() == imageio_ffmpeg.get_ffmpeg_exe()

    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(movie, "import_module", missing)
    assert movie.find_ffmpeg() is None


def test_an_interrupted_movie_leaves_nothing_and_keeps_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "run.mp4"
    path.write_bytes(b"old")

    def interrupt(*_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save_movie(dataset_of("guided-division"), path, interrupt, seconds=0.2)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"old"


def test_movie_paths_that_cannot_be_used_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = dataset_of("guided-division")
    with pytest.raises(InputError, match=r"must end in \.mp4 or \.gif"):
        save_movie(dataset, tmp_path / "run.avi")
    with pytest.raises(InputError, match="at least 2 frames"):
        save_movie(dataset, tmp_path / "run.mp4", seconds=0.0)
    with pytest.raises(StoreError, match="not a writable directory"):
        save_movie(dataset, tmp_path / "nowhere" / "run.mp4", seconds=0.1)
    monkeypatch.setattr(movie, "find_ffmpeg", lambda: "/bin/false")
    with pytest.raises(StoreError, match="cannot write") as caught:
        save_movie(dataset, tmp_path / "run.mp4", seconds=0.1)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_movie_artists_stay_inside_the_picture() -> None:
    with style.house_style():
        scene = movie.Scene(membrane_protrusion(frames=8), 8, 64)
        for k in range(8):
            scene.show(k)
            scene.figure.canvas.draw()
            pairs = [(axes, artist) for axes in scene.figure.axes for artist in axes.collections]
            for axes, quiver in [(axes, artist) for axes, artist in pairs if isinstance(artist, Quiver)]:
                shown = ~np.broadcast_to(quiver.Umask, quiver.U.shape)
                tips = (quiver.XY + np.stack([quiver.U, quiver.V], -1))[shown]
                (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
                assert np.all((tips >= [left, bottom]) & (tips <= [right, top]))
