"""One accepted time step: all that is needed to look at it and to go on from it."""

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ARRAYS = ("mesh", "nodes", "slopes", "algebraic", "scalars", "rates")

# What only pictures need; everything that a resumed run starts from keeps its digits.
_PRECISION = {"rates": np.float32}

# What reading bytes that are not those of a frame may raise.
DAMAGE = (zipfile.BadZipFile, ValueError, KeyError, EOFError, OSError, RuntimeError, struct.error, zlib.error)


@dataclass(frozen=True, eq=False)
class Frame:
    """The state after a time step. Arrays are dimensionless; times and observables are in the scenario's units.

    Shapes, for N elements of k Gauss points with n differential and na algebraic fields and ns scalars: mesh (N+1,),
    nodes (N+1, n), slopes (N, k, n), algebraic (N, k, na), scalars (ns,), rates (N, k, 2): dr/dt and dz/dt at fixed u,
    for pictures, kept in single precision.
    `step` is the step that led here (0 for the initial state), `next_step` the one to try next. An observable that does
    not apply is absent, never NaN.
    """

    time: float
    step: float
    next_step: float
    mesh: Array
    nodes: Array
    slopes: Array
    algebraic: Array
    scalars: Array
    rates: Array
    observables: dict[str, float] = field(default_factory=dict)


def encode_frame(frame: Frame) -> bytes:
    """The bytes of a frame's file, a zip archive of arrays with the CRC of each."""
    return write_arrays(arrays_of(frame))


def decode_frame(data: bytes) -> Frame:
    """The frame in the bytes of a file; one of DAMAGE where the bytes are not what was written."""
    return frame_of_arrays(read_arrays(data))


def write_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """A zip archive of arrays with the CRC of each."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def read_arrays(data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays in the bytes of an archive; one of DAMAGE where they are not what was written."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        # Reading a member whole checks its CRC before anything in it is believed.
        members = {name: io.BytesIO(archive.read(name)) for name in archive.namelist()}
    return {name.removesuffix(".npy"): np.lib.format.read_array(member) for name, member in members.items()}


class Layout(NamedTuple):
    """How a record that holds a frame and more is stored: the name of its block of numbers, and the names of its parts."""

    block: str
    numbers: tuple[str, ...]
    arrays: tuple[str, ...]
    words: tuple[str, ...]

    def encode(self, record: Any) -> bytes:
        """The bytes of a record's file: the arrays of its frame, and its own."""
        words = json.dumps({name: getattr(record, name) for name in self.words})
        return write_arrays(
            {
                **arrays_of(record.frame),
                self.block: np.array([getattr(record, name) for name in self.numbers], dtype=np.float64),
                **{name: getattr(record, name) for name in self.arrays},
                "about": np.frombuffer(words.encode(), dtype=np.uint8),
            }
        )

    def decode(self, data: bytes) -> dict[str, Any]:
        """The parts of a record by name; one of DAMAGE where the bytes are not what was written."""
        stored = read_arrays(data)
        about = json.loads(stored["about"].tobytes())
        values: dict[str, Any] = dict(zip(self.numbers, stored[self.block].tolist(), strict=True))
        values |= {name: stored[name] for name in self.arrays} | {name: about[name] for name in self.words}
        return values | {"frame": frame_of_arrays(stored)}


def arrays_of(frame: Frame) -> dict[str, NDArray[Any]]:
    """What is stored of a frame, by name."""
    arrays = {name: np.asarray(getattr(frame, name), dtype=_PRECISION.get(name, np.float64)) for name in _ARRAYS}
    return {
        "clock": np.array([frame.time, frame.step, frame.next_step], dtype=np.float64),
        "observable_names": np.array(list(frame.observables), dtype="S"),
        "observable_values": np.array(list(frame.observables.values()), dtype=np.float64),
        **arrays,
    }


def frame_of_arrays(stored: Mapping[str, NDArray[Any]]) -> Frame:
    """The frame that these arrays describe, among others."""
    arrays: dict[str, Array] = {name: stored[name] for name in _ARRAYS}
    time, step, next_step = map(float, stored["clock"])
    names = [name.decode() for name in stored["observable_names"].tolist()]
    values = stored["observable_values"].tolist()
    return Frame(time, step, next_step, **arrays, observables=dict(zip(names, values, strict=True)))
