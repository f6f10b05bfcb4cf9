"""States that a diagram keeps whole: those that its tiles start from, and some of each tile, near which the others are."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapespace.base.outcome import Outcome
from shapespace.study.frame import Array, read_arrays, write_arrays


@dataclass(frozen=True, eq=False)
class Anchors:
    """What a state is in the middle of the tiles, tile after tile.

    outcomes (m,): how it was found; meshes, xs: of those that were, else empty. All dimensionless.
    """

    state: str
    outcomes: tuple[Outcome, ...]
    meshes: tuple[Array, ...]
    xs: tuple[Array, ...]


class Shape(NamedTuple):
    """A state of a tile. place: of its point in the grid. number: of the state there, -1 where it is none of those stored.

    sheet: of states that change into each other from point to point of the tile; of named states that of the name. mesh, x:
    dimensionless, in single precision where read from a file: a Newton iteration makes up for it.
    """

    sheet: int
    number: int
    place: tuple[int, int]
    mesh: Array
    x: Array


def encode_anchors(anchors: Anchors) -> bytes:
    """The bytes of a file."""
    words = json.dumps({"state": anchors.state, "outcomes": anchors.outcomes})
    about = np.frombuffer(words.encode(), dtype=np.uint8)
    return write_arrays({**_joined(anchors.meshes, anchors.xs), "about": about})


def decode_anchors(data: bytes) -> Anchors:
    """The anchors in the bytes of a file; one of `frame.DAMAGE` where they are not what was written."""
    stored = read_arrays(data)
    about = json.loads(stored["about"].tobytes())
    return Anchors(about["state"], tuple(Outcome(one) for one in about["outcomes"]), *_split(stored))


def encode_shapes(shapes: Sequence[Shape]) -> bytes:
    """The bytes of a file."""
    places = np.array([(one.sheet, one.number, *one.place) for one in shapes], np.int64).reshape(-1, 4)
    joined = _joined([one.mesh for one in shapes], [one.x for one in shapes])
    return write_arrays({**joined, "xs": joined["xs"].astype(np.float32), "places": places})


def decode_shapes(data: bytes) -> tuple[Shape, ...]:
    """The states in the bytes of a file; one of `frame.DAMAGE` where they are not what was written."""
    stored = read_arrays(data)
    meshes, xs = _split({**stored, "xs": stored["xs"].astype(np.float64)})
    places = stored["places"].tolist()
    return tuple(
        Shape(sheet, number, (i, j), mesh, x) for (sheet, number, i, j), mesh, x in zip(places, meshes, xs, strict=True)
    )


def _joined(meshes: Sequence[Array], xs: Sequence[Array]) -> dict[str, NDArray[Any]]:
    """Arrays of various lengths as four."""
    empty = np.zeros(0)
    return {
        "mesh_sizes": np.array([len(one) for one in meshes], np.int64),
        "sizes": np.array([len(one) for one in xs], np.int64),
        "meshes": np.concatenate([empty, *meshes]),
        "xs": np.concatenate([empty, *xs]),
    }


def _split(stored: dict[str, NDArray[Any]]) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """What `_joined` joined."""
    meshes, xs = (
        tuple(np.split(stored[name], np.cumsum(stored[sizes])))[:-1]
        for name, sizes in (("meshes", "mesh_sizes"), ("xs", "sizes"))
    )
    return meshes, xs
