"""Boundaries of a diagram: where its states change in kind the fold or branch point is located and followed in both keys."""

import json
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapespace.analysis.bifurcation import Kind, SingularPoint
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.stationary import Stationary
from shapespace.analysis.sweeping import Index
from shapespace.analysis.tracing import Located, traced
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.study.curve_store import Curve, outline
from shapespace.study.curves import curve_through
from shapespace.study.diagram_state import DiagramStates
from shapespace.study.diagram_store import (
    BOUNDARIES,
    CURVES,
    OUTCOME,
    REGIME,
    UNSTABLE,
    Diagram,
    DiagramStore,
    kind_codes,
)
from shapespace.study.files import storage, write_atomically
from shapespace.study.grid import Grid
from shapespace.study.keyed import KeyedProblem
from shapespace.study.regimes import SHAPE

NEAR = 1.0
"""Cells from the middle between two points of different kind within which a curve tells where between them it changes."""
SEARCHED = 2.5
"""Cells on either side of a point in which a fold or branch point is looked for."""
SAME = 1e-3
"""A point this near to a known curve, in cells, is one of it."""
MAX_FAILURES = 12
"""Changes tried in vain, the farthest from each other first, after which those that remain are given up."""

Progress = Callable[[Curve], None]
"""Called after each curve."""


class Change(NamedTuple):
    """Neighbours between which states change in kind: of one kind `inside` has more than `outside`, which are `states`.

    is_pair: two states more, which a fold must end.
    """

    states: tuple[int, ...]
    is_pair: bool
    inside: Index
    outside: Index

    @property
    def middle(self) -> Array:
        """In cells, (2,)."""
        return 0.5 * (np.array(self.inside) + np.array(self.outside))


def follow_boundaries(store: DiagramStore, diagram: Diagram, progress: Progress | None = None) -> None:
    """Find the curves along which the states of a complete diagram change in kind, and store them with it.

    Kind: existence, symmetry, motion and, where it is stored, the number of growing modes; not the shape, which has a neck
    or none on one and the same sheet. A surface that touches itself ends a sheet without a curve. Curves that an earlier
    call finished stay; changes without a curve are stored too.
    """
    folder = store.path / CURVES
    with storage(store.path):
        folder.mkdir(exist_ok=True)
    curves = _kept(folder, diagram)
    open_changes, states = _unexplained(find_changes(diagram), diagram, curves), DiagramStates(store)
    tried: list[Array] = []
    while open_changes and len(tried) < MAX_FAILURES:
        change = max(open_changes, key=lambda one: _remoteness(one.middle, tried, diagram))
        found = _curve_at(states, diagram, change, curves, folder)
        if found is None:
            tried.append(change.middle)
            continue
        curves.append(found)
        if progress is not None:
            progress(found)
        before, open_changes = open_changes, _unexplained(open_changes, diagram, [found])
        if change in open_changes or len(before) == len(open_changes):
            tried.append(change.middle)
    grid = diagram.request.grid
    steps = np.array([grid.x.step, grid.y.step])
    places = [(np.array([grid.x.start, grid.y.start]) + one.middle * steps).tolist() for one in open_changes]
    with storage(store.path):
        write_atomically(store.path / BOUNDARIES, json.dumps({"unexplained": places}, indent=1).encode())


def _kept(folder: Path, diagram: Diagram) -> list[Curve]:
    """Curves that are complete; others, of an interrupted call, are removed."""
    with storage(folder):
        known = {curve.store for curve in diagram.boundaries if curve.outcome is not None}
        for path in folder.iterdir():
            if path not in known:
                shutil.rmtree(path)
    return [curve for curve in diagram.boundaries if curve.store in known]


def _remoteness(place: Array, tried: Sequence[Array], diagram: Diagram) -> float:
    """How far a place is from all those tried; before there is one, how near it is to the middle."""
    shape = np.array(diagram.request.grid.shape)
    if not tried:
        return -float(np.linalg.norm(place / shape - 0.5))
    return min(float(np.linalg.norm((place - one) / shape)) for one in tried)


def kinds(diagram: Diagram) -> NDArray[np.int64]:
    """A number (states, n_x, n_y) for what kind each state is of; 0 is none, -1 a surface that touches itself."""
    x, y = diagram.request.grid.keys
    data = diagram.dataset.transpose(..., y, x)

    def values(name: str) -> Array:
        array = data[name].to_numpy()
        return np.asarray(array.reshape(-1, *array.shape[-2:]).swapaxes(1, 2))

    unstable = values(UNSTABLE) if UNSTABLE in data else None
    return kind_codes(values(OUTCOME), values(REGIME), unstable, but=int(SHAPE))


def find_changes(diagram: Diagram) -> list[Change]:
    """All neighbours with states of different kinds, those along x first."""
    code = kinds(diagram)
    ordered: NDArray[np.int64] = np.sort(code, axis=0)
    is_whole = np.asarray((code >= 0).all(axis=0))
    changes = []
    for side in ((1, 0), (0, 1)):
        low = tuple(slice(None, n - k) for n, k in zip(code.shape[1:], side, strict=True))
        high = tuple(slice(k, None) for k in side)
        differ = np.abs(ordered[(slice(None), *low)] - ordered[(slice(None), *high)]).sum(axis=0)
        for i, j in np.argwhere((differ > 0) & is_whole[low] & is_whole[high]).tolist():
            changes.append(_change(code, (i, j), (i + side[0], j + side[1])))
    return changes


