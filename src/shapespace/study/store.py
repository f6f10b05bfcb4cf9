"""The directory of a run: `store.json` says what was computed and how, `frames/NNNNNN.npz` hold one time step each.

    lock              held while a process writes; the system frees it when that process ends, however it ends
    store.json        format, scenario, versions, scales and units, status and outcome
    frames/000000.npz initial state; clock = (time, step, next_step), mesh, nodes, slopes, algebraic, scalars,
                      observable_names, observable_values

Every file is written beside its place, flushed to the disk and moved there in one step: a process killed at any moment
leaves whole files and at most a `*.tmp` that the next writer removes. Each array carries the CRC of the zip format.
"""

import json
import os
import platform
import re
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.files import acquire_lock, storage, sync_directory, write_atomically
from shapespace.study.frame import DAMAGE, Frame, decode_frame, encode_frame
from shapespace.study.scenario import FREE_ON_RESUME, Scenario

FORMAT = "shapespace-run"
FORMAT_VERSION = 1

_MANIFEST = "store.json"
_LOCK = "lock"
_FRAMES = "frames"
_NOTE = "arrays of frames are dimensionless, in units of the scales; times and observables are in the scenario's units"


class RunStore:
    """The frames of one run on disk, in order. `create` and `resume` give a store to write, `open` one to read.

    A store to write holds the directory's lock until `close`; use it as a context manager.
    """

    def __init__(self, path: Path, manifest: dict[str, Any], count: int, lock: int | None) -> None:
        self.path = path
        self._manifest = manifest
        self._count = count
        self._lock = lock
        self._unwritten: dict[str, Any] | None = None  # the manifest of a resumed run, due with its next frame

    @classmethod
    def create(cls, path: str | Path, scenario: Scenario) -> Self:
        """A new store in a directory that is empty or does not exist; StoreError, and nothing written, otherwise."""
        path = Path(path)
        with storage(path):
            _check_free(path)
            made = [directory for directory in (path, *path.parents) if not directory.exists()]
        lock = None
        try:
            with storage(path):
                path.mkdir(parents=True, exist_ok=True)
                lock = acquire_lock(path / _LOCK)
                _check_free(path)
                (path / _FRAMES).mkdir(exist_ok=True)
                manifest = _new_manifest(scenario)
                _write_json(path / _MANIFEST, manifest)
        except BaseException:
            _undo(path, made, lock)
            raise
        return cls(path, manifest, 0, lock)

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """A stored run to read. StoreError where it is foreign or damaged, or frames are missing."""
        path = Path(path)
        manifest = _read_manifest(path)
        store = cls(path, manifest, _count_frames(path), None)
        if (manifest["frames"] or 0) > len(store):
            missing = _frame_path(path, len(store))
            raise StoreError(f"{missing}: is missing from a finished run; resume the run to compute it again.")
        if len(store):
            store.read(-1)
        return store

    @classmethod
    def resume(cls, path: str | Path, scenario: Scenario) -> Self:
        """A stored run to continue. Checks every frame; only `until` and `max_steps` may differ."""
        path = Path(path)
        stored = _scenario_of(path, _read_manifest(path))
        if difference := stored.difference(scenario):
            raise StoreError(
                f"{path}: holds a run whose {difference}; resume with the same value or choose another --out."
            )
        with storage(path):
            lock = acquire_lock(path / _LOCK)
        try:
            # Read again: only now is no other process writing.
            manifest = _read_manifest(path)
            with storage(path):
                for leftover in [*path.glob("*.tmp"), *(path / _FRAMES).glob("*.tmp")]:
                    leftover.unlink()
            store = cls(path, manifest, _count_frames(path), lock)
            store._check_frames()
        except BaseException:
            os.close(lock)
            raise
        changes = {key: getattr(scenario.run, key) for key in FREE_ON_RESUME}
        manifest["scenario"] = stored.with_overrides(changes).as_dict()
        reopened = {"status": "running", "outcome": None, "frames": None}
        if (manifest["frames"] or 0) > len(store):
            manifest |= reopened
        session = {"at": _now(), "frames": len(store), "versions": _versions()}
        store._unwritten = manifest | reopened | {"resumed": [*manifest["resumed"], session]}
        return store

    def append(self, frame: Frame) -> None:
        """Write the next frame. After a StoreError (disk full, not writable) all frames before it are intact."""
        self._check_writable()
        with storage(self.path, f"its {self._count} frames are intact: then resume the run"):
            if self._unwritten is not None:
                _write_json(self.path / _MANIFEST, self._unwritten)
                self._manifest, self._unwritten = self._unwritten, None
            write_atomically(_frame_path(self.path, self._count), encode_frame(frame))
        self._count += 1

    def finish(self, outcome: Outcome) -> None:
        """Note how the run ended."""
        self._check_writable()
        manifest = self._unwritten or self._manifest
        manifest = manifest | {"status": "finished", "outcome": outcome.value, "frames": self._count}
        with storage(self.path, f"its {self._count} frames are intact: then resume the run"):
            sync_directory(self.path / _FRAMES)
            _write_json(self.path / _MANIFEST, manifest)
        self._manifest, self._unwritten = manifest, None

    def read(self, index: int) -> Frame:
        """Frame by number, negative from the end. StoreError names the file where it is damaged."""
        number = index + self._count if index < 0 else index
        if not 0 <= number < self._count:
            raise IndexError(f"frame {index}: the run has {self._count} frames.")
        file = _frame_path(self.path, number)
        with storage(file):
            data = file.read_bytes()
        try:
            return decode_frame(data)
        except DAMAGE as error:
            later = "it" if number == self._count - 1 else "it and the frames after it"
            raise StoreError(
                f"{file}: is damaged ({error}); delete {later} and resume the run with --resume."
            ) from None

    def last(self, number: int) -> list[Frame]:
        """The last frames, at most this many, in order."""
        return [self.read(index) for index in range(max(0, self._count - number), self._count)]

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Frame]:
        return (self.read(index) for index in range(self._count))

    @property
    def scenario(self) -> Scenario:
        """What was computed; of a resumed run with the new end."""
        return _scenario_of(self.path, self._manifest)

    @property
    def outcome(self) -> Outcome | None:
        """How the run ended, None where it has not."""
        return Outcome(self._manifest["outcome"]) if self._manifest["outcome"] else None

    @property
    def created(self) -> str:
        """When the run was started, as ISO text."""
        return str(self._manifest["created"])

    @property
    def versions(self) -> dict[str, str]:
        """The versions of Python and packages that started the run."""
        return dict(self._manifest["versions"])

    @property
    def manifest(self) -> dict[str, Any]:
        """A copy of what `store.json` holds."""
        return json.loads(json.dumps(self._manifest))

    def close(self) -> None:
        """Give the lock back; the store can still be read."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _check_writable(self) -> None:
        if self._lock is None:
            raise StoreError(f"{self.path}: is open for reading; resume the run to write to it.")

    def _check_frames(self) -> None:
        previous = -np.inf
        for number, frame in enumerate(self):
            if not frame.time > previous:
                raise StoreError(
                    f"{_frame_path(self.path, number)}: is out of order (time {frame.time:g} after {previous:g}); "
                    "delete it and the frames after it and resume the run with --resume."
                )
            previous = frame.time


def holds_run(path: str | Path) -> bool:
    """Whether there is a run's manifest in this directory, whatever its state."""
    return (Path(path) / _MANIFEST).is_file()


