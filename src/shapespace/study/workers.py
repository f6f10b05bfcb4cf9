"""Processes on this machine that compute tiles: started for one diagram, gone with it.

A worker reads tiles as lines of JSON from its standard input and answers each with a line. It ends where its input
does, and so with the process that started it, however that ends.
"""

import json
import os
import subprocess
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Self

from shapespace.base.errors import StoreError, WorkerError
from shapespace.study.grid import Tile
from shapespace.study.tiles import Done, compute_tile

MAX_DEATHS = 3
"""Workers that one tile may cost."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "NPROC")
"""Each process has one core: more threads than that wait for each other. NPROC is what XLA reads."""


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers:
    """So many processes, each busy with one tile at a time; one alone is this one."""

    def __init__(self, count: int) -> None:
        self._answers: SimpleQueue[tuple[subprocess.Popen[str], str]] = SimpleQueue()
        self._processes: set[subprocess.Popen[str]] = set()
        self._count = count

    @property
    def pids(self) -> list[int]:
        """Of the processes that live."""
        return [one.pid for one in self._processes if one.poll() is None]

    def map(
        self, path: Path, tiles: Sequence[Tile], waiting: Callable[[int], None] = lambda count: None
    ) -> Iterator[Done]:
        """Compute tiles of a stored diagram, in whatever order they are finished.

        The tile of a worker that dies is given to another one. StoreError as a worker met it; WorkerError where a tile
        costs MAX_DEATHS workers.
        """
        if min(self._count, len(tiles)) <= 1:
            yield from (compute_tile(path, tile) for tile in tiles)
            return
        left, deaths = deque(tiles), Counter[Tile]()
        busy: dict[subprocess.Popen[str], Tile] = {}
        while left or busy:
            while left and len(busy) < self._count:
                idle = next((one for one in self._processes if one not in busy), None) or self._start()
                busy[idle] = left.popleft()
                self._ask(idle, path, busy[idle])
            worker, line = self._answers.get()
            tile = busy.pop(worker, None)
            if tile is not None and line:
                yield _read(line)
                continue
            self._end(worker)
            if tile is None:
                continue
            deaths[tile] += 1
            if deaths[tile] == MAX_DEATHS:
                raise WorkerError(
                    f"{path}: {MAX_DEATHS} processes died over the same points (status {worker.wait()}), perhaps of too "
                    "little memory; nothing finished is lost: resume with fewer --workers."
                )
            left.appendleft(tile)

    @staticmethod
    def _ask(worker: subprocess.Popen[str], path: Path, tile: Tile) -> None:
        assert worker.stdin is not None
        # A dead one is noticed by the end of its answers.
        with suppress(BrokenPipeError):
            worker.stdin.write(json.dumps([str(path), *tile]) + "\n")
            worker.stdin.flush()

    def _start(self) -> subprocess.Popen[str]:
        source = str(Path(__file__).parents[2])
        inherited = os.environ.get("PYTHONPATH")
        environment = os.environ | dict.fromkeys(_THREADS, "1")
        environment["PYTHONPATH"] = os.pathsep.join([source, *([inherited] if inherited else [])])
        worker = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            # An interrupt from the keyboard is for the one who asks.
            start_new_session=True,
        )
        self._processes.add(worker)
        threading.Thread(target=self._listen, args=(worker,), daemon=True).start()
        return worker

    def _listen(self, worker: subprocess.Popen[str]) -> None:
        """Pass on what a worker says, and at last that it says no more."""
        assert worker.stdout is not None
        with worker.stdout:
            for line in worker.stdout:
                self._answers.put((worker, line))
        self._answers.put((worker, ""))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in [*self._processes]:
            self._end(worker)

    def _end(self, worker: subprocess.Popen[str]) -> None:
        """Make sure that a worker is gone: what it writes is whole at any moment."""
        self._processes.discard(worker)
        worker.kill()
        worker.wait()
        assert worker.stdin is not None
        with suppress(BrokenPipeError):
            worker.stdin.close()


def _read(line: str) -> Done:
    answer: dict[str, Any] = json.loads(line)
    if "error" in answer:
        raise StoreError(answer["error"])
    return Done(**answer | {"tile": tuple(answer["tile"])})


def serve() -> None:
    """Compute the tiles that come in until there are no more, or nobody is there to ask for them."""
    asked: SimpleQueue[str] = SimpleQueue()

    def listen() -> None:
        for line in sys.stdin:
            asked.put(line)
        # Also in the middle of a tile: its chunks are written in one step or not at all.
        os._exit(0)

    # What others may print must not look like an answer.
    with os.fdopen(os.dup(1), "w") as answers:
        os.dup2(2, 1)
        threading.Thread(target=listen, daemon=True).start()
        while True:
            path, i, j = json.loads(asked.get())
            try:
                answer: dict[str, Any] = compute_tile(path, (i, j))._asdict()
            except StoreError as error:
                answer = {"error": str(error)}
            answers.write(json.dumps(answer) + "\n")
            answers.flush()


if __name__ == "__main__":
    serve()
