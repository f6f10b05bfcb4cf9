"""The numbers of a stored diagram, read part by part: of a map of many points all of them take long."""

import asyncio
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from shapespace.base.errors import StoreError
from shapespace.base.scales import QUANTITIES
from shapespace.study.diagram_arrays import damaged_tiles, open_arrays, reading
from shapespace.study.diagram_store import DiagramStore
from shapespace.study.frame import Array


class DiagramNumbers:
    """Arrays of a diagram by name, observables in the glossary's order. StoreError where they are damaged.

    Those that were read whole are kept if the diagram is finished, as otherwise they would grow old.
    """

    def __init__(self, store: DiagramStore) -> None:
        self._path, self._is_finished, self._grid = store.path, store.outcome is not None, store.request.grid
        found = {name: array for name, array in open_arrays(store.path).items() if array.ndim >= 2}
        known = {name: place for place, name in enumerate(QUANTITIES)}
        self.names = sorted(found, key=lambda name: (known.get(name, len(known)), name))
        self._arrays = {name: found[name] for name in self.names}
        self._read: dict[str, Array] = {}

    def whole(self, name: str) -> Array:
        """An array (states, n_y, n_x)."""
        if name in self._read:
            return self._read[name]
        with reading(self._path, self._grid.tiles):
            values = np.asarray(self._arrays[name][...])
        values = values.reshape(-1, *values.shape[-2:])
        if self._is_finished:
            self._read[name] = values
        return values

    def readable(self, name: str) -> tuple[Array, list[str]]:
        """As `whole`, tile by tile where that fails: the fill value in tiles that are damaged, and what is wrong with each."""
        try:
            return self.whole(name), []
        except StoreError:
            array = self._arrays[name]
        damage = damaged_tiles(self._path, array, self._grid.tiles)
        values = np.full(array.shape, array.fill_value, array.dtype)
        for tile in self._grid.tiles:
            if tile not in damage:
                x, y = self._grid.span(tile)
                values[..., y, x] = array[..., y, x]
        return values.reshape(-1, *values.shape[-2:]), [*damage.values()]

    def at(self, number: int, i: int, j: int, names: Iterable[str] = ()) -> dict[str, float]:
        """The numbers of a state at values i and j of x and y, all or some by name; what several states share stands for each."""
        names = list(names) or self.names
        there = {name: self._read[name] for name in names if name in self._read}
        known = {name: float(values[min(number, len(values) - 1), j, i]) for name, values in there.items()}
        missing = [name for name in names if name not in known]
        places = {2: (j, i), 3: (number, j, i)}

        async def read() -> list[Any]:
            arrays = (self._arrays[name] for name in missing)
            return await asyncio.gather(*(array.async_array.getitem(places[array.ndim]) for array in arrays))

        if missing:
            # In a thread of its own, since a notebook has a loop of events in this one.
            with reading(self._path, self._grid.tiles), ThreadPoolExecutor(1) as pool:
                known |= zip(missing, map(float, pool.submit(asyncio.run, read()).result()), strict=True)
        return {name: known[name] for name in names}