def is_free(path: str | Path) -> bool:
    """Whether a new run can be created in this directory; StoreError where that cannot be found out."""
    with storage(Path(path)):
        try:
            _check_free(Path(path))
        except StoreError:
            return False
    return True


def _write_json(path: Path, content: dict[str, Any]) -> None:
    write_atomically(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())
    sync_directory(path.parent)


def _check_free(path: Path) -> None:
    """StoreError unless the path is free for a new run: absent, empty, or left by a creation that was killed."""
    if "\0" in str(path):
        raise StoreError(f"{str(path)!r}: is no path; choose another --out.")
    if not path.exists() and not path.is_symlink():
        return
    if not path.is_dir():
        raise StoreError(f"{path}: is not a directory; choose another --out.")
    names = {entry.name for entry in path.iterdir()} - {_LOCK, f"{_MANIFEST}.tmp"}
    if names == {_FRAMES} and not any((path / _FRAMES).iterdir()):
        names = set()
    if _MANIFEST in names:
        raise StoreError(f"{path}: holds a run already; continue it with --resume or choose another --out.")
    if names:
        raise StoreError(f"{path}: holds other files ({min(names)}); choose an empty or a new directory as --out.")


def _undo(path: Path, made: list[Path], lock: int | None) -> None:
    """Take back what a failed creation wrote. Without the lock another process owns the directory: leave it alone."""
    with suppress(OSError):
        if lock is not None:
            (path / _FRAMES).rmdir()
    with suppress(OSError):
        if lock is not None:
            (path / _LOCK).unlink()
            os.close(lock)
    with suppress(OSError):
        for directory in made:
            directory.rmdir()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in ("shapespace", "jax", "numpy"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def _new_manifest(scenario: Scenario) -> dict[str, Any]:
    scales = scenario.scales
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "created": _now(),
        "versions": _versions(),
        "scales": {name: getattr(scales, name) for name in ("length", "energy", "time", "concentration")},
        "units": {name: scales.unit(name) for name in QUANTITIES},
        "note": _NOTE,
        "scenario": scenario.as_dict(),
        "status": "running",
        "outcome": None,
        "frames": None,
        "resumed": [],
    }


