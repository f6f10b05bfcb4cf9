"""Explorers that answer in a thread of this process."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from shapespace.app.explore import Explorer


class Stores(NamedTuple):
    """Directories of a run, a branch and a map."""

    run: Path
    branch: Path
    map: Path


class MoreStores(NamedTuple):
    """Directories of a branch with a fold, curves of folds and of pitchforks, a search, and a map of two states."""

    division: Path
    folds: Path
    forks: Path
    search: Path
    states: Path


@contextmanager
def serving(*stores: Path) -> Iterator[Explorer]:
    """An explorer that answers until the end of the block."""
    explorer = Explorer(stores)
    thread = threading.Thread(target=explorer.serve, daemon=True)
    thread.start()
    try:
        yield explorer
    finally:
        explorer.stop()
        thread.join(10)
    assert not thread.is_alive()
