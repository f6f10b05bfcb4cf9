"""Tiles computed by the workers of a Dask cluster, wherever its scheduler is; they must see the directory of the store."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from shapespace.base.errors import InputError, WorkerError
from shapespace.study.records import own_versions
from shapespace.study.tiles import Done, Tile, compute_tile

SECONDS = 10.0
"""To wait for a scheduler's answer."""
RETRIES = 2
"""Of a tile that fails for a reason outside of it, as a node that runs out of memory."""


class Cluster:
    """The cluster of a scheduler's address, e.g. tcp://host:8786. InputError where none answers."""

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


def _compute(path: str, tile: Tile, wanted: str) -> Any:
    """A tile, on a worker."""
    if (mine := own_versions()["shapespace"]) != wanted:
        raise InputError(f"--dask: a worker has shapespace {mine}, not {wanted}; install the same version there.")
    return compute_tile(path, tile)
