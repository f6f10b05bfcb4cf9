"""The points of one tile of a diagram, from the states in the middle of the tiles around: what a worker computes."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from shapespace.analysis.passage import is_symmetric
from shapespace.analysis.sheets import spread_sheets, states_at
from shapespace.analysis.stability import Spectrum
from shapespace.analysis.stationary import Stationary
from shapespace.analysis.sweeping import Index, Sweep
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.study.diagram_shapes import Anchors, Shape
from shapespace.study.diagram_store import (
    ABOUT_SOLUTION,
    CODES,
    COUNT,
    NOT_COMPUTED,
    OUTCOME,
    REGIME,
    UNSTABLE,
    DiagramStore,
    kind_codes,
)
from shapespace.study.engine import Engine
from shapespace.study.grid import Tile
from shapespace.study.keyed import KeyedProblem
from shapespace.study.observables import measure, shape_end
from shapespace.study.quadtree import Lines, QuadTree
from shapespace.study.regimes import regime_of
from shapespace.study.scenario import Scenario
from shapespace.study.spectra import spectrum_at


class Done(NamedTuple):
    """A finished tile: its points, those of them with a state, those that were only inferred, and the seconds it took."""

    tile: Tile
    points: int
    converged: int
    inferred: int
    seconds: float


def compute_tile(path: str | Path, tile: Tile) -> Done:
    """Compute a tile of a stored diagram and write it there. What it holds depends on the store's anchors alone."""
    start = perf_counter()
    store = DiagramStore.open(path)
    request = store.request
    compute = _all_sheets if request.branches else _adaptively if request.adaptive else _named
    values, shapes = compute(store, tile)
    store.write_tile(tile, values, shapes)
    is_state = values[OUTCOME] == CODES[Outcome.CONVERGED]
    inferred = int((values[OUTCOME] == CODES[Outcome.INFERRED]).sum())
    if request.branches:  # however many states a point has, it counts once
        is_state = is_state.any(axis=0)
    return Done(tile, is_state.size, int(is_state.sum()), inferred, perf_counter() - start)


Survey = tuple[dict[str, Array], list[Shape]]
"""Arrays (states, n_x, n_y) of a tile's points by name, and those of its states that are stored whole."""


def _named(store: DiagramStore, tile: Tile) -> Survey:
    """Each state by its name."""
    surveyor = Surveyor(store.scenario, store.request.grid.keys, store.request.stability)
    surveys, sheets = [], []
    for anchors in store:
        sweep = _sweep(store, surveyor, anchors, tile)
        found = {at: [state] for at, state in sweep.found.items()}
        survey, _ = surveyor.survey(sweep.values.shape[:2], found, sweep.reasons, _untried(store, anchors, tile))
        surveys.append(survey)
        sheets.append(sweep.found)
    arrays = {name: np.concatenate([one[name] for one in surveys]) for name in surveys[0]}
    return arrays, _shapes_of_names(store, tile, sheets)


def _shapes_of_names(store: DiagramStore, tile: Tile, sheets: Sequence[Mapping[Index, Stationary]]) -> list[Shape]:
    """Some of the states of a tile, by name; where a map has so many tiles that their anchors do, none."""
    grid = store.request.grid
    chosen, (x, y) = grid.chosen(tile, len(sheets)), grid.span(tile)
    if len(chosen) == 1:
        return []
    return [
        shape_of(state, number, number, place)
        for number, found in enumerate(sheets)
        for place in chosen
        if (state := found.get((place[0] - x.start, place[1] - y.start))) is not None
    ]


def shape_of(state: Stationary, sheet: int, number: int, place: Index) -> Shape:
    """A state to store."""
    assert isinstance(state.problem, KeyedProblem)
    return Shape(sheet, number, place, state.problem.base.mesh, state.x)


def _untried(store: DiagramStore, anchors: Anchors, tile: Tile) -> Outcome:
    """Why there is no state where none was tried."""
    own = anchors.outcomes[store.request.grid.number(tile)]
    return own if own is not Outcome.CONVERGED else Outcome.NOT_REACHED


