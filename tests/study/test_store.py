"""The store: what was written is read back bit for bit, or a one-line error names the file and the remedy."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.study.fakes import make_frame

from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.study import files
from shapespace.study.frame import DAMAGE, Frame, decode_frame, encode_frame
from shapespace.study.manifests import FORMAT_VERSION
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.store import RunStore

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = scenario("guided-division", until=1.0)


def assert_same(one: Frame, other: Frame) -> None:
    assert (one.time, one.step, one.next_step, one.observables) == (
        other.time,
        other.step,
        other.next_step,
        other.observables,
    )
    for name in ("mesh", "nodes", "slopes", "algebraic", "scalars", "rates"):
        assert getattr(other, name).dtype == np.float64
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def fill(path: Path, count: int = 5, outcome: Outcome | None = None) -> Path:
    with RunStore.create(path, SCENARIO) as store:
        for number in range(count):
            store.append(make_frame(number))
        if outcome is not None:
            store.finish(outcome)
    return path


def complaint(action: object, *arguments: object) -> str:
    with pytest.raises(StoreError) as caught:
        action(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def frame_file(path: Path, number: int) -> Path:
    return path / "frames" / f"{number:06d}.npz"


def contents(path: Path) -> dict[str, bytes]:
    return {str(file.relative_to(path)): file.read_bytes() for file in path.rglob("*") if file.is_file()}


def test_frames_come_back_bit_for_bit(tmp_path: Path):
    store = RunStore.open(fill(tmp_path / "a" / "run", outcome=Outcome.STATIONARY))
    assert len(store) == 5
    for number, frame in enumerate(store):
        assert_same(frame, make_frame(number))
    assert_same(store.read(-1), make_frame(4))
    assert [frame.time for frame in store.last(3)] == [make_frame(n).time for n in (2, 3, 4)]
    assert len(store.last(99)) == 5
    assert store.outcome is Outcome.STATIONARY
    assert store.scenario == SCENARIO
    with pytest.raises(IndexError, match="has 5 frames"):
        store.read(5)


def test_manifest_describes_itself(tmp_path: Path):
    fill(tmp_path / "run", outcome=Outcome.REACHED_END)
    manifest = json.loads((tmp_path / "run" / "store.json").read_text())
    assert (manifest["format"], manifest["format_version"]) == ("shapespace-run", FORMAT_VERSION)
    assert (manifest["status"], manifest["outcome"], manifest["frames"]) == ("finished", "reached-end", 5)
    assert {"shapespace", "python", "jax", "numpy"} <= manifest["versions"].keys()
    assert manifest["units"]["velocity"] == "R0/tau"
    assert manifest["scenario"]["parameters"]["peclet"] == 450
    assert Scenario.from_dict(manifest["scenario"]) == SCENARIO


def test_a_thousand_frames_stay_below_50_megabytes():
    frame = make_frame(7)
    frame.observables.update({f"some_observable_name_{n}": float(n) for n in range(20)})
    blocks = -(-len(encode_frame(frame)) // 4096) * 4096
    assert 1000 * blocks < 50e6


@pytest.mark.parametrize("prepare", ["absent", "empty", "killed while created"])
def test_a_new_store_takes_a_free_directory(tmp_path: Path, prepare: str):
    path = tmp_path / "run"
    if prepare != "absent":
        path.mkdir()
    if prepare == "killed while created":
        (path / "frames").mkdir()
        (path / "lock").touch()
        (path / "store.json.tmp").write_text('{"for')
    fill(path)
    assert len(RunStore.open(path)) == 5


def test_a_new_store_takes_no_other_directory(tmp_path: Path):
    run = fill(tmp_path / "run")
    (foreign := tmp_path / "foreign").mkdir()
    (foreign / "thesis.tex").write_text("precious")
    (file := tmp_path / "file").write_text("precious")
    (link := tmp_path / "link").symlink_to(tmp_path / "nowhere")
    before = contents(tmp_path)
    assert "holds a run already" in complaint(RunStore.create, run, SCENARIO)
    assert "holds other files (thesis.tex)" in complaint(RunStore.create, foreign, SCENARIO)
    assert "is not a directory" in complaint(RunStore.create, file, SCENARIO)
    assert "is not a directory" in complaint(RunStore.create, link, SCENARIO)
    assert "cannot be read or written" in complaint(RunStore.create, file / "below", SCENARIO)
    assert "cannot be read or written" in complaint(RunStore.create, tmp_path / ("n" * 300), SCENARIO)
    assert "is no path" in complaint(RunStore.create, tmp_path / "a\0b", SCENARIO)
    assert contents(tmp_path) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_read_only_directory_stays_untouched(tmp_path: Path):
    tmp_path.chmod(0o500)
    assert "permission is missing" in complaint(RunStore.create, tmp_path / "run", SCENARIO)
    tmp_path.chmod(0o700)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("failing", ["mkdir", "lock", "write"])
@pytest.mark.parametrize("code", [errno.EACCES, errno.EROFS, errno.ENOSPC, errno.EIO])
def test_failed_creation_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str, code: int):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(code, os.strerror(code))

    target = {"mkdir": (Path, "mkdir"), "lock": (files.fcntl, "flock"), "write": (files.os, "fsync")}[failing]
    with monkeypatch.context() as patch:
        patch.setattr(*target, refuse)
        message = complaint(RunStore.create, tmp_path / "deep" / "run", SCENARIO)
    assert os.strerror(code) in message
    assert str(tmp_path / "deep" / "run") in message
    assert not [*tmp_path.iterdir()]


def test_full_disk_keeps_the_frames_so_far(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "run"
    with RunStore.create(path, SCENARIO) as store:
        for number in range(3):
            store.append(make_frame(number))
        with monkeypatch.context() as patch:
            patch.setattr(files.os, "fsync", full)
            message = complaint(store.append, make_frame(3))
            assert "the disk is full" in message
            assert "3 frames are intact" in message
            assert "the disk is full" in complaint(store.finish, Outcome.REACHED_END)
        assert sorted(file.name for file in (path / "frames").iterdir()) == [f"{n:06d}.npz" for n in range(3)]
        store.append(make_frame(3))
    store = RunStore.open(path)
    assert [frame.time for frame in store] == [make_frame(n).time for n in range(4)]
    assert store.outcome is None


def test_resumed_store_goes_on_and_may_go_further(tmp_path: Path):
    path = fill(tmp_path / "run", outcome=Outcome.REACHED_END)
    further = SCENARIO.with_overrides({"until": 3.0, "max_steps": 77})
    with RunStore.resume(path, further) as store:
        assert (len(store), store.outcome, store.scenario) == (5, Outcome.REACHED_END, further)
        assert RunStore.open(path).scenario == SCENARIO  # nothing is written before there is something to write
        store.append(make_frame(5))
    assert RunStore.open(path).outcome is None
    with RunStore.resume(path, further) as store:
        store.append(make_frame(6))
        store.finish(Outcome.STATIONARY)
    store = RunStore.open(path)
    assert (len(store), store.outcome, store.scenario) == (7, Outcome.STATIONARY, further)
    assert [session["frames"] for session in store.manifest["resumed"]] == [5, 6]


@pytest.mark.parametrize(
    ("changes", "difference"),
    [
        ({"peclet": 300}, "peclet is 450.0, not 300.0"),
        ({"initial_background": 0.5}, "initial_background is 1.0, not 0.5"),
        ({"elements": 80}, "elements is 40, not 80"),
        ({"dt": 1e-3}, "dt is 0.0, not 0.001"),
    ],
)
def test_resume_wants_the_same_scenario(tmp_path: Path, changes: dict[str, float], difference: str):
    path = fill(tmp_path / "run")
    assert difference in complaint(RunStore.resume, path, SCENARIO.with_overrides(changes))
    assert "model is closed-surface" in complaint(RunStore.resume, path, scenario("membrane-protrusion"))


def test_leftovers_of_a_kill_are_removed_on_resume(tmp_path: Path):
    path = fill(tmp_path / "run")
    leftovers = [path / "store.json.tmp", path / "frames" / "000005.npz.tmp"]
    for leftover in leftovers:
        leftover.write_bytes(b"half")
    assert len(RunStore.open(path)) == 5
    assert leftovers[0].exists()
    RunStore.resume(path, SCENARIO).close()
    assert not any(leftover.exists() for leftover in leftovers)


@pytest.mark.parametrize("harm", ["truncate", "empty", "flip", "text"])
@pytest.mark.parametrize("number", [2, 4])
def test_damaged_frame_is_named_with_the_remedy(tmp_path: Path, harm: str, number: int):
    path = fill(tmp_path / "run", outcome=Outcome.REACHED_END)
    file = frame_file(path, number)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0x10
    file.write_bytes({"truncate": data[:1000], "empty": b"", "flip": data, "text": b"frame"}[harm])
    message = complaint(RunStore.resume, path, SCENARIO)
    assert f"{file}: is damaged" in message
    assert "delete it" in message
    if number == 4:
        assert complaint(RunStore.open, path) == message
    # The remedy works: what is deleted is computed again.
    for later in range(number, 5):
        frame_file(path, later).unlink()
    assert "is missing from a finished run" in complaint(RunStore.open, path)
    with RunStore.resume(path, SCENARIO) as store:
        assert (len(store), store.outcome) == (number, None)


@pytest.mark.parametrize("number", [0, 2, 4])
@pytest.mark.parametrize("is_missing", [False, True])
def test_a_damaged_store_may_be_looked_at_without_what_is_damaged(tmp_path: Path, number: int, is_missing: bool):
    path = fill(tmp_path / "run", outcome=Outcome.REACHED_END)
    file = frame_file(path, number)
    if is_missing:
        file.unlink()
    else:
        file.write_bytes(b"frame")
    store = RunStore.open_damaged(path)
    assert len(store) == 5
    for other in {*range(5)} - {number}:
        assert_same(store.read(other), make_frame(other))
    assert str(file) in complaint(store.read, number)
    (path / "store.json").unlink()
    assert "no store.json" in complaint(RunStore.open_damaged, path)


def test_any_changed_byte_is_found_or_harmless():
    frame = make_frame(3, elements=20)
    data = encode_frame(frame)
    random = np.random.default_rng(0)
    for position in {*range(0, 400, 3), *random.integers(0, len(data), 100), *range(len(data) - 900, len(data), 3)}:
        changed = bytearray(data)
        changed[position] ^= 1 << random.integers(8)
        try:
            found = decode_frame(bytes(changed))
        except DAMAGE:
            continue
        assert_same(found, frame)


def test_gap_swap_and_missing_folder_are_found(tmp_path: Path):
    path = fill(tmp_path / "run")
    frame_file(path, 2).rename(path / "aside")
    assert "000002.npz: is missing while later frames are there" in complaint(RunStore.open, path)
    frame_file(path, 3).rename(frame_file(path, 2))
    (path / "aside").rename(frame_file(path, 3))
    assert "000003.npz: is out of order" in complaint(RunStore.resume, path, SCENARIO)
    (path / "frames").rename(path / "elsewhere")
    assert "cannot be read" in complaint(RunStore.open, path)


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('"shapespace-run"', '"other"', "is not of a shapespace-run store"),
        (
            f'"format_version": {FORMAT_VERSION}',
            '"format_version": 1',
            "was written by another version of shapespace (format_version 1,",
        ),
        ('"frames": 5', '"frames": "many"', "is damaged (outcome or frames)"),
        ('"outcome": "reached-end"', '"outcome": "great"', "is damaged (outcome or frames)"),
        ('"status"', '"state"', "is damaged (no status)"),
        ('"given"', '"taken"', "is damaged (scenario"),
        ('"peclet": 450.0', '"peclet": -"', "is damaged"),
        ('"model": "closed-surface"', '"model": null', "is damaged (scenario"),
    ],
)
def test_other_manifests_are_refused(tmp_path: Path, old: str, new: str, part: str):
    path = fill(tmp_path / "run", outcome=Outcome.REACHED_END)
    manifest = path / "store.json"
    text = manifest.read_text()
    assert old in text
    manifest.write_text(text.replace(old, new))
    for action in (lambda: RunStore.open(path), lambda: RunStore.resume(path, SCENARIO)):
        message = complaint(action)
        assert part in message
        assert str(manifest) in message


def test_foreign_directories_are_refused(tmp_path: Path):
    assert "is not a directory" in complaint(RunStore.open, tmp_path / "absent")
    assert "holds no run (no store.json)" in complaint(RunStore.open, tmp_path)
    assert "holds no run" in complaint(RunStore.resume, tmp_path, SCENARIO)
    for text in ("", "[]", "{", "\xff", '{"a": 1}'):
        (tmp_path / "store.json").write_text(text)
        assert "store.json" in complaint(RunStore.resume, tmp_path, SCENARIO)
    assert [file.name for file in tmp_path.iterdir()] == ["store.json"]


def test_one_writer_at_a_time(tmp_path: Path):
    path = tmp_path / "run"
    with RunStore.create(path, SCENARIO) as store:
        store.append(make_frame(0))
        assert "being written by another process" in complaint(RunStore.resume, path, SCENARIO)
        assert "holds a run already" in complaint(RunStore.create, path, SCENARIO)
        assert len(RunStore.open(path)) == 1
    assert "open for reading" in complaint(RunStore.open(path).append, make_frame(1))
    RunStore.resume(path, SCENARIO).close()


def test_file_system_without_locks_is_used_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(files.fcntl, "flock", unsupported)
    assert len(RunStore.open(fill(tmp_path / "run"))) == 5


_WRITER = """
import sys
from shapespace.study.scenario import scenario
from shapespace.study.store import RunStore
from tests.study.fakes import make_frame
with RunStore.create(sys.argv[1], scenario("guided-division", until=1.0)) as store:
    number = 0
    while True:
        store.append(make_frame(number))
        number += 1
"""


def test_killed_writer_leaves_whole_frames_and_no_lock(tmp_path: Path):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])}
    for delay in (0.0, 0.013, 0.031):
        path = tmp_path / f"run-{delay}"
        writer = subprocess.Popen([sys.executable, "-c", _WRITER, str(path)], env=environment)
        while not frame_file(path, 1).exists():
            assert writer.poll() is None
            time.sleep(0.001)
        time.sleep(delay)
        writer.send_signal(signal.SIGKILL)
        assert writer.wait() == -signal.SIGKILL
        with RunStore.resume(path, SCENARIO) as store:
            assert len(store) >= 2
            for number, frame in enumerate(store):
                assert_same(frame, make_frame(number))
            store.append(make_frame(len(store)))
