"""Executables kept on disk, so that a new process neither traces nor compiles what an earlier one has.

JAX's own cache finds a compiled function only after it has been traced and lowered, which for the equations of a surface takes
seconds. Here the key needs no tracing: everything that an executable depends on must therefore be in `fingerprint`, or be
in the name that the caller gives.
"""

import hashlib
import os
import pickle
import platform
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
from jax.experimental import serialize_executable
from jax.experimental.compilation_cache import compilation_cache

PACKAGE = Path(__file__).resolve().parents[1]
MOST = 300
"""Files kept; the oldest go first. They are a few hundred kB each."""
IMPORTING = 60.0
"""Seconds that importing the package takes at most. Sources that are younger may not be the ones that were imported."""
_LOADED = time.time()


@cache
def fingerprint(package: Path = PACKAGE) -> str:
    """Of all sources of the package, the interpreter, JAX and its settings, and the processor."""
    parts = [sys.version, jax.__version__, version("jaxlib"), jax.default_backend(), _processor()]
    parts += [os.environ.get("XLA_FLAGS", ""), str(jax.config.values["jax_default_matmul_precision"])]
    digest = hashlib.sha256("\0".join(parts).encode())
    for path in sorted(package.rglob("*.py")):
        digest.update(f"\0{path.relative_to(package)}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _processor() -> str:
    """What code for this processor may use."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        known = ("model name", "flags", "Features")
        return "\n".join(dict.fromkeys(line for line in info.read_text().splitlines() if line.startswith(known)))
    return f"{platform.machine()} {platform.processor()}"


class Kept:
    """A function of arrays, compiled for each of their shapes once and kept under `name`. Called like the function."""

    def __init__(self, function: Callable[..., Any], name: str) -> None:
        self._function = jax.jit(function)
        self._name = name
        self._executables: dict[tuple[tuple[int, ...], ...], Callable[..., Any]] = {}

    def __call__(self, *arrays: Any) -> Any:
        """The function's value. TypeError from JAX where arrays are not of doubles."""
        shapes = tuple(array.shape for array in arrays)
        executable = self._executables.get(shapes)
        if executable is None:
            executable = self._executables[shapes] = self._executable(shapes, arrays)
        return executable(*arrays)

    def _executable(self, shapes: tuple[tuple[int, ...], ...], arrays: tuple[Any, ...]) -> Callable[..., Any]:
        folder = _folder()
        if folder is None:
            return self._function
        key = hashlib.sha256(f"{fingerprint()}\0{self._name}\0{shapes}".encode()).hexdigest()
        path = folder / f"{key}.bin"
        content = _read(path)
        if content is not None:
            return serialize_executable.deserialize_and_load(*pickle.loads(content))
        with _really_compiling():
            compiled = self._function.lower(*arrays).compile()
        _write(path, pickle.dumps(serialize_executable.serialize(compiled)))
        return compiled


@contextmanager
def _really_compiling() -> Iterator[None]:
    """Without JAX's cache: an executable that comes from there lacks parts when it is stored a second time."""
    before = jax.config.values["jax_enable_compilation_cache"]
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()
    try:
        yield
    finally:
        jax.config.update("jax_enable_compilation_cache", before)
        compilation_cache.reset_cache()


def _folder() -> Path | None:
    """Beside what JAX keeps; None where it keeps nothing, or the sources are not surely those of this process."""
    root = jax.config.values["jax_compilation_cache_dir"]
    newest = max(path.stat().st_mtime for path in PACKAGE.rglob("*.py"))
    return Path(root) / "executables" if root and newest < _LOADED - IMPORTING else None


def _read(path: Path) -> bytes | None:
    """What a whole file holds; None where there is none, or a damaged one."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    return stored[32:] if stored[:32] == hashlib.sha256(stored[32:]).digest() else None


def _write(path: Path, content: bytes) -> None:
    """Write a file that others see whole or not at all, and forget the oldest. A full or foreign disk keeps nothing."""
    part = path.with_suffix(f".{os.getpid()}")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(hashlib.sha256(content).digest() + content)
        part.replace(path)
        by_age = sorted(path.parent.iterdir(), key=lambda one: one.stat().st_mtime)
        for old in by_age[:-MOST]:
            old.unlink()
