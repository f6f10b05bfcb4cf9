"""Diagrams for the page: one map at a time, the numbers at a point, and its shape, which is computed again."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shapespace.app.encoding import codes, exact, finite
from shapespace.app.source import AbstractSource, described
from shapespace.app.tables import readable
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.curve_store import Curve, CurveStore, collected, outline
from shapespace.study.diagram_numbers import DiagramNumbers
from shapespace.study.diagram_store import ABOUT_SOLUTION, CODES, CURVES, OUTCOME, REGIME, UNSTABLE, DiagramStore
from shapespace.study.frame import Array, Frame
from shapespace.study.manifests import holds_store
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
        self._numbers: DiagramNumbers | None = None
        self._damage: dict[str, list[str]] = {}

    def forget(self) -> None:
        super().forget()
        self._states = self._numbers = None
        self._damage = {}

    @property
    def over(self) -> str:
        return f" over {' and '.join(self.store().request.grid.keys)}"

    def damage(self) -> list[str]:
        # A copy, as what reads in the background adds to it.
        return [one for part in [*self._damage.values()] for one in part]

    def _whole(self, name: str) -> Array:
        """One array on all points (state, y, x), the fill value where it is damaged."""
        values, self._damage[name] = self.numbers().readable(name)
        return values

    def store(self) -> DiagramStore:
        store = super().store()
        assert isinstance(store, DiagramStore)
        return store

    def content(self) -> dict[str, Any]:
        store = self.store()
        request, scenario = store.request, store.scenario
        numbers = self.numbers()
        names = [name for name in numbers.names if name not in (OUTCOME, *ABOUT_SOLUTION)]
        outcomes = self._whole(OUTCOME)
        found = outcomes == IS_STATE

        def change(name: str) -> float:
            values = self._whole(name)[found] if name in names else np.zeros(1)
            values = values[np.isfinite(values)]
            return float(np.ptp(values)) if values.size else 0.0

        return {
            "map": {
                "x": {"key": request.grid.x.key, "values": exact(request.grid.x.values)},
                "y": {"key": request.grid.y.key, "values": exact(request.grid.y.values)},
                "states": list(request.labels),
                "names": names,
                "strides": self._strides(),
                "of": most_telling(scenario, change),
                "outcomes": codes(outcomes),
                "boundaries": [_boundary(curve) for curve in self._boundaries()],
                "meanings": {str(code): [str(outcome), outcome.advice] for outcome, code in CODES.items()},
            }
        }

    def _boundaries(self) -> Iterator[Curve]:
        """As far as they can be read."""
        for path in sorted(path for path in (self.path / CURVES).glob("*") if holds_store(path)):
            try:
                store = CurveStore.open_damaged(path)
            except StoreError as error:
                self._damage[path.name] = [str(error)]
                continue
            points, self._damage[path.name] = readable(store)
            first, second = store.request["keys"]
            if points:
                yield collected(store.scenario, (first, second), [*points.values()], store.outcome, path)

    def values(self, name: str) -> dict[str, Any]:
        """One observable on all points (state, y, x), NaN where there is no state, and what of it is damaged."""
        numbers = self.numbers()
        if name not in numbers.names:
            raise InputError(f"{name[:60]}: is no observable of this diagram.")
        if name == REGIME:
            return self._regimes()
        values = np.where(self._whole(OUTCOME) == IS_STATE, self._whole(name), np.nan)
        return {"name": name, "values": exact(values), "damage": self._damage[name]}

    def _regimes(self) -> dict[str, Any]:
        """What each state is like, in the aspects that differ somewhere; kinds: what numbers mean, in words and as a colour."""
        # Imported late: it brings the library of pictures.
        from shapespace.view.style import GREY, REGIMES

        codes = np.where(self._whole(OUTCOME) == IS_STATE, self._whole(REGIME), 0)
        aspects = int(telling_aspects([*map(int, np.unique(codes[codes > 0]))]))
        kinds = [int(code) for code in np.unique(codes & aspects) if code]
        colours = [one for one in REGIMES if one != GREY]
        about = [[code, describe(code), colours[i % len(colours)]] for i, code in enumerate(kinds)]
        values = np.where(codes > 0, codes & aspects, np.nan)
        return {"name": REGIME, "values": exact(values), "damage": self._damage[REGIME], "kinds": about}

    def state(self, place: str) -> dict[str, Any]:
        request = self.store().request
        number, i, j = request.place(place)
        keys = request.grid.keys
        x, y = request.grid.values(i, j).ravel().tolist()
        there = self.numbers().at(number, i, j)
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
        return (f"{s},{i * x},{j * y}" for s, y, x in np.ndindex(self._whole(OUTCOME)[:, ::j, ::i].shape))

    def _places_with_shape(self) -> list[str]:
        i, j = self._strides()
        return [f"{s},{i * x},{j * y}" for s, y, x in np.argwhere(self._whole(OUTCOME)[:, ::j, ::i] == IS_STATE)]

    def questions(self) -> Iterator[tuple[str, dict[str, str]]]:
        store = self.store()
        points = len(store.request.labels) * int(np.prod(store.request.grid.shape))
        if points > MOST_POINTS:
            raise InputError(f"{self.path}: its {points} points are too many for one file, at most {MOST_POINTS}.")
        for name in self.numbers().names:
            yield "values", {"name": name}
        has_shape = {*self._places_with_shape()}
        for place in self.places():
            yield "state", {"place": place}
            if place not in has_shape:
                continue
            try:
                self.states().state(self.store().request.place(place))
            except StoreError:
                # Not found again: the page says that it is not in the file.
                continue
            yield "shape", {"place": place}

    def warm(self) -> None:
        """And all numbers, as those of one point are some tens of small files."""
        for place in self._places_with_shape()[:1]:
            self.shape(place)
        if self.store().outcome is not None:
            for name in self.numbers().names:
                self._whole(name)

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

        store = self.store()
        request = store.request
        number, i, j = request.place(place)
        with self.computing:
            found = self.states().state((number, i, j))
            at, frame = found.scenario, found.frame
            fields = profile_of(at, frame)
        values = request.grid.values(i, j).ravel().tolist()
        return described(
            at,
            frame,
            fields,
            store,
            f"{self.path.resolve()}:{place}",
            vary=request.grid.x.key,
            stop=request.grid.x.stop,
            changes=dict(zip(request.grid.keys, values, strict=True)),
            place=place,
            title=request.labels[number],
            can_compute=True,
        )

    def modes(self, place: str) -> "Modes | None":
        return None

    def resting(self, place: str) -> tuple[Scenario, Frame]:
        found = self.states().state(self.store().request.place(place))
        return found.scenario, found.frame

    def states(self) -> "DiagramStates":
        """What computes shapes again; from the numbers as they are now, where the diagram is still being computed."""
        if self.store().outcome is None or self._states is None:
            # Imported late, as solvers take seconds to load.
            from shapespace.study.diagram_state import DiagramStates

            self._states = DiagramStates(self.store(), self.numbers())
        return self._states

    def numbers(self) -> DiagramNumbers:
        """What is stored at its points, as it is now."""
        self.store()
        if self._numbers is None:
            self._numbers = DiagramNumbers(self.store())
        return self._numbers


def _boundary(curve: Curve) -> dict[str, Any]:
    """A curve in the plane of the map, with its named points; its keys come in the order of the map's axes."""
    x, y = outline(curve.points)
    named = [one for one in curve.special_points if one.kind not in ("end", "user", *Outcome)]
    return {
        "of": curve.of,
        "keys": curve.keys,
        "x": exact(x),
        "y": exact(y),
        "labels": [[one.label, one.kind, *one.parameters.tolist()] for one in named],
    }
