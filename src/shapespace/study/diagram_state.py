"""The state at a point of a stored diagram, which holds numbers only: computed again from what is known nearby."""

from collections import OrderedDict
from collections.abc import Iterator
from itertools import product

import numpy as np

from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.analysis.sweeping import SWEEP_NEWTON, lagrange_weights
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.diagram_numbers import DiagramNumbers
from shapespace.study.diagram_store import CODES, OUTCOME, DiagramStore
from shapespace.study.keyed import KeyedProblem
from shapespace.study.scenario import Scenario
from shapespace.study.steady import Steady
from shapespace.study.tiles import Surveyor, states_again

KEPT = 64
"""States to go on from: those beside a known one are a few Newton steps away."""
BLOCK = 4
"""Tiles along each axis whose middle states are interpolated: mostly one Newton step is then enough, and seldom more than two."""
SHORTEST = 1.0 / 16.0
"""Of the way from a known state that is worth a step, before the tile is computed again."""
_CHECKED = ("area", "length")
TELLING = 1e-6
"""States that differ by less in these, relative to them, are the same."""

Place = tuple[int, int, int]
"""Number of the state, and of the values along x and y."""


class DiagramStates:
    """The states of a stored diagram, each checked against what is stored of it. numbers: of the store, where they are open."""

    def __init__(self, store: DiagramStore, numbers: DiagramNumbers | None = None) -> None:
        self._store, self._scenario, self._request = store, store.scenario, store.request
        self._numbers = numbers or DiagramNumbers(store)
        self._grid = grid = self._request.grid
        self._number = {tile: position for position, tile in enumerate(grid.tiles)}
        self._anchors = [*store]
        self._middles = np.array([(grid.x.anchors[i], grid.y.anchors[j]) for i, j in grid.tiles])
        self._found = [np.flatnonzero([one is Outcome.CONVERGED for one in of.outcomes]) for of in self._anchors]
        self._surveyor = Surveyor(self._scenario, grid.keys, stability=False)
        self._known: OrderedDict[Place, Steady] = OrderedDict()

    def scenario_at(self, place: Place) -> Scenario:
        """The scenario with the values of both keys there."""
        keys = zip(self._grid.keys, self._grid.values(*place[1:]).ravel().tolist(), strict=True)
        return self._scenario.with_overrides(dict(keys))

    def state(self, place: Place) -> Steady:
        """The state at a point. InputError where the diagram has none, StoreError where it is not found again."""
        found = self.find(place)
        if found is not None:
            return found
        if self._numbers.at(*place, [OUTCOME])[OUTCOME] != CODES[Outcome.CONVERGED]:
            raise InputError(f"{self._store.path}: has no state at this point; choose another one.")
        raise StoreError(f"{self._store.path}: the state at this point was not found again; resume the diagram.")

    def find(self, place: Place) -> Steady | None:
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

    def _again(self, place: Place) -> Steady | None:
        """The state at a point, computed again and recognised by what is stored of it; None where there is none or it is not
        found.
        """
        stored = self._numbers.at(*place, (OUTCOME, *_CHECKED))
        if stored[OUTCOME] != CODES[Outcome.CONVERGED]:
            return None
        scenario = self.scenario_at(place)
        for found in self._tried(place):
            if found is not None and found.outcome.is_success:
                assert isinstance(found.problem, KeyedProblem)
                steady = Steady(scenario, found.problem, found)
                mine = steady.observables
                if all(abs(mine[name] - stored[name]) <= TELLING * abs(mine[name]) for name in _CHECKED):
                    return steady
        return None

    def _tried(self, place: Place) -> Iterator[Stationary | None]:
        """What may be the state at a point, the cheapest first."""
        yield self._interpolated(place)
        yield self._stepped(place)
        yield from states_again(self._store, place[0], place[1:])

    def anchor(self, place: Place) -> int | None:
        """The number of the nearest tile in whose middle the state is stored, None where there is none."""
        if place[0] >= len(self._anchors) or not len(known := self._found[place[0]]):
            return None
        return int(known[np.abs(self._middles[known] - place[1:]).sum(axis=1).argmin()])

    def origin(self, place: Place) -> str | None:
        """The label of the nearest stored state that the diagram was computed from, None where there is none."""
        for number in range(len(self._anchors)) if self._request.branches else place[:1]:
            tile = self.anchor((number, *place[1:]))
            if tile is not None:
                return f"{self._anchors[number].state}-{tile}"
        return None

    def _interpolated(self, place: Place) -> Stationary | None:
        """From the polynomial through the states in the middles of the tiles around; None where one of them is missing.

        Where several states of a point are numbered by their energy, one number is not one sheet of states.
        """
        if self._request.branches:
            return None
        grid, anchors = self._grid, self._anchors[place[0]]
        goal = grid.values(*place[1:]).reshape(2)
        tiles, weights = [], []
        for axis, position, value in zip((grid.x, grid.y), place[1:], goal, strict=True):
            near = np.argsort(np.abs(axis.anchors - position), kind="stable")[:BLOCK]
            tiles.append(near.tolist())
            weights.append(lagrange_weights(axis.values[axis.anchors[near]] - value))
        numbers = [self._number[tile] for tile in product(*tiles)]
        if any(anchors.outcomes[one] is not Outcome.CONVERGED for one in numbers):
            return None
        problem = self._surveyor.state(anchors.meshes[numbers[0]], anchors.xs[numbers[0]], goal).problem
        xs: list[Array] = []
        for one in numbers:
            state = self._surveyor.state(anchors.meshes[one], anchors.xs[one], goal)
            xs.append(state.problem.carried(state.x, problem))
        guess = np.outer(*weights).ravel() @ np.array(xs)
        return solve_stationary(problem, guess, goal, SWEEP_NEWTON)

    def _stepped(self, place: Place) -> Stationary | None:
        """By a few long steps from the nearest known state; None where they lead elsewhere."""
        number = self.anchor(place)
        if number is None:
            return None
        near = min(
            (one for one in self._known if one[0] == place[0]),
            key=lambda one: self._distance((one[1], one[2]), place),
            default=None,
        )
        i, j = self._middles[number].tolist()
        middle = i, j
        if near is not None and self._distance((near[1], near[2]), place) <= self._distance(middle, place):
            start = self._known[near].found
        else:
            anchors = self._anchors[place[0]]
            values = self._grid.values(*middle).reshape(2)
            start = self._surveyor.state(anchors.meshes[number], anchors.xs[number], values)
        goal = self._grid.values(*place[1:]).reshape(2)
        return step_to(start, goal, SWEEP_NEWTON, SHORTEST) if not np.array_equal(start.p, goal) else start

    @staticmethod
    def _distance(one: tuple[int, int], place: Place) -> int:
        return abs(one[0] - place[1]) + abs(one[1] - place[2])
