"""The explorer beside a notebook: it answers in a thread of the notebook's own process."""

import threading
from html import escape
from pathlib import Path
from typing import Protocol

from shapespace.app.explore import Explorer
from shapespace.base.errors import InputError

HEIGHT = 760
"""Of the frame, in pixels: from 1000 pixels of width on nothing needs to be scrolled."""


class HasStore(Protocol):
    """A run, a branch, a curve, a search or a diagram."""

    @property
    def store(self) -> Path | None:
        """Its directory."""


class Beside:
    """A served explorer that a notebook shows as a frame. `address` opens in any browser of this machine; `stop` ends it."""

    def __init__(self, explorer: Explorer, height: int) -> None:
        self._explorer, self._height = explorer, height
        self._thread = threading.Thread(target=explorer.serve, daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """With its token."""
        return self._explorer.address

    def stop(self) -> None:
        """Answer no longer."""
        self._explorer.stop()
        self._thread.join()

    def __repr__(self) -> str:
        return f"Explorer at {self.address}"

    def _repr_html_(self) -> str:
        address, style = escape(self.address), f"width:100%;height:{self._height}px;border:0"
        frame = f'<iframe title="shapespace explorer" src="{address}" style="{style}"></iframe>'
        return f'<div>{frame}<div><a href="{address}" target="_blank" rel="noopener">open in a window of its own</a></div></div>'


def explore(*sources: str | Path | HasStore, port: int = 0, height: int = HEIGHT) -> Beside:
    """The explorer of stores or stored results, as the command `explore` shows it, served until `stop` or the end of Python.

    height: of the frame in a notebook, in pixels. InputError where a result is in memory only, or a port is taken.
    """
    stores = []
    for source in sources:
        store = source if isinstance(source, str | Path) else source.store
        if store is None:
            raise InputError("explore: this result is in memory only; make it with `out=FOLDER`, and explore that.")
        if not Path(store).is_dir():
            raise InputError(f"{store}: is not a directory that holds results; give one that `shapespace` made.")
        stores.append(store)
    return Beside(Explorer(stores, port), height)
