"""The matching against scipy's."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from shapespace.numerics.matching import cheapest_matching


@pytest.mark.parametrize("levels", [2, 5, 1000])
@pytest.mark.parametrize("m", [1, 2, 3, 8, 15])
def test_as_cheap_as_scipys(m: int, levels: int):
    rng = np.random.default_rng(m + levels)
    for _ in range(50):
        costs = rng.integers(-levels, levels, (m, m)).astype(float)
        costs[rng.random((m, m)) < 0.3] = 1e3
        partner = cheapest_matching(costs)
        rows, columns = linear_sum_assignment(costs)
        assert sorted(partner) == list(range(m))
        assert costs[rows, partner].sum() == costs[rows, columns].sum()
