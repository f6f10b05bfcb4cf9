"""Tiles computed by the workers of a Dask cluster, wherever its scheduler is; they must see the directory of the store."""

import asyncio
import logging
import platform
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import NamedTemporaryFile
from types import TracebackType
from typing import Any, NamedTuple, Self

from shapespace.base.errors import InputError, WorkerError
from shapespace.study.files import storage
from shapespace.study.grid import Tile
from shapespace.study.plugins import files_here, receive_files
from shapespace.study.tiles import Done, compute_tile
from shapespace.study.versions import own_version

SECONDS = 10.0
"""To wait for a scheduler's answer."""
PAUSE = 2.0
"""Without a finished tile, after which it is asked how many workers there are."""
RETRIES = 2
"""Of a tile that fails for a reason outside of it, as a node that runs out of memory."""

Waiting = Callable[[int], None]
"""Told how many workers there are, now and then."""


class Cluster:
    """The cluster of a scheduler's address, e.g. tcp://host:8786, to compute a store at `out`.

    InputError where none answers, where a worker that is there has another version of this package or none, and where it does
    not see the directory.
    """

    def __init__(self, address: str, out: Path) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError(
                f"--dask {address}: needs the package distributed; install shapespace with its extra `cluster`."
            ) from None
        # A client that was made in vain would wait for its scheduler, and complain of it when it is thrown away.
        _check_scheduler(address)
        names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
        self._levels = {name: logging.getLogger(name).level for name in names}
        self._set_levels(dict.fromkeys(self._levels, logging.CRITICAL))
        try:
            self._client = Client(address, timeout=SECONDS, set_as_default=False)
        except (OSError, ValueError) as error:
            self._set_levels(self._levels)
            raise InputError(f"--dask {address}: its scheduler takes no client ({error}); start another one.") from None
        try:
            self._check_workers(out)
        except BaseException:
            self.close()
            raise

    def _check_workers(self, out: Path) -> None:
        """Ask every worker that is there what it is, and whether it sees a file where the store is to be."""
        parent = next(one for one in (out.resolve(), *out.resolve().parents) if one.is_dir())
        with ExitStack() as stack:
            with storage(parent):
                probe = stack.enter_context(NamedTemporaryFile(dir=parent, prefix=".shapespace-"))
            answers = self._client.run(_look, probe.name, on_error="return")
        for worker, found in answers.items():
            if isinstance(found, OSError):
                # It was lost while it was asked: its tiles go to others.
                continue
            if isinstance(found, BaseException):
                raise InputError(
                    f"--dask: the worker {worker} has no shapespace ({found}); install {own_version()} there."
                )
            _check_version(found.version, own_version(), worker)
            if not found.sees:
                raise InputError(
                    f"--dask: the worker {worker} on {found.host} does not see {parent}; choose an --out in a directory that "
                    "all workers share under the same path."
                )

    def map(self, path: Path, tiles: Sequence[Tile], waiting: Waiting = lambda count: None) -> Iterator[Done]:
        """Compute tiles of a stored diagram, in whatever order they are finished.

        waiting: told how many workers there are, at first and while no tile is finished. InputError as a worker met it, another
        version of this package there among them; WorkerError where workers or the scheduler are lost.
        """
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        count, files = len(tiles), files_here()
        arguments = [str(path.resolve())] * count, tiles, [own_version()] * count, [files] * count
        finished: SimpleQueue[Any] = SimpleQueue()
        futures = self._client.map(_compute, *arguments, pure=False, retries=RETRIES)
        try:
            for future in futures:
                future.add_done_callback(finished.put)
            waiting(len(self._client.nthreads()))
            while count:
                try:
                    future = finished.get(timeout=PAUSE)
                except Empty:
                    # Without a scheduler all futures are given up soon.
                    if self._client.status == "running":
                        waiting(len(self._client.nthreads()))
                    continue
                count -= 1
                yield future.result()
        except KilledWorker:
            raise WorkerError(
                f"{path}: workers of the cluster died over the same points, most often of too little memory; nothing finished is "
                "lost: give them more, then resume."
            ) from None
        except (FutureCancelledError, OSError) as error:
            raise WorkerError(
                f"{path}: the scheduler of the cluster is lost ({type(error).__name__}); nothing finished is lost: resume."
            ) from None
        finally:
            with suppress(OSError):
                self._client.cancel(futures)

    def close(self) -> None:
        """Leave the cluster as it is."""
        self._client.close()
        self._set_levels(self._levels)

    def _set_levels(self, levels: dict[str, int]) -> None:
        """What its library would log of a lost scheduler is told in a line."""
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _check_scheduler(address: str) -> None:
    """InputError unless a scheduler answers at an address."""
    from distributed.comm.addressing import parse_address
    from distributed.comm.core import connect
    from distributed.comm.registry import get_backend
    from distributed.security import Security

    async def ask() -> str:
        security = Security().get_connection_args("client")
        comm = await connect(address, timeout=SECONDS, **security)
        try:
            await comm.write({"op": "identity", "reply": True})
            return str((await comm.read())["type"])
        finally:
            comm.abort()

    try:
        scheme, place = parse_address(address)
        with suppress(NotImplementedError):
            get_backend(scheme).get_address_host_port(place)
    except ValueError as error:
        raise InputError(f"--dask {address}: is no address ({error}); give one like tcp://host:8786.") from None
    try:
        # In a thread of its own, since a notebook has a loop of events in this one.
        with ThreadPoolExecutor(1) as pool:
            kind = pool.submit(asyncio.run, asyncio.wait_for(ask(), SECONDS + 1.0)).result()
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = str(error) or type(error).__name__
        raise InputError(
            f"--dask {address}: no scheduler answers there ({reason}); start one, or correct the address."
        ) from None
    if kind != "Scheduler":
        raise InputError(
            f"--dask {address}: there is a {kind.lower()}, no scheduler; give the address of the scheduler."
        )


class _Look(NamedTuple):
    """What a worker says of itself. sees: whether a file is there."""

    version: str
    host: str
    sees: bool


def _look(file: str) -> _Look:
    """On a worker."""
    return _Look(own_version(), platform.node(), Path(file).exists())


def _check_version(mine: str, wanted: str, worker: str) -> None:
    """InputError unless a worker has the wanted version."""
    if mine != wanted:
        raise InputError(
            f"--dask: the worker {worker} has shapespace {mine}, not {wanted}; install the same version there."
        )


def _compute(path: str, tile: Tile, wanted: str, files: Sequence[tuple[str, str]]) -> Any:
    """A tile, on a worker, which may have come after the others."""
    host = platform.node()
    _check_version(own_version(), wanted, host)
    receive_files(files)
    if not Path(path).is_dir():
        raise InputError(f"--dask: a worker on {host} does not see {path}; all must share it under the same path.")
    return compute_tile(path, tile)