def _adaptively(store: DiagramStore, tile: Tile) -> Survey:
    """As `_named`, but only the points of a quad-tree; others are given the kind of those around, as inferred."""
    surveyor = Surveyor(store.scenario, store.request.grid.keys, store.request.stability)
    followers = [_Follower(store, surveyor, anchors, tile) for anchors in store]
    x, y = store.request.grid.span(tile)
    shape = x.stop - x.start, y.stop - y.start
    out = surveyor.empty(len(followers), shape)
    tree, known, before = QuadTree(shape), np.zeros(shape, bool), -1
    seen: dict[int, list[Index]] = {}
    while known.sum() > before:
        before = int(known.sum())
        for level, lines in enumerate(tree.levels):
            kinds = kind_codes(out[OUTCOME], out[REGIME], out.get(UNSTABLE))
            wanted = tree.refine(level, kinds, known)
            if wanted == seen.get(level):
                continue
            seen[level] = wanted
            for slot, follower in enumerate(followers):
                follower.extend(lines, wanted)
                follower.record(out, slot, [(int(lines[0][i]), int(lines[1][j])) for i, j in wanted])
            known |= out[OUTCOME][0] != NOT_COMPUTED
    kinds = kind_codes(out[OUTCOME], out[REGIME], out.get(UNSTABLE))
    for at, like in tree.inferred(kinds, known):
        out[OUTCOME][(slice(None), *at)] = CODES[Outcome.INFERRED]
        for name in {REGIME, UNSTABLE} & out.keys():
            out[name][(slice(None), *at)] = out[name][(slice(None), *like)]
    return out, _shapes_of_names(store, tile, [one.found for one in followers])


class _Follower:
    """One state at points of a tile, lattice by lattice."""

    def __init__(self, store: DiagramStore, surveyor: "Surveyor", anchors: Anchors, tile: Tile) -> None:
        self._store, self._surveyor, self._anchors, self._tile = store, surveyor, anchors, tile
        self.found: dict[Index, Stationary] = {}
        self._reasons: dict[Index, Outcome] = {}
        self._recorded: set[Index] = set()
        self._near: Spectrum | None = None
        self._untried = _untried(store, anchors, tile)

    def extend(self, lines: Lines, wanted: Collection[Index]) -> None:
        """Look for the state at the wanted points of a lattice, from where it is known already, at first from the anchors."""
        places = [{int(one): number for number, one in enumerate(line)} for line in lines]
        known = {
            (places[0][i], places[1][j]): state
            for (i, j), state in self.found.items()
            if i in places[0] and j in places[1]
        }
        if known.keys() >= {*wanted}:
            return
        sweep = _sweep(self._store, self._surveyor, self._anchors, self._tile, lines, known, {*wanted})
        for (i, j), state in sweep.found.items():
            self.found[int(lines[0][i]), int(lines[1][j])] = state
        for (i, j), reason in sweep.reasons.items():
            self._reasons[int(lines[0][i]), int(lines[1][j])] = reason

    def record(self, out: dict[str, Array], slot: int, points: Iterable[Index]) -> None:
        """Put what is known at points into the arrays."""
        for at in points:
            state = self.found.get(at)
            if state is None:
                out[OUTCOME][(slot, *at)] = CODES[self._reasons.get(at, self._untried)]
            elif at not in self._recorded:
                self._recorded.add(at)
                measured = self._surveyor.measured(state)
                self._near = self._surveyor.record(out, (slot, *at), state, measured, self._near)