def _read_manifest(path: Path) -> dict[str, Any]:
    file = path / _MANIFEST
    with storage(path):
        if not path.is_dir():
            raise StoreError(f"{path}: is not a directory that holds a run; give one that `shapespace run` made.")
        if not file.exists():
            raise StoreError(f"{path}: holds no run (no {_MANIFEST}); give a directory that `shapespace run` made.")
        data = file.read_bytes()
    try:
        manifest = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{file}: is damaged ({error}); restore it, or run again with another --out.") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise StoreError(f"{file}: is not of a {FORMAT} store; give a directory that `shapespace run` made.")
    if manifest.get("format_version") != FORMAT_VERSION:
        raise StoreError(
            f"{file}: has format_version {manifest.get('format_version')}, this shapespace reads {FORMAT_VERSION}; "
            "use the shapespace that wrote it."
        )
    missing = {"created", "versions", "scenario", "outcome", "frames", "resumed", "status"} - manifest.keys()
    if missing:
        raise StoreError(f"{file}: is damaged (no {min(missing)}); restore it, or run again with another --out.")
    if not isinstance(manifest["frames"], int | None) or manifest["outcome"] not in {None, *Outcome}:
        raise StoreError(f"{file}: is damaged (outcome or frames); restore it, or run again with another --out.")
    _scenario_of(path, manifest)
    return manifest


def _scenario_of(path: Path, manifest: dict[str, Any]) -> Scenario:
    try:
        return Scenario.from_dict(manifest["scenario"])
    except (InputError, KeyError, TypeError, AttributeError) as error:
        raise StoreError(
            f"{path / _MANIFEST}: is damaged (scenario: {error}); restore it, or run again with another --out."
        ) from None


def _frame_path(path: Path, number: int) -> Path:
    return path / _FRAMES / f"{number:06d}.npz"


def _count_frames(path: Path) -> int:
    """The number of frames. StoreError where one in between is missing."""
    with storage(path):
        names = [entry.name for entry in (path / _FRAMES).iterdir()]
    numbers = sorted(int(name[:-4]) for name in names if re.fullmatch(r"\d{6,}\.npz", name))
    for expected, number in enumerate(numbers):
        if number != expected:
            raise StoreError(
                f"{_frame_path(path, expected)}: is missing while later frames are there; restore it, or delete the "
                "later ones and resume the run with --resume."
            )
    return len(numbers)
