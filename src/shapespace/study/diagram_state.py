"""The state at a point of a stored diagram, which holds numbers only: computed again from what is known nearby."""

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapespace.analysis.sheets import states_at
from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.analysis.sweeping import SWEEP_NEWTON, Sweep, polynomial_weights
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_numbers import DiagramNumbers
from shapespace.study.diagram_shapes import Shape
from shapespace.study.diagram_store import CODES, OUTCOME, DiagramStore
from shapespace.study.engine import frame_of
from shapespace.study.frame import Frame
from shapespace.study.grid import Tile
from shapespace.study.keyed import KeyedProblem
from shapespace.study.scenario import Scenario
from shapespace.study.tiles import Surveyor, sheets_again

KEPT = 64
"""States to go on from, and"""
KEPT_TILES = 8
"""tiles whose stored states are kept."""
NODES = 12
"""Known states around a point whose polynomial is the guess: mostly one or two Newton steps are then enough."""
SHORTEST = 1.0 / 16.0
"""Of the way from a known state that is worth a step, before the tile is computed again."""
_CHECKED = ("area", "length")
TELLING = 1e-6
"""States that differ by less in these, relative to them, are the same."""

Place = tuple[int, int, int]
"""Number of the state, and of the values along x and y."""


@dataclass(frozen=True)
class MapState:
    """A state of a diagram. scenario: with the values of both keys there."""

    scenario: Scenario
    found: Stationary
    observables: dict[str, float]

    @property
    def problem(self) -> KeyedProblem:
        """That it solves, whose parameters are the values of both keys."""
        assert isinstance(self.found.problem, KeyedProblem)
        return self.found.problem

    @cached_property
    def frame(self) -> Frame:
        """The state as a frame at time zero."""
        return frame_of(self.problem.base, self.found.x, self.observables)