def _all_sheets(store: DiagramStore, tile: Tile) -> Survey:
    """All states known at each point, in the order of their bending energy."""
    request = store.request
    surveyor = Surveyor(store.scenario, request.grid.keys, request.stability)
    sheets = _sheets(store, surveyor, tile)
    x, y = request.grid.span(tile)
    shape = x.stop - x.start, y.stop - y.start
    found = {at: states for at in np.ndindex(*shape) if (states := states_at(sheets, at))}
    reasons = {at: reason for sheet in sheets for at, reason in sheet.reasons.items()}
    arrays, ranked = surveyor.survey(shape, found, reasons, Outcome.NO_STATE, request.branches)
    count = np.zeros((1, *shape), np.int16)
    for at, states in found.items():
        count[(0, *at)] = len(states)
    shapes = []
    chosen = {(i - x.start, j - y.start) for i, j in request.grid.chosen(tile, request.branches)}
    for sheet, sweep in enumerate(sheets):
        # Of each sheet one at least, that nearest to the middle.
        middle = min(sweep.found, key=lambda at: abs(at[0] - shape[0] // 2) + abs(at[1] - shape[1] // 2), default=None)
        for at in sorted(({middle} if middle is not None else set()) | (chosen & sweep.found.keys())):
            rank = next(i for i, state in enumerate(ranked[at]) if state is sweep.found[at])
            number = rank if rank < request.branches else -1
            shapes.append(shape_of(sweep.found[at], sheet, number, (at[0] + x.start, at[1] + y.start)))
    return arrays | {COUNT: count}, shapes


def _sheets(store: DiagramStore, surveyor: "Surveyor", tile: Tile) -> list[Sweep]:
    """All sheets over a tile that the states known in it and on its borders, and folds, lead to."""
    request = store.request
    grid = request.grid
    x, y = grid.span(tile)
    middle = grid.middles[grid.number(tile)]

    def starts() -> Iterator[tuple[Index, Stationary]]:
        near = [
            (abs(i - middle[0]) + abs(j - middle[1]), number, (i, j))
            for number, (i, j) in enumerate(request.places)
            if x.start <= i <= x.stop and y.start <= j <= y.stop
        ]
        for _, number, (i, j) in sorted(near):
            # The first line of the next tile is a step away from this one's last.
            at = min(i, x.stop - 1) - x.start, min(j, y.stop - 1) - y.start
            for anchors in store:
                if anchors.outcomes[number] is Outcome.CONVERGED:
                    yield at, surveyor.state(anchors.meshes[number], anchors.xs[number], grid.values(i, j).reshape(2))

    return spread_sheets(grid.values(x, y), starts())


def _sweep(
    store: DiagramStore,
    surveyor: "Surveyor",
    anchors: Anchors,
    tile: Tile,
    lines: Lines | None = None,
    known: Mapping[Index, Stationary] | None = None,
    among: Collection[Index] | None = None,
) -> Sweep:
    """The states at a tile's points, or at some of a lattice in it where some are known."""
    grid = store.request.grid
    span = grid.span(tile)
    numbers = [np.arange(one.start, one.stop) for one in span]
    if lines is not None:
        numbers = [own[line] for own, line in zip(numbers, lines, strict=True)]
    sweep = Sweep(grid.values(*numbers), found=dict(known or {}), among=among)
    if known:
        sweep.spread(min(known))
        return sweep
    tiles = {one: number for number, one in enumerate(grid.tiles)}
    for near in _around(tile):
        if near not in tiles or not sweep.missing:
            continue
        number = tiles[near]
        if anchors.outcomes[number] is not Outcome.CONVERGED:
            continue
        i, j = grid.x.anchors[near[0]], grid.y.anchors[near[1]]
        apart = np.abs(numbers[0] - i)[:, None] + np.abs(numbers[1] - j)
        at = min(sweep.missing, key=lambda one: (apart[one], one))
        state = surveyor.state(anchors.meshes[number], anchors.xs[number], grid.values(i, j).reshape(2))
        if sweep.begin(at, state):
            sweep.spread(at)
    return sweep


def sheets_again(store: DiagramStore, number: int, tile: Tile) -> list[Sweep]:
    """The states of a tile, computed again; number: of the state that is wanted where states have names, else all are found."""
    surveyor = Surveyor(store.scenario, store.request.grid.keys, stability=False)
    if store.request.branches:
        return _sheets(store, surveyor, tile)
    return [_sweep(store, surveyor, store.read(number), tile)]


def _around(tile: Tile) -> Iterator[Tile]:
    """A tile and its neighbours, the nearest first."""
    yield tile
    for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)):
        yield tile[0] + i, tile[1] + j


