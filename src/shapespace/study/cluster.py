"""Tiles computed by the workers of a Dask cluster, wherever its scheduler is; they must see the directory of the store."""

import platform
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from shapespace.base.errors import InputError, WorkerError
from shapespace.study.grid import Tile
from shapespace.study.tiles import Done, compute_tile
from shapespace.study.versions import own_versions

SECONDS = 10.0
"""To wait for a scheduler's answer."""
RETRIES = 2
"""Of a tile that fails for a reason outside of it, as a node that runs out of memory."""


class Cluster:
    """The cluster of a scheduler's address, e.g. tcp://host:8786.

    InputError where none answers, and where a worker that is there has another version of this package or none.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError(
                f"--dask {address}: needs the package distributed; install shapespace with its extra `cluster`."
            ) from None
        try:
            self._client = Client(address, timeout=SECONDS, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error) or type(error).__name__
            raise InputError(
                f"--dask {address}: no scheduler answers there ({reason}); start one, or correct the address."
            ) from None
        try:
            for worker, mine in self._client.run(_version, on_error="return").items():
                _check_version(mine, own_versions()["shapespace"], worker)
        except BaseException:
            self._client.close()
            raise

    def map(self, path: Path, tiles: Sequence[Tile]) -> Iterator[Done]:
        """Compute tiles of a stored diagram, in whatever order they are finished.

        InputError as a worker met it, another version of this package there among them; WorkerError where workers or the
        scheduler are lost.
        """
        from distributed import KilledWorker, as_completed
        from distributed.client import FutureCancelledError

        paths, versions = [str(path.resolve())] * len(tiles), [own_versions()["shapespace"]] * len(tiles)
        futures = self._client.map(_compute, paths, tiles, versions, pure=False, retries=RETRIES)
        try:
            for future in as_completed(futures, loop=self._client.loop):
                yield future.result()
        except (KilledWorker, FutureCancelledError, OSError) as error:
            raise WorkerError(
                f"{path}: the cluster lost workers or its scheduler ({type(error).__name__}); nothing finished is lost: resume."
            ) from error
        finally:
            self._client.cancel(futures)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()


def _version() -> str:
    """Of this package, on a worker."""
    return own_versions()["shapespace"]


def _check_version(mine: str | BaseException, wanted: str, worker: str) -> None:
    """InputError unless a worker has the wanted version."""
    if mine != wanted:
        has = f"shapespace {mine}" if isinstance(mine, str) else f"no shapespace ({mine})"
        raise InputError(f"--dask: the worker {worker} has {has}, not {wanted}; install the same version there.")


def _compute(path: str, tile: Tile, wanted: str) -> Any:
    """A tile, on a worker, which may have come after the others."""
    _check_version(_version(), wanted, platform.node())
    return compute_tile(path, tile)
