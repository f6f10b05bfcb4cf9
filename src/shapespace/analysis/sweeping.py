"""Stationary states on a grid of parameters, each found from those beside it.

A point's guess extrapolates the states already found on the longest straight run of neighbours,

    x_0 = sum_(i <= m) x_(-i) prod_(j != i) d_j/(d_j - d_i),   m <= 4,

d_i the distance of the i-th one, which misses by the m-th difference of x; Newton's method then starts with the factors of
the point before. Which points are tried in which order depends on the grid and on what exists there, never on time or on
other grids.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from shapespace.analysis.deflation import is_same
from shapespace.analysis.stationary import LARGEST_MISS, Stationary, step_to
from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST, AbstractContinuableProblem, AbstractLinearisation, AbstractSmoothProblem
from shapespace.numerics.newton import Newton, solve_root

Index = tuple[int, int]

LONGEST = 4
"""Neighbours in a row that are extrapolated."""
SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))
SWEEP_NEWTON = Newton(max_iterations=12, min_damping=0.25)
"""A guess that needs more patience is replaced by shorter steps."""
SHORTEST = 1.0 / 16.0
"""Of the way between neighbours that is worth a step: more often than not there is no state beyond."""
NOTABLE = 1e-2
"""A state that misses its guess by more is looked at: it may be one that the symmetry distinguishes."""
STRICT = 2e-2
"""The same for a sweep that must not pass from one sheet of states to another,"""
DOUBTFUL = 1e-3
"""and a state that misses by more than this must lie on the same side of all folds as its neighbour."""
NEARLY = 0.1
"""States on different discretisations that differ by more are two."""
SYMMETRIC = 1e-6
"""States that differ less from their mirror image are their own."""
INDEPENDENT = 1e-5
"""Monomials of which less than this share is no combination of the others, at the places given, are left out."""
MAX_MOVES = 6
MAX_TRIES = 2


@dataclass
class Sweep:
    """The states found so far on a grid. values (n_0, n_1, m): parameters. reasons: why there is none, where one was tried.

    is_strict: stay on one sheet of states, up to its folds. others: sweeps whose states are known; where this one comes upon
    them it ends, at the points `met`. among: the points that are wanted, where not all are.
    """

    values: Array
    is_strict: bool = False
    others: Sequence["Sweep"] = ()
    among: Collection[Index] | None = None
    met: set[Index] = field(default_factory=set)
    found: dict[Index, Stationary] = field(default_factory=dict)
    reasons: dict[Index, Outcome] = field(default_factory=dict)
    newton: Newton = SWEEP_NEWTON
    _tries: dict[Index, int] = field(default_factory=dict)
    _neighbours: dict[Index, int] = field(default_factory=dict)
    _factors: tuple[AbstractContinuableProblem, AbstractLinearisation] | None = None

    def p(self, at: Index) -> Array:
        """Parameters (m,) of a point."""
        return np.asarray(self.values[at])

    @property
    def missing(self) -> list[Index]:
        """Points that are wanted and have no state."""
        return [at for at in np.ndindex(*self.values.shape[:2]) if self._is_wanted(at) and at not in self.found]

    def begin(self, at: Index, state: Stationary) -> bool:
        """Take a state, stepping from its own parameters to those of a point; False where that fails, or it is known there."""
        there = state
        if not np.array_equal(state.p, self.p(at)):
            there = self._stepped(state, at)
            if not there.outcome.is_success or not _is_like(there, state):
                return False
        if self._is_known(at, there):
            return False
        self.found[at] = there
        return True

    def settled(self, state: Stationary) -> Stationary:
        """A state converged on a discretisation that is good enough for it."""
        return self._newton(state.problem, state.x, state.p)

    def spread(self, start: Index) -> None:
        """Find the states at all points that can be come to from the known ones, line by line from `start` on."""
        order = list(_lines(start, self.values.shape[:2]))
        grows = True
        while grows:
            grows = False
            for at in order:
                if at in self.found or at in self.met or not self._is_worth(at):
                    continue
                state = self._solved(at)
                if state is not None and self._is_known(at, state):
                    self.met.add(at)
                elif state is not None:
                    self.found[at] = state
                    grows = True

    def _is_worth(self, at: Index) -> bool:
        """Whether a point is wanted, and more neighbours are known than when it was last tried."""
        if not self._is_wanted(at):
            return False
        known = len(self._known(at))
        if known <= self._neighbours.get(at, 0) or self._tries.get(at, 0) >= MAX_TRIES:
            return False
        self._neighbours[at], self._tries[at] = known, self._tries.get(at, 0) + 1
        return True

    def _is_wanted(self, at: Index) -> bool:
        return self.among is None or at in self.among

    def _known(self, at: Index) -> list[Index]:
        """Solved neighbours."""
        return [one for one in ((at[0] + i, at[1] + j) for i, j in SIDES) if one in self.found]

    def _solved(self, at: Index) -> Stationary | None:
        """By the best extrapolation, by a line through two neighbours, and by short steps from neighbours."""
        run = max((self._run(at, side) for side in SIDES), key=len)
        for known in (run, run[:2]) if len(run) > 2 else (run,):
            state = self._extrapolated(at, known)
            if state is not None:
                return state
        for one in self._known(at)[:2]:
            state = self._stepped(self.found[one], at)
            if not state.outcome.is_success:
                self.reasons[at] = state.outcome
            elif _is_like(state, self.found[one]) and (not self.is_strict or _is_beside(state, self.found[one])):
                return state
            else:
                self.reasons[at] = Outcome.NO_STATE
        return None

    def _run(self, at: Index, side: Index) -> list[Index]:
        """Known points in a row from here, the nearest first."""
        run: list[Index] = []
        for m in range(1, LONGEST + 1):
            one = (at[0] + m * side[0], at[1] + m * side[1])
            if one not in self.found:
                break
            run.append(one)
        return run

    def _extrapolated(self, at: Index, run: list[Index]) -> Stationary | None:
        problem = self.found[run[0]].problem
        xs = [self._on(problem, one) for one in run]
        distances = np.array([np.abs(self.p(one) - self.p(at)).sum() for one in run])
        guess = lagrange_weights(distances) @ np.array(xs)
        state = self._newton(problem, guess, self.p(at))
        if state.outcome is not Outcome.CONVERGED:
            self.reasons[at] = state.outcome
            return None
        x = state.x if state.problem is problem else state.problem.carried(state.x, problem)
        miss = problem.norm(x - guess, guess)
        if self.is_strict and (miss > STRICT or (miss > DOUBTFUL and not _is_beside(state, self.found[run[0]]))):
            self.reasons[at] = Outcome.NO_STATE
            return None
        if miss <= NOTABLE or (miss <= LARGEST_MISS and _is_like(state, self.found[run[0]])):
            return state
        self.reasons[at] = Outcome.NO_STATE
        return None

    def _stepped(self, state: Stationary, at: Index) -> Stationary:
        """What a state becomes at a point, by short steps."""
        return step_to(state, self.p(at), self.newton, SHORTEST, STRICT if self.is_strict else LARGEST_MISS)

    def _is_known(self, at: Index, state: Stationary) -> bool:
        """Whether another sweep has this state, or its mirror image."""
        known = (other.found[at] for other in self.others if at in other.found)
        return any(_is_near(state, one) and is_same(state, one) for one in known)

    def _on(self, problem: AbstractContinuableProblem, at: Index) -> Array:
        """A known state on the discretisation of a problem, where it then stays."""
        state = self.found[at]
        return state.x if state.problem is problem else state.problem.carried(state.x, problem)

    def _newton(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> Stationary:
        """Newton's method with the last factors, on better discretisations where the first is not good enough."""
        iterations = 0
        for move in range(MAX_MOVES + 1):
            factors = self._factors[1] if self._factors is not None and self._factors[0] is problem else None
            root = solve_root(problem, x, p, REST, self.newton, factors)
            iterations += root.iterations
            if root.linearisation is not None:
                self._factors = (problem, root.linearisation)
            better = problem.adapted(root.x) if root.outcome is Outcome.CONVERGED and move < MAX_MOVES else problem
            if better is problem:
                break
            assert isinstance(better, AbstractContinuableProblem)
            x, problem = problem.carried(root.x, better), better
        return Stationary(problem, root.x, p, root.outcome, root.correction, np.nan, iterations, move < MAX_MOVES)


