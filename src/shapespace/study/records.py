"""Directories of results: `store.json` says what was computed and how, a folder holds numbered records.

    lock              held while a process writes; the system frees it when that process ends, however it ends
    store.json        format, scenario, versions, scales and units, status and outcome
    FOLDER/000000.npz the first record, and so on without gaps

Every file is written beside its place, flushed to the disk and moved there in one step: a process killed at any moment
leaves whole files and at most a `*.tmp` that the next writer removes. Each array carries the CRC of the zip format.
"""

import json
import os
import re
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Generic, Self, TypeVar

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.files import acquire_lock, storage, sync_directory, write_atomically
from shapespace.study.frame import DAMAGE
from shapespace.study.scenario import Scenario
from shapespace.study.versions import own_versions

FORMAT_VERSION = 2
"""To be raised with every change of what is stored, of records too: others are not read."""

CONVENTIONS = (
    "u = 0 upper pole or apex, u = 1 lower pole or rim; r' = h cos psi, z' = -h sin psi; outward normal "
    "(sin psi, cos psi); curvatures positive on a sphere, H half their sum; bending energy kappa/2 (2H - C0)^2 with "
    "kappa = bending_rigidity and C0 = spontaneous_curvature, the same as kappa_H (H - C)^2 with "
    "kappa_H = mean_curvature_rigidity = 2 kappa and C = spontaneous_mean_curvature = C0/2; "
    "velocities in the lab frame; at the initial time, whose state is "
    "given and not solved for, flow, pressure and powers are those of the first step; a flat disc, whose flow has no limit "
    "there, is at rest"
)

_MANIFEST = "store.json"
_LOCK = "lock"
_FORMAT = "shapespace-"

R = TypeVar("R")


