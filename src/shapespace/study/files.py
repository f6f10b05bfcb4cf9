"""Files that are whole or not there, the lock of a directory, and the system's complaints as one-line errors."""

import errno
import fcntl
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from shapespace.base.errors import StoreError

_NOT_WRITABLE = {errno.EACCES, errno.EPERM, errno.EROFS}
_NO_LOCKS = {errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK}


@contextmanager
def storage(path: Path, then: str = "nothing was written: then run again") -> Iterator[None]:
    """Turn what the system says about a file into a StoreError of one line."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StoreError(f"{path}: the disk is full ({reason}); free some space, {then}.") from error
        if error.errno in _NOT_WRITABLE:
            raise StoreError(
                f"{path}: permission is missing ({reason}); change it, or choose another --out."
            ) from error
        raise StoreError(f"{path}: cannot be read or written ({reason}); choose another directory.") from error


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that, at any moment, there is the old one or the whole new one. OSError where it fails."""
    partial = path.with_name(f"{path.name}.tmp")
    try:
        with partial.open("wb", buffering=0) as file:
            view = memoryview(data)
            while view:
                view = view[file.write(view) :]
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        with suppress(OSError):
            partial.unlink()
        raise


def sync_files(paths: Iterable[Path]) -> None:
    """Flush files that others wrote to the disk, those that are there."""
    for path in paths:
        with suppress(FileNotFoundError):
            file = os.open(path, os.O_RDONLY)
            try:
                os.fsync(file)
            finally:
                os.close(file)


def sync_directory(path: Path) -> None:
    """Flush the names in a directory to the disk."""
    # Some file systems cannot flush a directory; the files in it are flushed all the same.
    with suppress(OSError):
        directory = os.open(path, os.O_RDONLY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)


def acquire_lock(path: Path) -> int:
    """Lock a file for this process, made where there is none; closing the descriptor frees it. StoreError if taken."""
    lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise StoreError(
            f"{path.parent}: is being written by another process; wait for it to end or choose another --out."
        ) from None
    except OSError as error:
        # File systems of some clusters have no locks; there the rule of one writer is the user's to keep.
        if error.errno not in _NO_LOCKS:
            os.close(lock)
            with suppress(OSError):
                path.unlink()
            raise
    return lock


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path beside `path`, with its ending, to write to; it takes the place of `path` when all went well.

    StoreError where the file cannot be written; then the old one, if any, is still there.
    """
    partial = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with storage(path):
            yield partial
            partial.replace(path)
    except BaseException:
        with suppress(OSError):
            partial.unlink()
        raise