def lagrange_weights(distances: Array) -> Array:
    """Of values at distances (m,), which may have both signs, in the value at distance 0 of the polynomial through them."""
    apart = distances - distances[:, None]
    np.fill_diagonal(apart, 1.0)
    shares = distances / apart
    np.fill_diagonal(shares, 1.0)
    return np.asarray(shares.prod(axis=1))


def polynomial_weights(offsets: Array) -> Array:
    """Of values at places (m, 2) in the value at the origin of the polynomial of least degree through them.

    Of its monomials x^a y^b, a, b < 4, those are taken that the places tell apart, of low degree first; where they are fewer than
    the places the weights are the smallest that are exact for all of them.
    """
    scaled = offsets / np.maximum(np.abs(offsets).max(axis=0), np.finfo(float).tiny)
    taken, basis = [], np.zeros((len(scaled), 0))
    for a, b in sorted(product(range(LONGEST), repeat=2), key=sum):
        values = scaled[:, 0] ** a * scaled[:, 1] ** b
        rest = values - basis @ (basis.T @ values)
        if np.linalg.norm(rest) > INDEPENDENT * np.linalg.norm(values):
            taken.append(values)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    wanted = np.zeros(len(taken))
    wanted[0] = 1.0
    return np.asarray(np.linalg.lstsq(np.array(taken), wanted)[0])