class AbstractRecordStore(ABC, Generic[R]):
    """Records of one computation on disk, in order. A store to write holds the directory's lock until `close`.

    noun: what is computed, also the command that does it. folder: of the records, also their plural.
    """

    noun: ClassVar[str]
    folder: ClassVar[str]
    note: ClassVar[str]

    def __init__(self, path: Path, manifest: dict[str, Any], count: int, lock: int | None) -> None:
        self.path = path
        self._manifest = manifest
        self._count = count
        self._lock = lock
        self._unwritten: dict[str, Any] | None = None  # the manifest of a resumed store, due before it is written to

    @staticmethod
    @abstractmethod
    def encode(record: R, /) -> bytes:
        """The bytes of a record's file."""

    @staticmethod
    @abstractmethod
    def decode(data: bytes, /) -> R:
        """The record in these bytes; one of DAMAGE where they are not what was written."""

    @abstractmethod
    def _disorder(self, previous: R, record: R) -> str | None:
        """What shows that a record does not follow the one before it."""

    @classmethod
    def _create(
        cls,
        path: str | Path,
        scenario: Scenario,
        more: Mapping[str, Any],
        furnish: Callable[[Self], None] = lambda store: None,
    ) -> Self:
        """A new store in a directory that is empty or does not exist; StoreError, and nothing written, otherwise.

        furnish: writes what else belongs there from the beginning; killed in it, the store is there to be resumed.
        """
        path = Path(path)
        with storage(path):
            cls.check_free(path)
            made = [directory for directory in (path, *path.parents) if not directory.exists()]
        lock, is_own = None, False
        try:
            with storage(path):
                path.mkdir(parents=True, exist_ok=True)
                lock = acquire_lock(path / _LOCK)
                cls.check_free(path)
                is_own = True
                (path / cls.folder).mkdir(exist_ok=True)
                manifest = cls._new_manifest(scenario) | dict(more)
                _write_json(path / _MANIFEST, manifest)
                store = cls(path, manifest, 0, lock)
                furnish(store)
        except BaseException:
            cls._undo(path, made, lock, is_own)
            raise
        return store

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """A store to read. StoreError where it is foreign or damaged, or records are missing."""
        path = Path(path)
        manifest = cls._read_manifest(path)
        store = cls(path, manifest, cls._count_records(path), None)
        if (manifest[cls.folder] or 0) > len(store):
            missing = store._file(len(store))
            raise StoreError(
                f"{missing}: is missing from a finished {cls.noun}; resume the {cls.noun} to compute it again."
            )
        if len(store):
            store.read(-1)
        return store

    @classmethod
    def _reopen(cls, path: Path, scenario: Scenario) -> Self:
        """A store to continue, with every record checked; `enter` writes `scenario` and the session."""
        with storage(path):
            lock = acquire_lock(path / _LOCK)
        try:
            # Read only now that no other process is writing.
            manifest = cls._read_manifest(path)
            with storage(path):
                for leftover in [*path.glob("*.tmp"), *(path / cls.folder).glob("*.tmp")]:
                    leftover.unlink()
            store = cls(path, manifest, cls._count_records(path), lock)
            store._check_records()
        except BaseException:
            os.close(lock)
            raise
        manifest["scenario"] = scenario.as_dict()
        reopened = {"status": "running", "outcome": None, cls.folder: None}
        if (manifest[cls.folder] or 0) > len(store):
            manifest |= reopened
        session = {"at": _now(), cls.folder: len(store), "versions": own_versions()}
        store._unwritten = manifest | reopened | {"resumed": [*manifest["resumed"], session]}
        return store

    def append(self, record: R) -> None:
        """Write the next record. After a StoreError (disk full, not writable) all records before it are intact."""
        self.enter()
        with storage(self.path, self._remedy):
            write_atomically(self._file(self._count), self.encode(record))
        self._count += 1

    def enter(self) -> None:
        """Note that a session writes to this store, before it does so."""
        self._check_writable()
        if self._unwritten is not None:
            with storage(self.path, self._remedy):
                _write_json(self.path / _MANIFEST, self._unwritten)
            self._manifest, self._unwritten = self._unwritten, None

    def finish(self, outcome: Outcome) -> None:
        """Note how the computation ended."""
        self._check_writable()
        manifest = self._unwritten or self._manifest
        manifest = manifest | {"status": "finished", "outcome": outcome.value, self.folder: self._count}
        with storage(self.path, self._remedy):
            sync_directory(self.path / self.folder)
            _write_json(self.path / _MANIFEST, manifest)
        self._manifest, self._unwritten = manifest, None

    def read(self, index: int) -> R:
        """Record by number, negative from the end. StoreError names the file where it is damaged."""
        number = index + self._count if index < 0 else index
        if not 0 <= number < self._count:
            raise IndexError(f"{self.folder[:-1]} {index}: the {self.noun} has {self._count} {self.folder}.")
        file = self._file(number)
        with storage(file):
            data = file.read_bytes()
        try:
            return self.decode(data)
        except DAMAGE as error:
            later = "it" if number == self._count - 1 else f"it and the {self.folder} after it"
            raise StoreError(
                f"{file}: is damaged ({error}); delete {later} and resume the {self.noun} with --resume."
            ) from None

    def last(self, number: int) -> list[R]:
        """The last records, at most this many, in order."""
        return [self.read(index) for index in range(max(0, self._count - number), self._count)]

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[R]:
        return (self.read(index) for index in range(self._count))

    @property
    def scenario(self) -> Scenario:
        """What was computed; of a resumed run with the new end."""
        return self._scenario_of(self.path, self._manifest)

    @property
    def outcome(self) -> Outcome | None:
        """How the computation ended, None where it has not."""
        return Outcome(self._manifest["outcome"]) if self._manifest["outcome"] else None

    @property
    def created(self) -> str:
        """When the computation was started, as ISO text."""
        return str(self._manifest["created"])

    @property
    def versions(self) -> dict[str, str]:
        """The versions of Python and packages that started the computation."""
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

    @property
    def _remedy(self) -> str:
        return f"its {self._count} {self.folder} are intact: then resume the {self.noun}"

    def _file(self, number: int) -> Path:
        return self.path / self.folder / f"{number:06d}.npz"

    def _check_writable(self) -> None:
        if self._lock is None:
            raise StoreError(f"{self.path}: is open for reading; resume the {self.noun} to write to it.")

    def _check_records(self) -> None:
        previous = None
        for number, record in enumerate(self):
            if previous is not None and (trouble := self._disorder(previous, record)):
                raise StoreError(
                    f"{self._file(number)}: is out of order ({trouble}); delete it and the {self.folder} after it and "
                    f"resume the {self.noun} with --resume."
                )
            previous = record

    @classmethod
    def check_free(cls, path: str | Path) -> None:
        """StoreError unless the path is free for a new store: absent, empty, or left by a creation that was killed."""
        path = Path(path)
        if "\0" in str(path):
            raise StoreError(f"{str(path)!r}: is no path; choose another --out.")
        if not path.exists() and not path.is_symlink():
            return
        if not path.is_dir():
            raise StoreError(f"{path}: is not a directory; choose another --out.")
        names = {entry.name for entry in path.iterdir()} - {_LOCK, f"{_MANIFEST}.tmp"}
        if names == {cls.folder} and not any((path / cls.folder).iterdir()):
            names = set()
        if _MANIFEST in names:
            noun = noun_of(path) or "run"
            raise StoreError(f"{path}: holds a {noun} already; continue it with --resume or choose another --out.")
        if names:
            raise StoreError(f"{path}: holds other files ({min(names)}); choose an empty or a new directory as --out.")

    @classmethod
    def _undo(cls, path: Path, made: list[Path], lock: int | None, is_own: bool) -> None:
        """Take back what a failed creation wrote, in a directory that was found free under the lock."""
        with suppress(OSError):
            # The manifest last but one: killed before, the store is there to be resumed.
            last = (_MANIFEST, _LOCK)
            entries = sorted(path.iterdir(), key=lambda one: last.index(one.name) if one.name in last else -1)
            for entry in entries if is_own else ():
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        if lock is not None:
            os.close(lock)
        with suppress(OSError):
            for directory in made:
                directory.rmdir()

    @classmethod
    def _new_manifest(cls, scenario: Scenario) -> dict[str, Any]:
        scales = scenario.scales
        return {
            "format": _FORMAT + cls.noun,
            "format_version": FORMAT_VERSION,
            "created": _now(),
            "versions": own_versions(),
            "scales": {name: getattr(scales, name) for name in ("length", "energy", "time", "concentration")},
            "units": {name: scales.unit(name) for name in QUANTITIES},
            "conventions": CONVENTIONS,
            "note": cls.note,
            "scenario": scenario.as_dict(),
            "status": "running",
            "outcome": None,
            cls.folder: None,
            "resumed": [],
        }

    @classmethod
    def _read_manifest(cls, path: Path) -> dict[str, Any]:
        file, made = path / _MANIFEST, f"`shapespace {cls.noun}` made"
        with storage(path):
            if not path.is_dir():
                raise StoreError(f"{path}: is not a directory that holds a {cls.noun}; give one that {made}.")
            if not file.exists():
                raise StoreError(f"{path}: holds no {cls.noun} (no {_MANIFEST}); give a directory that {made}.")
            data = file.read_bytes()
        remedy = f"restore it, or {cls.noun} again with another --out."
        try:
            manifest = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise StoreError(f"{file}: is damaged ({error}); {remedy}") from None
        if not isinstance(manifest, dict) or manifest.get("format") != _FORMAT + cls.noun:
            raise StoreError(f"{file}: is not of a {_FORMAT}{cls.noun} store; give a directory that {made}.")
        if manifest.get("format_version") != FORMAT_VERSION:
            raise StoreError(
                f"{file}: was written by another version of shapespace (format_version {manifest.get('format_version')}, this "
                f"one reads {FORMAT_VERSION}); use that version, or {cls.noun} again with another --out."
            )
        missing = {"created", "versions", "scenario", "outcome", cls.folder, "resumed", "status"} - manifest.keys()
        if missing:
            raise StoreError(f"{file}: is damaged (no {min(missing)}); {remedy}")
        if not isinstance(manifest[cls.folder], int | None) or manifest["outcome"] not in {None, *Outcome}:
            raise StoreError(f"{file}: is damaged (outcome or {cls.folder}); {remedy}")
        cls._scenario_of(path, manifest)
        return manifest

    @classmethod
    def _scenario_of(cls, path: Path, manifest: dict[str, Any]) -> Scenario:
        try:
            return Scenario.from_dict(manifest["scenario"])
        except (InputError, KeyError, TypeError, AttributeError) as error:
            if "--import" in str(error):
                raise StoreError(f"{path}: {error}") from None
            raise StoreError(
                f"{path / _MANIFEST}: is damaged (scenario: {error}); restore it, or {cls.noun} again with another --out."
            ) from None

    @classmethod
    def _count_records(cls, path: Path) -> int:
        """The number of records. StoreError where one in between is missing."""
        with storage(path):
            names = [entry.name for entry in (path / cls.folder).iterdir()]
        numbers = sorted(int(name[:-4]) for name in names if re.fullmatch(r"\d{6,}\.npz", name))
        for expected, number in enumerate(numbers):
            if number != expected:
                raise StoreError(
                    f"{path / cls.folder / f'{expected:06d}.npz'}: is missing while later {cls.folder} are there; restore "
                    f"it, or delete the later ones and resume the {cls.noun} with --resume."
                )
        return len(numbers)


def noun_of(path: str | Path) -> str | None:
    """What a directory holds by its manifest, `run`, `branch` or `curve`; None where that cannot be told."""
    try:
        manifest = json.loads((Path(path) / _MANIFEST).read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    form = manifest.get("format") if isinstance(manifest, dict) else None
    return form.removeprefix(_FORMAT) if isinstance(form, str) and form.startswith(_FORMAT) else None


def holds_store(path: str | Path) -> bool:
    """Whether there is a manifest in this directory, whatever its state."""
    try:
        return (Path(path) / _MANIFEST).is_file()
    except OSError:
        return False


def _write_json(path: Path, content: dict[str, Any]) -> None:
    write_atomically(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())
    sync_directory(path.parent)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
