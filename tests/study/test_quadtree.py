"""Quad-trees of tiles: the same map as all points for regions that cross an edge, whatever their shape; what is wanted of it."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from shapespace.analysis.sweeping import Index
from shapespace.study.quadtree import COARSEST, QuadTree


def mapped(kinds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a quad-tree makes of kinds (1, n, m), and which points it wanted."""
    shape: Index = kinds.shape[1:]
    tree, known = QuadTree(shape), np.zeros(shape, bool)
    seen = np.zeros_like(kinds)
    count = -1
    while known.sum() > count:
        count = int(known.sum())
        for level, (x, y) in enumerate(tree.levels):
            for i, j in tree.refine(level, seen, known):
                seen[:, x[i], y[j]], known[x[i], y[j]] = kinds[:, x[i], y[j]], True
    assert known[tree.wanted].all()
    wanted = known.copy()
    for at, like in tree.inferred(seen, known):
        seen[(slice(None), *at)] = seen[(slice(None), *like)]
        known[at] = True
    assert known.all()
    return seen, wanted


@settings(max_examples=40)
@given(st.integers(2, 30), st.integers(2, 30), st.floats(0.0, 6.3), st.floats(-0.6, 0.6), st.floats(0.05, 0.3))
def test_regions_that_cross_an_edge_are_whole(n: int, m: int, angle: float, offset: float, width: float):
    """A strip of any direction and width, with waves on its sides."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, n), np.linspace(-1.0, 1.0, m), indexing="ij")
    along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
    kinds = (np.abs(across - offset + 0.1 * np.sin(5.0 * along)) < width).astype(np.int64)[None]
    assume(all(reaches_the_edge(kinds[0] == kind) for kind in (0, 1)))
    found, _ = mapped(kinds)
    assert (found == kinds).all()


def reaches_the_edge(region: np.ndarray) -> bool:
    """Whether all pieces do; sampled coarsely, a strip may leave single points."""
    pieces, count = label(region, np.ones((3, 3)))
    inner = pieces[1:-1, 1:-1]
    outer = pieces.copy()
    outer[1:-1, 1:-1] = 0
    return {*np.unique(inner).tolist(), *range(1, count + 1)} - {0} <= {*np.unique(outer).tolist()}


def test_one_kind_needs_the_edge_and_a_lattice():
    _, wanted = mapped(np.full((2, 25, 25), 3))
    assert wanted.sum() == 4 * 24 + 9
    assert np.diff(np.flatnonzero(wanted[12])).max() <= COARSEST


def test_a_wave_front_costs_what_it_is_long():
    counts = []
    for size in (17, 33, 65):
        x, y = np.indices((size, size)) / size
        found, wanted = mapped((np.hypot(x, y) < 0.7).astype(np.int64)[None])
        assert (found[0] == (np.hypot(x, y) < 0.7)).all()
        counts.append(int(wanted.sum()) - 4 * (size - 1) - ((size - 1) // COARSEST - 1) ** 2)
    assert counts[2] < 2.4 * counts[1] < 2.4**2 * counts[0] < 2.4**2 * 17 * 17 // 2


def test_what_may_not_be_inferred_is_computed():
    kinds = np.zeros((1, 17, 17), np.int64)
    kinds[0, 9:, :] = -1
    found, wanted = mapped(kinds)
    assert (found == kinds).all()
    assert wanted[8:].all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (2, 2), (3, 40)])
def test_small_and_thin_tiles(shape: Index):
    kinds = np.arange(np.prod(shape)).reshape(1, *shape)
    assert (mapped(kinds)[0] == kinds).all()