def _is_near(state: Stationary, other: Stationary) -> bool:
    """Whether two states, or one and the other's mirror image, are near enough to be one on different discretisations."""
    problem, image = state.problem, _image(state)
    there = other.x if other.problem is problem else other.problem.carried(other.x, problem)
    images = (state.x,) if image is None else (state.x, image)
    return min(problem.norm(one - there, there) for one in images) < NEARLY


def _is_beside(state: Stationary, other: Stationary) -> bool:
    """Whether no fold lies between two states: the determinants of their Jacobians have one sign."""
    problem = state.problem
    there = other.x if other.problem is problem else other.problem.carried(other.x, problem)
    signs = []
    for x, p in ((state.x, state.p), (there, other.p)):
        _, linearisation = problem.linearise(x, p, REST)
        signs.append(linearisation.sign)
    return signs[0] == signs[1]


def _is_like(state: Stationary, other: Stationary) -> bool:
    """Whether both are their own mirror images, or neither is and the first is nearer to the second than to its image."""
    problem, image = state.problem, _image(state)
    if image is None:
        return True
    reference = _image(other)
    assert reference is not None
    is_own = problem.norm(image - state.x, state.x) < SYMMETRIC
    if is_own != (other.problem.norm(reference - other.x, other.x) < SYMMETRIC):
        return False
    before = other.problem.carried(other.x, problem)
    return is_own or problem.norm(state.x - before, before) <= problem.norm(image - before, before)


def _image(state: Stationary) -> Array | None:
    return state.problem.reflected(state.x) if isinstance(state.problem, AbstractSmoothProblem) else None


def _lines(start: Index, shape: tuple[int, ...]) -> Iterator[Index]:
    """All points: the column of the start outwards from it, each followed by its row outwards from that column."""
    for j in _outwards(start[1], shape[1]):
        for i in _outwards(start[0], shape[0]):
            yield i, j


def _outwards(start: int, count: int) -> Iterator[int]:
    yield from range(start, count)
    yield from range(start - 1, -1, -1)
