"""How a long computation gets on, on stderr: a bar on a terminal, else a plain line now and then."""

import math
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Self

from shapespace.cli.shared import tell

if TYPE_CHECKING:
    from rich.progress import Progress

SECONDS = 5.0
"""Between plain lines."""


class ProgressDisplay:
    """Appears with `start`. Where the share of the work done is known the bar shows it, else it moves."""

    def __init__(self, seconds_between_lines: float = SECONDS) -> None:
        self._pause, self._told = seconds_between_lines, -math.inf
        self._bar: Progress | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def start(self, text: str) -> None:
        """Say that the work begins: the input was good."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        tell(text)
        console = Console(stderr=True, highlight=False, markup=False)
        if console.is_terminal:
            percent = TextColumn("{task.fields[percent]:>5}")
            columns = [percent, BarColumn(20), TimeElapsedColumn(), TextColumn("{task.description}", markup=False)]
            self._bar = Progress(*columns, console=console, transient=True)
            self._bar.add_task("preparing ...", total=None, percent="")
            self._bar.start()

    def update(self, text: str, share: float | None = None, is_notable: bool = False) -> None:
        """Where the work stands; a notable line stays on the screen."""
        # Adding zero takes the sign from a negative one.
        percent = "" if share is None else f"{100 * min(max(share, 0.0), 1.0) + 0.0:.0f} %"
        if self._bar is None:
            if is_notable or monotonic() - self._told >= self._pause:
                self._told = monotonic()
                tell(f"{percent}: {text}" if percent else text)
            return
        total = None if share is None else 1.0
        self._bar.update(self._bar.task_ids[0], description=text, total=total, completed=share or 0.0, percent=percent)
        if is_notable:
            self._bar.console.print(f"shapespace: {text}", soft_wrap=True)


class Way:
    """From the first value of a key to the one at which a computation ends, where that is known."""

    def __init__(self, stop: float | None) -> None:
        self._stop = stop
        self._first: float | None = None

    def share(self, value: float) -> float | None:
        """How much of the way is done; it falls where a branch turns back."""
        if self._stop is None:
            return None
        self._first = value if self._first is None else self._first
        whole = self._stop - self._first
        return (value - self._first) / whole if whole else None
