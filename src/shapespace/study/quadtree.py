"""Which points of a tile tell where its states change in kind: those of cells that are halved while their points differ.

The edge of a tile is known whole, so that no region enters it unseen, and a lattice inside. A cell all of whose known points are
of one kind is left; another is halved both ways, down to neighbours. What is known of the kinds of points only ever adds cells to
halve, so that the points wanted in the end do not depend on the order in which they become known.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shapespace.analysis.sweeping import Index

COARSEST = 8
"""Points from one line of the coarsest lattice to the next, at most: what is smaller and closed in itself may be missed."""

Lines = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Numbers of the points of a lattice along both axes."""
Kinds = NDArray[np.int64]
"""(states, n_x, n_y): -1 where a state is of no kind that a point may be given unseen."""


class QuadTree:
    """The points of a tile that are wanted, from the coarsest of nested lattices to the finest."""

    def __init__(self, shape: Index) -> None:
        self.levels = _lattices(shape)
        self.wanted = np.ones(shape, bool)
        self.wanted[1:-1, 1:-1] = False
        self.wanted[np.ix_(*self.levels[0])] = True

    def refine(self, level: int, kinds: Kinds, known: NDArray[np.bool_]) -> list[Index]:
        """The points of a lattice that are wanted, by their numbers on it; known (n_x, n_y): where kinds are."""
        lines = self.levels[level]
        for box in self._boxes(level - 1) if level else ():
            if _kind_in(box, kinds, known) is None:
                inside = (line[(line >= one.start) & (line < one.stop)] for line, one in zip(lines, box, strict=True))
                self.wanted[np.ix_(*inside)] = True
        return [(int(i), int(j)) for i, j in np.argwhere(self.wanted[np.ix_(*lines)])]

    def inferred(self, kinds: Kinds, known: NDArray[np.bool_]) -> Iterator[tuple[Index, Index]]:
        """Points that are not known, each with a known one whose kinds it has, when all that are wanted are known."""
        left = ~known
        for level in range(len(self.levels) - 1):
            for box in self._boxes(level):
                corner = _kind_in(box, kinds, known) if left[box].any() else None
                if corner is not None:
                    for i, j in (np.argwhere(left[box]) + [one.start for one in box]).tolist():
                        left[i, j] = False
                        yield (i, j), corner

    def _boxes(self, level: int) -> Iterator[tuple[slice, slice]]:
        """The cells of a lattice, with all four edges."""
        x, y = self.levels[level]
        for a, b in pairwise(x.tolist()):
            for c, d in pairwise(y.tolist()):
                yield slice(a, b + 1), slice(c, d + 1)


def _kind_in(box: tuple[slice, slice], kinds: Kinds, known: NDArray[np.bool_]) -> Index | None:
    """The first corner of a cell if all its known points are of the same kinds as that; else None."""
    there = kinds[(slice(None), *box)][:, known[box]]
    is_one = bool((there == there[:, :1]).all() and (there >= 0).all())
    return (box[0].start, box[1].start) if is_one else None


def _lattices(shape: Index) -> list[Lines]:
    """Nested lattices, each halving the last one, from COARSEST to all points."""
    x, y = (_halvings(count) for count in shape)
    count = max(len(x), len(y))
    # The axis with fewer points is as fine as can be while the other one still is halved.
    x, y = (lines + lines[-1:] * (count - len(lines)) for lines in (x, y))
    return list(zip(x, y, strict=True))


def _halvings(count: int) -> list[NDArray[np.intp]]:
    lines, found = np.unique([0, count // 2, count - 1]), []
    while True:
        gaps = np.diff(lines)
        if gaps.max(initial=1) <= COARSEST:
            found.append(lines)
        if gaps.max(initial=1) <= 1:
            return found
        lines = np.union1d(lines, (lines[:-1] + lines[1:] + 1) // 2)
