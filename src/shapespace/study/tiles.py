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
from shapespace.analysis.sweeping import SIDES, Index, Sweep
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.study.diagram_store import (
    ABOUT_SOLUTION,
    CODES,
    COUNT,
    NOT_COMPUTED,
    OUTCOME,
    REGIME,
    UNSTABLE,
    Anchors,
    DiagramStore,
    kind_codes,
)
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem
from shapespace.study.observables import measure, shape_end
from shapespace.study.quadtree import Lines, QuadTree
from shapespace.study.regimes import regime_of
from shapespace.study.scenario import Scenario
from shapespace.study.spectra import spectrum_at

Tile = tuple[int, int]


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
    values = compute(store, tile)
    store.write_tile(tile, values)
    is_state = values[OUTCOME] == CODES[Outcome.CONVERGED]
    inferred = int((values[OUTCOME] == CODES[Outcome.INFERRED]).sum())
    if request.branches:  # however many states a point has, it counts once
        is_state = is_state.any(axis=0)
    return Done(tile, is_state.size, int(is_state.sum()), inferred, perf_counter() - start)


def _named(store: DiagramStore, tile: Tile) -> dict[str, Array]:
    """Arrays (states, n_x, n_y) of a tile's points: each state by its name."""
    surveyor = Surveyor(store.scenario, store.request.grid.keys, store.request.stability)
    surveys = []
    for anchors in store:
        sweep = _sweep(store, surveyor, anchors, tile)
        found = {at: [state] for at, state in sweep.found.items()}
        surveys.append(surveyor.survey(sweep.values.shape[:2], found, sweep.reasons, _untried(store, anchors, tile)))
    return {name: np.concatenate([one[name] for one in surveys]) for name in surveys[0]}


def _untried(store: DiagramStore, anchors: Anchors, tile: Tile) -> Outcome:
    """Why there is no state where none was tried."""
    own = anchors.outcomes[store.request.grid.tiles.index(tile)]
    return own if own is not Outcome.CONVERGED else Outcome.NOT_REACHED


def _adaptively(store: DiagramStore, tile: Tile) -> dict[str, Array]:
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
    return out


class _Follower:
    """One state at points of a tile, lattice by lattice."""

    def __init__(self, store: DiagramStore, surveyor: "Surveyor", anchors: Anchors, tile: Tile) -> None:
        self._store, self._surveyor, self._anchors, self._tile = store, surveyor, anchors, tile
        self._found: dict[Index, Stationary] = {}
        self._reasons: dict[Index, Outcome] = {}
        self._recorded: set[Index] = set()
        self._near: Spectrum | None = None
        self._untried = _untried(store, anchors, tile)

    def extend(self, lines: Lines, wanted: Collection[Index]) -> None:
        """Look for the state at the wanted points of a lattice, from where it is known already, at first from the anchors."""
        places = [{int(one): number for number, one in enumerate(line)} for line in lines]
        known = {
            (places[0][i], places[1][j]): state
            for (i, j), state in self._found.items()
            if i in places[0] and j in places[1]
        }
        if known.keys() >= {*wanted}:
            return
        sweep = _sweep(self._store, self._surveyor, self._anchors, self._tile, lines, known, {*wanted})
        for (i, j), state in sweep.found.items():
            self._found[int(lines[0][i]), int(lines[1][j])] = state
        for (i, j), reason in sweep.reasons.items():
            self._reasons[int(lines[0][i]), int(lines[1][j])] = reason

    def record(self, out: dict[str, Array], slot: int, points: Iterable[Index]) -> None:
        """Put what is known at points into the arrays."""
        for at in points:
            state = self._found.get(at)
            if state is None:
                out[OUTCOME][(slot, *at)] = CODES[self._reasons.get(at, self._untried)]
            elif at not in self._recorded:
                self._recorded.add(at)
                measured = self._surveyor.measured(state)
                self._near = self._surveyor.record(out, (slot, *at), state, measured, self._near)


