"""Arrays and numbers as JSON takes them: arrays as base64 of little-endian floats, which keeps digits and NaN."""

import base64
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def exact(values: ArrayLike) -> dict[str, str]:
    """An array in double precision, as `{"f8": base64}`."""
    return {"f8": _base64(np.asarray(values, dtype="<f8"))}


def drawn(values: ArrayLike) -> dict[str, str]:
    """An array that is only looked at, in single precision, as `{"f4": base64}`."""
    return {"f4": _base64(np.asarray(values, dtype="<f4"))}


def codes(values: ArrayLike) -> dict[str, str]:
    """An array of small whole numbers, as `{"i1": base64}`."""
    return {"i1": _base64(np.asarray(values, dtype="<i1"))}


def number(value: float | None) -> float | None:
    """A number, None where it is none."""
    return None if value is None or not math.isfinite(value) else float(value)


def finite(values: Mapping[str, Any]) -> dict[str, float]:
    """Those of the values that are numbers."""
    return {name: float(value) for name, value in values.items() if math.isfinite(value)}


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def as_json(value: Any) -> bytes:
    """JSON; a number that is none is a mistake here."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