def _change(code: NDArray[np.int64], one: Index, other: Index) -> Change:
    """Which state of which of two points the other has not."""
    for inside, outside in ((one, other), (other, one)):
        here = code[(slice(None), *inside)].tolist()
        surplus = Counter(here) - Counter(code[(slice(None), *outside)].tolist())
        states = tuple(number for number, kind in enumerate(here) if kind and surplus[kind])
        if states:
            there = code[(slice(None), *outside)].tolist()
            return Change(states, sum(map(bool, here)) - sum(map(bool, there)) == 2, inside, outside)
    raise ValueError(f"{one}, {other}: have states of the same kinds.")


def _cells(curve: Curve, diagram: Diagram) -> Array:
    """The outline of a curve (m, 2) in cells of the grid."""
    grid = diagram.request.grid
    axes = {axis.key: axis for axis in (grid.x, grid.y)}
    values = dict(zip(curve.keys, outline(curve.points), strict=True))
    return np.stack([(values[key] - axes[key].start) / axes[key].step for key in grid.keys], axis=1)


def distances(places: Array, curve: Curve, diagram: Diagram) -> Array:
    """How far places (k, 2), in cells, are from a curve (k,), in cells."""
    corners = _cells(curve, diagram)
    start, way = corners[:-1], np.diff(corners, axis=0)
    if not len(start):
        return np.asarray(np.linalg.norm(places - corners[0], axis=1))
    squares = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    offset = places[:, None] - start
    share = np.clip((offset * way).sum(axis=2) / squares, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * way, axis=2).min(axis=1))


def _unexplained(changes: Sequence[Change], diagram: Diagram, curves: Sequence[Curve]) -> list[Change]:
    """Changes that no curve passes."""
    if not changes or not curves:
        return [*changes]
    places = np.stack([change.middle for change in changes])
    near = np.stack([distances(places, curve, diagram) <= NEAR for curve in curves])
    is_fold = np.array([curve.of == Kind.FOLD for curve in curves])
    passed = {True: np.asarray(near[is_fold].any(axis=0)), False: np.asarray(near.any(axis=0))}
    return [change for number, change in enumerate(changes) if not passed[change.is_pair][number]]


def _curve_at(
    states: DiagramStates, diagram: Diagram, change: Change, curves: Sequence[Curve], folder: Path
) -> Curve | None:
    """The curve that a change lies on; None where there is no fold or branch point, or one of a known curve."""
    grid = diagram.request.grid
    moved = 0 if change.inside[1] == change.outside[1] else 1
    axis, other = (grid.x, grid.y) if moved == 0 else (grid.y, grid.x)
    point = _point_at(states, grid, change, moved)
    if point is None or not axis.start <= point.parameter <= axis.stop:
        return None
    place = np.array([[(point.parameter - axis.start) / axis.step, change.inside[1 - moved]]])
    place = place if moved == 0 else place[:, ::-1]
    if any(distances(place, known, diagram)[0] < SAME for known in curves):
        return None
    number = 1 + sum(known.of == str(point.kind) for known in curves)
    values = dict(zip((axis.key, other.key), point.p.tolist(), strict=True))
    origin = f"{point.kind} of the diagram at {', '.join(f'{key} = {value:.8g}' for key, value in values.items())}"
    bounds = ((axis.start, axis.stop), (other.start, other.stop))
    scenario = diagram.scenario.with_overrides(values)
    return curve_through(scenario, point, bounds, folder / f"{point.kind}-{number}", origin)


def _point_at(states: DiagramStates, grid: Grid, change: Change, moved: int) -> SingularPoint | None:
    """The fold or branch point at a change along key number `moved`, from its inside or, where that is singular, from behind."""
    axis, other = (grid.x, grid.y) if moved == 0 else (grid.y, grid.x)
    ahead = change.outside[moved] - change.inside[moved]
    for back in range(2):
        at = [*change.inside]
        at[moved] -= back * ahead
        if not 0 <= at[moved] < axis.count:
            break
        # The last ones are the likeliest: what a fold ends are, of several states, those of more energy.
        for number in reversed(change.states):
            state = states.find((number, at[0], at[1]))
            point = (
                None
                if state is None
                else locate(state.found, (axis.key, other.key), moved, ahead * axis.step, change.is_pair)
            )
            if point is not None:
                return point
    return None


def locate(state: Stationary, keys: tuple[str, str], moved: int, cell: float, is_fold: bool) -> SingularPoint | None:
    """The first fold or branch point on the branch of a state within a few cells of its value of the first key.

    keys: the one that moves first, which is number `moved` of the state's. cell: the step towards where it is expected. is_fold:
    no other point will do.
    """
    problem = state.problem
    assert isinstance(problem, KeyedProblem)
    p = state.p if moved == 0 else state.p[::-1].copy()
    powers = problem.powers
    if moved:
        powers = replace(powers, exponents=powers.exponents[:, ::-1].copy())
    options = Arclength(parameter_scale=2.0 * abs(cell), max_points=120)
    keyed = KeyedProblem(problem.base, keys, powers)
    first = start_point(keyed, state.x, p, 0, float(np.sign(cell)), options)
    if isinstance(first, Outcome):
        return None
    for one in traced(Continuation([first], (), options)):
        if isinstance(one, Located):
            if not is_fold or one.point.kind is Kind.FOLD:
                return one.point
        elif isinstance(one, Point) and not -1.0 <= (one.parameter - p[0]) / cell <= SEARCHED:
            break
    return None