def _all_sheets(store: DiagramStore, tile: Tile) -> dict[str, Array]:
    """Arrays (branches, n_x, n_y) of a tile's points: all states known there, in the order of their bending energy."""
    surveyor = Surveyor(store.scenario, store.request.grid.keys, store.request.stability)
    sheets = _sheets(store, surveyor, tile)
    shape = tuple(one.stop - one.start for one in store.request.grid.span(tile))
    found = {at: states for at in np.ndindex(*shape) if (states := states_at(sheets, at))}
    reasons = {at: reason for sheet in sheets for at, reason in sheet.reasons.items()}
    survey = surveyor.survey(shape, found, reasons, Outcome.NO_STATE, store.request.branches)
    count = np.zeros((1, *shape), np.int16)
    for at, states in found.items():
        count[(0, *at)] = len(states)
    return survey | {COUNT: count}


def _sheets(store: DiagramStore, surveyor: "Surveyor", tile: Tile) -> list[Sweep]:
    """All sheets over a tile that its anchors, those of the tiles beside it and folds lead to."""
    grid = store.request.grid
    x, y = grid.span(tile)
    values = grid.values(x, y)

    def starts() -> Iterator[tuple[Index, Stationary]]:
        for near in (tile, *((tile[0] + i, tile[1] + j) for i, j in SIDES)):
            if near not in grid.tiles:
                continue
            number = grid.tiles.index(near)
            i, j = int(grid.x.anchors[near[0]]), int(grid.y.anchors[near[1]])
            at = min(max(i, x.start), x.stop - 1) - x.start, min(max(j, y.start), y.stop - 1) - y.start
            for anchors in store:
                if anchors.outcomes[number] is Outcome.CONVERGED:
                    yield at, surveyor.state(anchors.meshes[number], anchors.xs[number], grid.values(i, j).reshape(2))

    return spread_sheets(values, starts())


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


def states_again(store: DiagramStore, number: int, at: Index) -> Iterator[Stationary]:
    """States at a grid point, computed as the diagram was: from the anchor of its tile by a few points, then in the whole tile.

    number: of the state; of a diagram of all states they are all looked for.
    """
    grid, is_strict = store.request.grid, store.request.branches > 0
    surveyor = Surveyor(store.scenario, grid.keys, stability=False)
    tile = grid.tile_of(at)
    place = grid.tiles.index(tile)
    middle = int(grid.x.anchors[tile[0]]), int(grid.y.anchors[tile[1]])
    for anchors in store if is_strict else [store.read(number)]:
        if anchors.outcomes[place] is not Outcome.CONVERGED:
            continue
        # Mostly a few points on the way are enough.
        low, high = np.minimum(at, middle), np.maximum(at, middle) + 1
        sweep = Sweep(grid.values(*(slice(a, b) for a, b in zip(low, high, strict=True))), is_strict)
        start = middle[0] - int(low[0]), middle[1] - int(low[1])
        state = surveyor.state(anchors.meshes[place], anchors.xs[place], grid.values(*middle).reshape(2))
        if sweep.begin(start, state):
            sweep.spread(start)
        found = sweep.found.get((at[0] - int(low[0]), at[1] - int(low[1])))
        if found is not None:
            yield found
    x, y = grid.span(tile)
    sweeps = _sheets(store, surveyor, tile) if is_strict else [_sweep(store, surveyor, store.read(number), tile)]
    yield from states_at(sweeps, (at[0] - x.start, at[1] - y.start))


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
    ) -> dict[str, Array]:
        """Arrays (slots, n_x, n_y) by name, states in the order of their bending energy.

        reasons: why there is none, where one was tried; `untried` where none was.
        """
        out = self.empty(slots, shape)
        near: list[Spectrum | None] = [None] * slots
        for at in np.ndindex(*shape):
            out[OUTCOME][(slice(None), *at)] = CODES[reasons.get(at, untried)]
            states = [(self.measured(state), state) for state in found.get(at, ())]
            for slot, (measured, state) in enumerate(sorted(states, key=lambda one: one[0]["bending_energy"])[:slots]):
                near[slot] = self.record(out, (slot, *at), state, measured, near[slot])
        return out

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