class DiagramStates:
    """The states of a stored diagram, each checked against what is stored of it. numbers: of the store, where they are open."""

    def __init__(self, store: DiagramStore, numbers: DiagramNumbers | None = None) -> None:
        self._store, self._scenario, self._request = store, store.scenario, store.request
        self._numbers = numbers or DiagramNumbers(store)
        self._grid = self._request.grid
        self._surveyor = Surveyor(self._scenario, self._grid.keys, stability=False)
        self._known: OrderedDict[Place, MapState] = OrderedDict()
        self._tiles: OrderedDict[Tile, tuple[Shape, ...]] = OrderedDict()
        self._swept: tuple[Tile, int, list[Sweep]] | None = None

    def scenario_at(self, place: Place) -> Scenario:
        """The scenario with the values of both keys there."""
        keys = zip(self._grid.keys, self._grid.values(*place[1:]).ravel().tolist(), strict=True)
        return self._scenario.with_overrides(dict(keys))

    def state(self, place: Place) -> MapState:
        """The state at a point. InputError where the diagram has none, StoreError where it is not found again."""
        found = self.find(place)
        if found is not None:
            return found
        if self._numbers.at(*place, [OUTCOME])[OUTCOME] != CODES[Outcome.CONVERGED]:
            raise InputError(f"{self._store.path}: has no state at this point; choose another one.")
        raise StoreError(f"{self._store.path}: the state at this point was not found again; resume the diagram.")

    def find(self, place: Place) -> MapState | None:
        """The state at a point, None where the diagram has none or it is not found again."""
        if place not in self._known:
            again = self._again(place)
            if again is None:
                return None
            self._known[place] = again
        self._known.move_to_end(place)
        if len(self._known) > KEPT:
            self._known.popitem(last=False)
        return self._known[place]

    def _again(self, place: Place) -> MapState | None:
        """The state at a point, computed again and recognised by what is stored of it; None where there is none or it is not
        found.
        """
        stored = self._numbers.at(*place, (OUTCOME, *_CHECKED))
        if stored[OUTCOME] != CODES[Outcome.CONVERGED]:
            return None
        for found in self._tried(place):
            if found is not None and found.outcome.is_success:
                mine = self._surveyor.observables(found)
                if all(abs(mine[name] - stored[name]) <= TELLING * abs(mine[name]) for name in _CHECKED):
                    return MapState(self.scenario_at(place), found, mine)
        return None

    def _tried(self, place: Place) -> Iterator[Stationary | None]:
        """What may be the state at a point, the cheapest first."""
        sheets = self._sheets(place)
        yield from (self._interpolated(sheet, place) for sheet in sheets)
        known = [one for one in self._known if one[0] == place[0]]
        if known:
            near = min(known, key=lambda one: _distance(one[1:], place))
            yield self._stepped(self._known[near].found, place)
        yield from (self._stepped(self._state(sheet[0]), place) for sheet in sheets)
        yield from states_at(self._swept_again(place), self._in_tile(place))

    def _sheets(self, place: Place) -> list[list[Shape]]:
        """Known states from the nearest on, each list of one sheet of states, the likeliest list first."""
        tile = self._grid.tile_of(place[1:])
        shapes = [*self._shapes(tile)]
        if not self._request.branches:
            shapes += self._anchors[place[0]]
        sheets: dict[int, list[Shape]] = {}
        for one in shapes:
            sheets.setdefault(one.sheet, []).append(one)
        found = [_from_nearest(sheet, place) for sheet in sheets.values()]
        if not self._request.branches:
            return [sheet for sheet in found if sheet[0].sheet == place[0]]
        return sorted(found, key=lambda sheet: (sheet[0].number != place[0], _distance(sheet[0].place, place)))

    def _shapes(self, tile: Tile) -> tuple[Shape, ...]:
        if tile not in self._tiles:
            self._tiles[tile] = self._store.read_shapes(tile)
            if len(self._tiles) > KEPT_TILES:
                self._tiles.popitem(last=False)
        return self._tiles[tile]

    @cached_property
    def _anchors(self) -> list[list[Shape]]:
        """The states in the middle of tiles, by name."""
        return [
            [
                Shape(number, number, place, mesh, x)
                for place, mesh, x in zip(self._request.places, of.meshes, of.xs, strict=True)
                if len(x)
            ]
            for number, of in enumerate(self._store)
        ]

    def _state(self, shape: Shape) -> Stationary:
        return self._surveyor.state(shape.mesh, shape.x, self._grid.values(*shape.place).reshape(2))

    def _interpolated(self, nodes: Sequence[Shape], place: Place) -> Stationary | None:
        """From the polynomial through the states of a sheet around."""
        goal = self._grid.values(*place[1:]).reshape(2)
        nodes = nodes[:NODES] if _distance(nodes[0].place, place) else nodes[:1]
        steps = np.array([self._grid.x.step, self._grid.y.step])
        offsets = np.array([self._grid.values(*one.place).reshape(2) - goal for one in nodes]) / steps
        weights = polynomial_weights(offsets)
        problem = self._state(nodes[0]).problem
        xs: list[Array] = []
        for one in nodes:
            state = self._state(one)
            xs.append(state.problem.carried(state.x, problem))
        return solve_stationary(problem, weights @ np.array(xs), goal, SWEEP_NEWTON)

    def _stepped(self, start: Stationary, place: Place) -> Stationary | None:
        """By a few long steps from a known state; None where they lead elsewhere."""
        goal = self._grid.values(*place[1:]).reshape(2)
        if np.array_equal(start.p, goal):
            return solve_stationary(start.problem, start.x, goal, SWEEP_NEWTON)
        return step_to(start, goal, SWEEP_NEWTON, SHORTEST)

    def _swept_again(self, place: Place) -> list[Sweep]:
        """The whole tile, computed as it was; that of the last time is kept, for the points beside."""
        tile, number = self._grid.tile_of(place[1:]), 0 if self._request.branches else place[0]
        if self._swept is None or self._swept[:2] != (tile, number):
            self._swept = tile, number, sheets_again(self._store, number, tile)
        return self._swept[2]

    def _in_tile(self, place: Place) -> tuple[int, int]:
        x, y = self._grid.span(self._grid.tile_of(place[1:]))
        return place[1] - x.start, place[2] - y.start


def _from_nearest(shapes: Sequence[Shape], place: Place) -> list[Shape]:
    """States of a sheet in the order of their distance from a point, in units of the lattice that they are on."""
    places = np.array([one.place for one in shapes])
    spacing = [max(np.ptp(line), 1) / max(len(np.unique(line)) - 1, 1) for line in places.T]
    offsets = np.abs(places - place[1:]) / spacing
    order = np.lexsort((offsets.sum(axis=1), offsets.max(axis=1)))
    return [shapes[one] for one in order]


def _distance(one: Sequence[int], place: Place) -> int:
    return abs(one[0] - place[1]) + abs(one[1] - place[2])
