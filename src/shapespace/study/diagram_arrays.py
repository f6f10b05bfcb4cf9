"""The Zarr arrays of a diagram as files: there whole or not at all, written tile by tile, and looked at for damage."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import zarr
from numpy.typing import NDArray
from zarr.codecs import ZstdCodec
from zarr.core.buffer import Buffer
from zarr.storage import MemoryStore

from shapespace.base.errors import InputError, StoreError
from shapespace.study.files import storage, sync_files, write_atomically
from shapespace.study.grid import Tile

ROOT = "zarr.json"
"""Where this is there is a whole Zarr store."""
TOGETHER = {"codec_pipeline.batch_size": 64}
"""Chunks that are decoded in one go: half the time of one by one."""
DAMAGE = (RuntimeError, ValueError)
"""What decoding bytes that are not those of a chunk raises."""


class Variable(NamedTuple):
    """An array of a diagram before anything is computed. chunks: of a tile. values: of a coordinate."""

    name: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: str
    fill: Any
    attributes: Mapping[str, Any]
    values: NDArray[Any] | None = None


def make_arrays(path: Path, variables: Sequence[Variable], attributes: Mapping[str, Any]) -> None:
    """Write arrays without chunks; what makes the directory a Zarr store, with a description of all of them, comes last."""
    files: dict[str, Buffer] = {}
    root = zarr.open_group(MemoryStore(files), mode="w", zarr_format=3, attributes=dict(attributes))
    for one in variables:
        array = root.create_array(
            one.name,
            shape=one.shape,
            chunks=one.chunks,
            dtype=one.dtype,
            fill_value=one.fill,
            dimension_names=one.dims,
            attributes=dict(one.attributes),
            compressors=ZstdCodec(level=0, checksum=True),
        )
        if one.values is not None:
            array[...] = one.values
    with warnings.catch_warnings():
        # One read instead of one for each array; readers of the plain format pass over it.
        warnings.simplefilter("ignore", zarr.errors.ZarrUserWarning)
        zarr.consolidate_metadata(root.store)
    for name in sorted(files, key=lambda name: name == ROOT):
        file = path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(file, files[name].to_bytes())


def open_arrays(path: Path, mode: Any = "r") -> dict[str, Any]:
    """The arrays by name. StoreError where there are none, as of a diagram that was killed before it began."""
    with storage(path):
        if not (path / ROOT).exists():
            raise StoreError(f"{path / ROOT}: is missing; resume the diagram with --resume to write it.")
        try:
            with zarr.config.set(TOGETHER):
                return dict(zarr.open_group(path, mode=mode).arrays())
        except (*DAMAGE, KeyError) as error:
            raise StoreError(
                f"{path / ROOT}: is damaged ({error}); resume the diagram with --resume to write it anew."
            ) from None


def are_whole(path: Path) -> bool:
    """Whether the arrays are there with all that does not belong to a tile."""
    try:
        for array in open_arrays(path).values():
            if array.ndim < 2:
                array[...]
    except DAMAGE:
        return False
    return True


def write_chunks(path: Path, tile: Tile, values: Mapping[str, NDArray[Any]], last: str) -> None:
    """Write the chunks of a tile, (n_y, n_x) or (states, n_y, n_x) by name; the last one when the others are on the disk."""
    arrays = open_arrays(path, "r+")
    for names in ([name for name in values if name != last], [last]):
        for name in names:
            arrays[name].set_block_selection(_block(arrays[name], tile), values[name])
        sync_files(chunk_file(path, arrays[name], tile) for name in names)


def chunk_file(path: Path, array: Any, tile: Tile) -> Path:
    """The file of an array's chunk; one that holds nothing but fill has none."""
    key: str = array.metadata.encode_chunk_key(_block(array, tile))
    return path / str(array.basename) / key


def _block(array: Any, tile: Tile) -> tuple[int, ...]:
    return (*(0,) * (array.ndim - 2), tile[1], tile[0])


def damaged_chunks(path: Path, tiles: Sequence[Tile]) -> Iterator[tuple[Tile, Path]]:
    """Chunks of tiles that cannot be read: tile and file."""
    for array in open_arrays(path).values():
        if array.ndim >= 2:
            yield from ((tile, chunk_file(path, array, tile)) for tile in damaged_tiles(path, array, tiles))


def damaged_tiles(path: Path, array: Any, tiles: Sequence[Tile]) -> dict[Tile, str]:
    """Which tiles of an array cannot be read, and what is wrong with them in a line."""
    try:
        array[...]
        return {}
    except DAMAGE:
        damage = {}
    for tile in tiles:
        try:
            array.get_block_selection(_block(array, tile))
        except DAMAGE as error:
            damage[tile] = (
                f"{chunk_file(path, array, tile)}: numbers of tile {tile[0]}, {tile[1]} are damaged ({error}); resume the "
                "diagram with --resume to compute them again."
            )
    return damage


@contextmanager
def reading(path: Path, tiles: Sequence[Tile]) -> Iterator[None]:
    """Say in a line which part of the arrays is damaged."""
    with storage(path):
        try:
            yield
        except InputError:
            raise
        except DAMAGE as error:
            arrays = (array for array in open_arrays(path).values() if array.ndim >= 2)
            lines = (line for array in arrays for line in damaged_tiles(path, array, tiles).values())
            told = next(lines, f"{path}: numbers in it are damaged ({error}); resume the diagram with --resume.")
            raise StoreError(told) from None
