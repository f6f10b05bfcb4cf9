"""All sheets of stationary states over a grid that folds connect.

Each sheet is swept from a known state up to its folds. At its edge the branch is followed in the parameter that leads over it:
where it turns back it comes to a state on another sheet at the same point, which is swept next.
"""

from collections import deque
from collections.abc import Collection, Iterable, Iterator

import numpy as np

from shapespace.analysis.continuation import Arclength, Continuation, Stop, start_point
from shapespace.analysis.extended import Parameter
from shapespace.analysis.stationary import Stationary
from shapespace.analysis.sweeping import SIDES, STRICT, Index, Sweep
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome

MAX_SHEETS = 24
"""More pieces of sheets than this on one grid are not looked for."""
MAX_EDGES = 8
MAX_SEAMS = 4
"""Places along the edges and seams of a sheet where the branch is followed past them at once,"""
MAX_TRIED = 24
"""and as long as there are more of them in all."""
MAX_POINTS = 80


def spread_sheets(values: Array, starts: Iterable[tuple[Index, Stationary]], limit: int = MAX_SHEETS) -> list[Sweep]:
    """Sweeps over a grid of parameters (n_0, n_1, m), one for each sheet, or piece of one, that the starts lead to.

    starts: states, each with the point to begin at, in the order in which they are tried; one that is known there is left out.
    No two sweeps have the same state at a point, mirror images counting as one.
    """
    sheets: list[Sweep] = []
    waiting = deque(starts)
    while waiting and len(sheets) < limit:
        at, state = waiting.popleft()
        sheet = Sweep(values, is_strict=True, others=tuple(sheets))
        if not sheet.begin(at, state):
            continue
        sheet.spread(at)
        # Before the other starts: what lies beyond a fold is nearest here.
        waiting.extendleft(_beyond(sheet))
        sheets.append(sheet)
    return [*sheets, _rest(values, sheets)] if sheets else []


def _rest(values: Array, sheets: list[Sweep]) -> Sweep:
    """States at points that no sheet has reached, by steps that may pass from one sheet to another."""
    known: dict[Index, Stationary] = {}
    for sheet in sheets:
        known = sheet.found | known
    rest = Sweep(values, found=dict(known))
    rest.spread(min(known))
    for at in known:
        del rest.found[at]
    return rest


def states_at(sheets: Iterable[Sweep], at: Index) -> list[Stationary]:
    """All states at a point."""
    return [sheet.found[at] for sheet in sheets if at in sheet.found]


Edge = tuple[Index, int, Index]
"""A point of a sheet, the number of the parameter that changes towards its neighbour, and that neighbour."""


def _beyond(sheet: Sweep) -> Iterator[tuple[Index, Stationary]]:
    """States on other sheets that the branches through the edges of a sheet lead to; where they do not turn the sheet grows."""
    tried: set[Edge] = set()
    while len(tried) < MAX_TRIED and (fresh := _edges(sheet, tried)):
        for edge in fresh:
            tried.add(edge)
            at, moved, there = edge
            is_open = there not in sheet.found
            found = _followed(sheet, at, moved, there)
            if found is None:
                continue
            if found[0] != there or not is_open:
                yield found
            elif sheet.begin(there, found[1]):
                sheet.spread(there)
                break


def _edges(sheet: Sweep, tried: Collection[Edge]) -> list[Edge]:
    """Some places where neighbours were not reached, and seams: a sweep that came around a cusp meets itself on another sheet."""
    edges: list[Edge] = []
    seams: list[tuple[float, Edge]] = []
    for at in sorted(sheet.found):
        for i, j in SIDES:
            there, back = (at[0] + i, at[1] + j), (at[0] - i, at[1] - j)
            edge = (at, 0 if i else 1, there)
            if edge in tried:
                continue
            if _is_outside(sheet, there):
                edges.append(edge)
            elif there in sheet.found and back in sheet.found and (bend := _bend(sheet, back, at, there)) > STRICT:
                seams.append((bend, edge))
    places = np.unique(np.linspace(0, len(edges) - 1, MAX_EDGES).round().astype(int)).tolist() if edges else []
    # The farthest from a straight course are the likeliest seams.
    return [edges[number] for number in places] + [edge for _, edge in sorted(seams, reverse=True)[:MAX_SEAMS]]


def _bend(sheet: Sweep, back: Index, at: Index, there: Index) -> float:
    """How far a state is from the line through those of the two points before it."""
    state = sheet.found[there]
    problem = state.problem
    before, here = (
        one.x if one.problem is problem else one.problem.carried(one.x, problem)
        for one in (sheet.found[back], sheet.found[at])
    )
    return problem.norm(state.x - 2.0 * here + before, state.x)


def _is_outside(sheet: Sweep, at: Index) -> bool:
    """Whether a point of the grid was not reached, for all that no other sheet begins there."""
    inside = all(0 <= one < count for one, count in zip(at, sheet.values.shape, strict=False))
    return inside and at not in sheet.found and at not in sheet.met


def _followed(sheet: Sweep, at: Index, moved: int, outside: Index) -> tuple[Index, Stationary] | None:
    """Where the branch comes to from a point: back to it on another sheet, or to its neighbour; None where to neither."""
    state, goal = sheet.found[at], sheet.p(outside)
    step = float(goal[moved] - state.p[moved])
    options = Arclength(parameter_scale=2.0 * abs(step), max_points=MAX_POINTS)
    first = start_point(state.problem, state.x, state.p, moved, float(np.sign(step)), options)
    if isinstance(first, Outcome):
        return None
    values = (float(state.p[moved]), float(goal[moved]))
    stops = [
        Stop(Parameter(moved), value, name, ends=True) for value, name in zip(values, ("back", "ahead"), strict=True)
    ]
    branch, last = Continuation([first], stops, options), first
    for point in branch:
        last = point
    if branch.outcome is not Outcome.REACHED_STOP:
        return None
    end = Stationary(last.problem, last.x, last.p, Outcome.CONVERGED, 0.0, 0.0, 0, False)
    settled = sheet.settled(end)
    if settled.outcome is not Outcome.CONVERGED:
        return None
    return (at if last.label == "back" else outside), settled
