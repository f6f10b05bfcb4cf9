"""Diagrams for the page: one map at a time, the numbers at a point, and its shape, which is computed again."""

import asyncio
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr

from shapespace.app.encoding import codes, exact, finite
from shapespace.app.source import AbstractSource, described
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.curve_store import Curve, outline
from shapespace.study.diagram_store import ABOUT_SOLUTION, CODES, OUTCOME, REGIME, UNSTABLE, Diagram, DiagramStore
from shapespace.study.files import storage
from shapespace.study.frame import Array, Frame
from shapespace.study.regimes import describe, telling_aspects
from shapespace.study.scenario import Scenario
from shapespace.study.telling import most_telling

if TYPE_CHECKING:
    from shapespace.study.diagram_state import DiagramStates
    from shapespace.study.modes import Modes

MOST_SHAPES, MOST_POINTS = 400, 40_000
"""In one file: shapes of each diagram, which are computed for it, and points with their numbers."""
IS_STATE = CODES[Outcome.CONVERGED]


class DiagramSource(AbstractSource):
    """A diagram. The place of a state is STATE,I,J: the number of the state, and those of the values along x and y."""

    noun = "diagram"

    kind = DiagramStore

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._states: DiagramStates | None = None
        self._arrays: dict[str, Any] | None = None
        self._read: dict[str, Array] = {}

    def forget(self) -> None:
        super().forget()
        self._states = self._arrays = None
        self._read = {}

    def store(self) -> DiagramStore:
        store = super().store()
        assert isinstance(store, DiagramStore)
        return store

    def content(self) -> dict[str, Any]:
        store = self.store()
        request, scenario = store.request, store.scenario
        names = [name for name in self.arrays() if name not in (OUTCOME, *ABOUT_SOLUTION)]
        outcomes = self._values(OUTCOME)
        found = outcomes == IS_STATE

        def change(name: str) -> float:
            values = self._values(name)[found] if name in names else np.zeros(1)
            values = values[np.isfinite(values)]
            return float(np.ptp(values)) if values.size else 0.0

        return {
            "map": {
                "x": {"key": request.grid.x.key, "values": exact(request.grid.x.values)},
                "y": {"key": request.grid.y.key, "values": exact(request.grid.y.values)},
                "states": list(request.labels),
                "names": names,
                "strides": self._strides(),
                "of": most_telling(scenario.kind, change),
                "outcomes": codes(outcomes),
                "boundaries": [_boundary(curve) for curve in Diagram(scenario, request, self.path).boundaries],
                "meanings": {str(code): [str(outcome), outcome.advice] for outcome, code in CODES.items()},
            }
        }

    def values(self, name: str) -> dict[str, Any]:
        """One observable on all points (state, y, x), NaN where there is no state."""
        if name not in self.arrays():
            raise InputError(f"{name[:60]}: is no observable of this diagram.")
        if name == REGIME:
            return self._regimes()
        values = np.where(self._values(OUTCOME) == IS_STATE, self._values(name), np.nan)
        return {"name": name, "values": exact(values)}

    def _regimes(self) -> dict[str, Any]:
        """What each state is like, in the aspects that differ somewhere; kinds: what numbers mean, in words and as a colour."""
        # Imported late: it brings the library of pictures.
        from shapespace.view.style import GREY, REGIMES

        codes = np.where(self._values(OUTCOME) == IS_STATE, self._values(REGIME), 0)
        aspects = int(telling_aspects([*map(int, np.unique(codes[codes > 0]))]))
        kinds = [int(code) for code in np.unique(codes & aspects) if code]
        colours = [one for one in REGIMES if one != GREY]
        about = [[code, describe(code), colours[i % len(colours)]] for i, code in enumerate(kinds)]
        return {"name": REGIME, "values": exact(np.where(codes > 0, codes & aspects, np.nan)), "kinds": about}

    def state(self, place: str) -> dict[str, Any]:
        number, i, j = self._place(place)
        store = self.store()
        request = store.request
        keys = request.grid.keys
        x, y = request.grid.values(i, j).ravel().tolist()
        there = self._numbers_at(number, i, j)
        code = int(there.pop(OUTCOME))
        reason = next((outcome for outcome, known in CODES.items() if known == code), None)
        unstable = there.pop(UNSTABLE, np.nan)
        return {
            "place": place,
            "title": request.labels[number],
            "parameters": dict(zip(keys, (x, y), strict=True)),
            "observables": finite(
                {name: value for name, value in there.items() if name not in (REGIME, *ABOUT_SOLUTION)}
            ),
            "unstable": int(unstable) if np.isfinite(unstable) else None,
            "missing": None if code == IS_STATE else [reason or "not-computed", reason.advice if reason else ""],
        }

    def places(self) -> Iterator[str]:
        i, j = self._strides()
        outcomes = self._values(OUTCOME)[:, ::j, ::i]
        return (f"{s},{i * x},{j * y}" for s, y, x in np.argwhere(outcomes == IS_STATE))

    def questions(self) -> Iterator[tuple[str, dict[str, str]]]:
        store = self.store()
        points = len(store.request.labels) * int(np.prod(store.request.grid.shape))
        if points > MOST_POINTS:
            raise InputError(f"{self.path}: its {points} points are too many for one file, at most {MOST_POINTS}.")
        for name in self.arrays():
            yield "values", {"name": name}
        for place in self.places():
            yield "state", {"place": place}
            try:
                self.states().state(self._place(place))
            except StoreError:
                # Not found again: the page says that it is not in the file.
                continue
            yield "shape", {"place": place}

    def warm(self) -> None:
        self.shape(next(self.places()))

    def _strides(self) -> tuple[int, int]:
        """Every how many points along x and y a file has a shape."""
        store = self.store()
        wanted = math.sqrt(MOST_SHAPES / len(store.request.labels))
        i, j = (math.ceil(count / wanted) for count in store.request.grid.shape)
        return i, j

    def shape(self, place: str) -> dict[str, Any]:
        """Everything about a state that must be computed again: its profiles, and how to go on from it."""
        # Imported late, as below: most stores are opened without a solver.
        from shapespace.study.dataset import profile_of

        with self.computing:
            found = self.states().state(self._place(place))
            at, frame = found.scenario, found.frame
            fields = profile_of(at, frame)
        request = self.store().request
        return described(
            at,
            frame,
            fields,
            f"{self.path.resolve()}:{self.states().origin(self._place(place))}",
            vary=request.grid.x.key,
            stop=request.grid.x.stop,
            exactly=True,
            place=place,
            title=request.labels[self._place(place)[0]],
            can_compute=True,
        )

    def modes(self, place: str) -> "Modes | None":
        return None

    def resting(self, place: str) -> tuple[Scenario, Frame]:
        found = self.states().state(self._place(place))
        return found.scenario, found.frame

    def states(self) -> "DiagramStates":
        """What computes shapes again; from the numbers as they are now, where the diagram is still being computed."""
        if self.store().outcome is None or self._states is None:
            # Imported late, as solvers take seconds to load.
            from shapespace.study.diagram_state import DiagramStates

            self._states = DiagramStates(self.path)
        return self._states

    def _place(self, text: str) -> tuple[int, int, int]:
        store = self.store()
        parts = text.split(",")
        limits = (len(store.request.labels), *store.request.grid.shape)
        if len(parts) != 3 or not all(part.isdecimal() for part in parts):
            raise InputError(f"{text[:20]!r}: is no point of this diagram; give STATE,I,J.")
        state, i, j = map(int, parts)
        if not (state < limits[0] and i < limits[1] and j < limits[2]):
            raise InputError(f"{text[:40]}: is no point of this diagram, which has {' by '.join(map(str, limits))}.")
        return state, i, j

    def arrays(self) -> dict[str, Any]:
        """What is stored at each point (y, x) or (state, y, x), to read part by part; observables in the glossary's order."""
        self.store()
        if self._arrays is None:
            with storage(self.path):
                try:
                    group: Any = zarr.open_group(self.path, mode="r")
                    found = {name: array for name, array in group.arrays() if array.ndim >= 2}
                except (ValueError, KeyError, FileNotFoundError) as error:
                    raise StoreError(f"{self.path / 'zarr.json'}: is damaged or missing ({error}).") from None
            known = {name: place for place, name in enumerate(QUANTITIES)}
            names = sorted(found, key=lambda name: (known.get(name, len(known)), name))
            self._arrays = {name: found[name] for name in names}
        return self._arrays

    def _values(self, name: str) -> Array:
        """An array (state, y, x)."""
        arrays = self.arrays()
        if name in self._read:
            return self._read[name]
        values = np.asarray(arrays[name][...])
        values = values.reshape(-1, *values.shape[-2:])
        if self.store().outcome is not None:
            # Of a diagram that is still being computed it would grow old.
            self._read[name] = values
        return values

    def _numbers_at(self, number: int, i: int, j: int) -> dict[str, float]:
        """All arrays at a point, of which only the parts that hold it are read, all at once."""
        arrays = self.arrays()
        there = {name: float(values[min(number, len(values) - 1), j, i]) for name, values in self._read.items()}
        missing = [name for name in arrays if name not in there]
        numbers = _numbers([arrays[name] for name in missing], [(number, j, i), (j, i)])
        there |= zip(missing, numbers, strict=True)
        return {name: there[name] for name in arrays}


def _numbers(arrays: Sequence[Any], places: Sequence[tuple[int, ...]]) -> list[float]:
    """What each array has at that place which has as many indices as it has dimensions."""
    at = {len(place): place for place in places}

    async def read() -> list[Any]:
        return await asyncio.gather(*(array.async_array.getitem(at[array.ndim]) for array in arrays))

    # In a thread of its own, since a notebook has a loop of events in this one.
    with ThreadPoolExecutor(1) as pool:
        return [float(one) for one in pool.submit(asyncio.run, read()).result()]


def _boundary(curve: Curve) -> dict[str, Any]:
    """A curve in the plane of the map, with its named points; its keys come in the order of the map's axes."""
    x, y = outline(curve.points)
    named = [one for one in curve.special_points if one.kind not in ("end", "user", *Outcome)]
    return {
        "of": curve.of,
        "keys": curve.keys,
        "x": exact(x),
        "y": exact(y),
        "labels": [[one.label, *one.parameters.tolist()] for one in named],
    }
