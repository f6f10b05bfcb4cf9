"""The grid of a diagram: its tiles, where they start from, where searches begin, and which of its states are stored."""

import numpy as np
import pytest

from shapespace.study.grid import STORED_WHOLE, Axis, Grid


def test_tiles_cover_the_grid_once():
    for counts in ((2, 500), (9, 10), (11, 26), (101, 77)):
        grid = Grid(*(Axis(key, 0.0, 1.0, count) for key, count in zip(("a", "b"), counts, strict=True)))
        assert [grid.number(tile) for tile in grid.tiles] == [*range(len(grid.tiles))]
        met = np.zeros(grid.shape, int)
        for tile in grid.tiles:
            span = grid.span(tile)
            met[span] += 1
            i, j = grid.x.anchors[tile[0]], grid.y.anchors[tile[1]]
            assert span[0].start <= i < span[0].stop
            assert span[1].start <= j < span[1].stop
            assert met[span].size <= 625
        assert (met == 1).all()


def test_searches_are_spread_over_the_map():
    """The same ones first, whatever their number."""
    grid = Grid(Axis("a", 0.0, 1.0, 16), Axis("b", 0.0, 1.0, 9))
    assert grid.spread(1) == [(8, 3)]
    places = grid.spread(12)
    assert places[:5] == grid.spread(5)
    assert len({*places}) == 12
    assert {(i // 8, j // 5) for i, j in places} == {(0, 0), (0, 1), (1, 0), (1, 1)}


def test_places_that_tiles_start_from():
    """Middles of tiles, tile after tile, and with several tiles their borders and those of the map as well."""
    grid = Grid(Axis("a", 0.0, 1.0, 30), Axis("b", 0.0, 1.0, 9))
    assert grid.middles == [(7, 4), (22, 4)]
    assert grid.nodes == [(7, 4), (22, 4), (0, 4), (15, 4), (29, 4)]


@pytest.mark.parametrize(
    ("counts", "states"), [((2, 2), 1), ((30, 40), 2), ((100, 50), 1), ((76, 2), 1), ((500, 500), 3)]
)
def test_states_that_are_stored_whole(counts: tuple[int, int], states: int):
    """No more than some, in each tile alike, and all of a small map."""
    grid = Grid(*(Axis(key, 0.0, 1.0, count) for key, count in zip(("a", "b"), counts, strict=True)))
    chosen = [grid.chosen(tile, states) for tile in grid.tiles]
    for tile, places in zip(grid.tiles, chosen, strict=True):
        assert len({*places}) == len(places) > 0
        assert all(grid.tile_of(place) == tile for place in places)
    total = states * sum(map(len, chosen))
    assert total <= max(STORED_WHOLE, states * len(grid.tiles))
    if states * np.prod(counts) <= STORED_WHOLE:
        assert total == states * np.prod(counts)
