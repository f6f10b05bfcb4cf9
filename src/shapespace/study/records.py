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
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Generic, Self, TypeVar

from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.files import acquire_lock, storage, sync_directory, write_atomically
from shapespace.study.frame import DAMAGE
from shapespace.study.manifests import (
    MANIFEST,
    new_manifest,
    noun_of,
    now,
    read_manifest,
    scenario_of,
    write_manifest,
)
from shapespace.study.scenario import Scenario
from shapespace.study.versions import own_versions

_LOCK = "lock"

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
        self._made: list[Path] = []  # directories that came with the store
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
                manifest = new_manifest(cls.noun, cls.folder, cls.note, scenario) | dict(more)
                write_manifest(path, manifest)
                store = cls(path, manifest, 0, lock)
                store._made = made
                furnish(store)
        except BaseException:
            cls._undo(path, made, lock, is_own)
            raise
        return store

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """A store to read. StoreError where it is foreign or damaged, or records are missing."""
        path = Path(path)
        manifest = read_manifest(path, cls.noun, cls.folder)
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
    def open_damaged(cls, path: str | Path) -> Self:
        """A store to look at whatever has become of its records: `read` says which of them are damaged or missing."""
        manifest, numbers = read_manifest(Path(path), cls.noun, cls.folder), cls._numbers(Path(path))
        return cls(Path(path), manifest, max([manifest[cls.folder] or 0, *(one + 1 for one in numbers)]), None)

    @classmethod
    def _reopen(cls, path: Path, scenario: Scenario) -> Self:
        """A store to continue, with every record checked; `enter` writes `scenario` and the session."""
        with storage(path):
            lock = acquire_lock(path / _LOCK)
        try:
            # Read only now that no other process is writing.
            manifest = read_manifest(path, cls.noun, cls.folder)
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
        session = {"at": now(), cls.folder: len(store), "versions": own_versions()}
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
                write_manifest(self.path, self._unwritten)
            self._manifest, self._unwritten = self._unwritten, None

    def finish(self, outcome: Outcome) -> None:
        """Note how the computation ended."""
        self._check_writable()
        manifest = self._unwritten or self._manifest
        manifest = manifest | {"status": "finished", "outcome": outcome.value, self.folder: self._count}
        with storage(self.path, self._remedy):
            sync_directory(self.path / self.folder)
            write_manifest(self.path, manifest)
        self._manifest, self._unwritten = manifest, None

    def discard(self) -> None:
        """Take back a store that was made to be written and holds no record, as if it had never been begun."""
        if self._lock is not None and not self._count:
            self._undo(self.path, self._made, self._lock, is_own=True)
            self._lock = None

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
        return scenario_of(self.path, self.noun, self._manifest)

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
        names = {entry.name for entry in path.iterdir()} - {_LOCK, f"{MANIFEST}.tmp"}
        if names == {cls.folder} and not any((path / cls.folder).iterdir()):
            names = set()
        if MANIFEST in names:
            noun = noun_of(path) or "run"
            raise StoreError(f"{path}: holds a {noun} already; continue it with --resume or choose another --out.")
        if names:
            raise StoreError(f"{path}: holds other files ({min(names)}); choose an empty or a new directory as --out.")

    @classmethod
    def _undo(cls, path: Path, made: list[Path], lock: int | None, is_own: bool) -> None:
        """Take back what a failed creation wrote, in a directory that was found free under the lock."""
        with suppress(OSError):
            # The manifest last but one: killed before, the store is there to be resumed.
            last = (MANIFEST, _LOCK)
            entries = sorted(path.iterdir(), key=lambda one: last.index(one.name) if one.name in last else -1)
            for entry in entries if is_own else ():
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        if lock is not None:
            os.close(lock)
        with suppress(OSError):
            for directory in made:
                directory.rmdir()

    @classmethod
    def _count_records(cls, path: Path) -> int:
        """The number of records. StoreError where one in between is missing."""
        numbers = cls._numbers(path)
        for expected, number in enumerate(numbers):
            if number != expected:
                raise StoreError(
                    f"{path / cls.folder / f'{expected:06d}.npz'}: is missing while later {cls.folder} are there; restore "
                    f"it, or delete the later ones and resume the {cls.noun} with --resume."
                )
        return len(numbers)

    @classmethod
    def _numbers(cls, path: Path) -> list[int]:
        with storage(path):
            names = [entry.name for entry in (path / cls.folder).iterdir()]
        return sorted(int(name[:-4]) for name in names if re.fullmatch(r"\d{6,}\.npz", name))
