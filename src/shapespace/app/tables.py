"""Records of a store as rows of a table, for the page."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from shapespace.app.encoding import exact
from shapespace.base.errors import StoreError
from shapespace.study.frame import Array
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import Scenario
from shapespace.study.telling import most_telling

R = TypeVar("R")


def readable(store: AbstractRecordStore[R]) -> tuple[dict[int, R], list[str]]:
    """The records of a store by number, and of each that is damaged or missing what is wrong."""
    whole, damage = {}, []
    for number in range(len(store)):
        try:
            whole[number] = store.read(number)
        except StoreError as error:
            damage.append(str(error))
    return whole, damage


def table(
    columns: dict[str, Any], x: str, y: str, places: Sequence[int], *, line: bool = True, **more: Any
) -> dict[str, Any]:
    """States as rows: numbers by name, what to draw first, the place of each, and what is known of each besides."""
    packed = {name: exact(values) for name, values in columns.items()}
    return {"table": {"columns": packed, "x": x, "y": y, "places": [str(one) for one in places], "line": line, **more}}


def columns_of(rows: Sequence[dict[str, float]]) -> dict[str, Array]:
    """Columns of rows, NaN where a row has no such number."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def telling(at: Scenario, columns: dict[str, Array], known: Sequence[str]) -> str:
    """The number to draw first: the first of those that tell states apart that changes."""

    def change(name: str) -> float:
        values = columns.get(name, np.zeros(1))
        values = values[np.isfinite(values)]
        return float(np.ptp(values)) if values.size else 0.0

    name = most_telling(at, change, known)
    return name if name in columns else next(iter(name for name in columns if name not in known), known[0])