@dataclass
class Surveyor:
    """Turns states of a scenario, two of whose keys vary, into what a diagram stores."""

    scenario: Scenario
    keys: tuple[str, str]
    stability: bool

    def __post_init__(self) -> None:
        self._engine = Engine.of(self.scenario)
        self._problem = KeyedProblem.of(self.scenario, self.keys)
        self.names = observable_names(self.scenario, self.keys)
        self._units = self._unit(self.scenario)
        at = {key: 0.5 * float(self.scenario.values()[key]) or 0.5 for key in self.keys}
        self._is_scaled = self._unit(self.scenario.with_overrides(at)) != self._units

    def state(self, mesh: Array, x: Array, q: Array) -> Stationary:
        """A stored state at values q (2,) of the keys."""
        problem = replace(self._problem, base=self._problem.base.on_mesh(mesh))
        return Stationary(problem, x, q, Outcome.CONVERGED, 0.0, np.nan, 0, True)

    def survey(
        self,
        shape: tuple[int, ...],
        found: Mapping[Index, Sequence[Stationary]],
        reasons: Mapping[Index, Outcome],
        untried: Outcome,
        slots: int = 1,
    ) -> tuple[dict[str, Array], dict[Index, list[Stationary]]]:
        """Arrays (slots, n_x, n_y) by name, and the states in the order of their bending energy, as they are in the arrays.

        reasons: why there is none, where one was tried; `untried` where none was.
        """
        out, ranked = self.empty(slots, shape), dict[Index, list[Stationary]]()
        near: list[Spectrum | None] = [None] * slots
        for at in np.ndindex(*shape):
            out[OUTCOME][(slice(None), *at)] = CODES[reasons.get(at, untried)]
            states = [(self.measured(state), state) for state in found.get(at, ())]
            states.sort(key=lambda one: one[0]["bending_energy"])
            ranked[at] = [state for _, state in states]
            for slot, (measured, state) in enumerate(states[:slots]):
                near[slot] = self.record(out, (slot, *at), state, measured, near[slot])
        return out, ranked

    def empty(self, slots: int, shape: tuple[int, ...]) -> dict[str, Array]:
        """Arrays (slots, n_x, n_y) by name in which nothing is computed."""
        names = [*self.names, *ABOUT_SOLUTION, *([UNSTABLE] if self.stability else [])]
        out: dict[str, Array] = {name: np.full((slots, *shape), np.nan) for name in names}
        out[OUTCOME], out[REGIME] = np.zeros((slots, *shape), np.int8), np.zeros((slots, *shape), np.uint8)
        return out

    def record(
        self,
        out: dict[str, Array],
        at: tuple[int, ...],
        state: Stationary,
        measured: dict[str, float],
        near: Spectrum | None,
    ) -> Spectrum | None:
        """Put a state into the arrays; its spectrum, where that is asked for, is returned to start the next one's."""
        problem = state.problem
        assert isinstance(problem, KeyedProblem)
        end, count, spectrum = shape_end(problem.base, state.x), None, None
        about = {"correction": state.correction, "iterations": state.iterations, "elements": problem.base.elements}
        values = self._in_units(state, measured) | about
        if self.stability:
            spectrum = spectrum_at(problem, state.x, state.p, near=near)
            count = spectrum.n_unstable
            values[UNSTABLE] = np.nan if count is None else count
        if end is None:
            out[REGIME][at] = regime_of(is_symmetric(problem, state.x), measured, count)
        out[OUTCOME][at] = CODES[end or Outcome.CONVERGED]
        for name, value in values.items():
            out[name][at] = value
        return spectrum

    def measured(self, state: Stationary) -> dict[str, float]:
        """Dimensionless observables."""
        assert isinstance(state.problem, KeyedProblem)
        problem = state.problem.base
        p = state.problem.powers.value(state.p)
        values = self._engine.values | dict(zip(self._engine.system.parameters, p.tolist(), strict=True))
        engine = replace(self._engine, problem=problem, p=p, values=values)
        return measure(engine, state.x, REST)

    def observables(self, state: Stationary) -> dict[str, float]:
        """In the scenario's units, as they are stored."""
        return self._in_units(state, self.measured(state))

    def _in_units(self, state: Stationary, measured: dict[str, float]) -> dict[str, float]:
        """In the scenario's units."""
        units = self._units
        if self._is_scaled:
            units = self._unit(self.scenario.with_overrides(dict(zip(self.keys, state.p.tolist(), strict=True))))
        return {name: measured[name] * units[name] for name in self.names if name in measured}

    def _unit(self, scenario: Scenario) -> dict[str, float]:
        return {name: scenario.scales.factor(name) for name in self.names}


def observable_names(scenario: Scenario, keys: tuple[str, str]) -> list[str]:
    """What the scenario's states report; a key that is an observable as well stands for itself."""
    engine = Engine.of(scenario)
    x = engine.problem.pack(engine.initial_state())
    values = measure(engine, x, REST)
    return [name for name in dict.fromkeys((*values, "neck_radius")) if name not in keys]
