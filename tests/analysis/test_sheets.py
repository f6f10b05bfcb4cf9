"""Sheets of a cubic, folded at a cusp: at every point all of its roots, from one of them."""

import numpy as np
import pytest
from tests.algebraic import AlgebraicProblem

from shapespace.analysis.sheets import spread_sheets, states_at
from shapespace.analysis.stationary import Stationary
from shapespace.base.outcome import Outcome

PROBLEM = AlgebraicProblem(lambda x, p: p[0] + p[1] * x - x**3, 1)
"""Folds at 27 a^2 = 4 b^3, which meet in a cusp at zero."""


def grid(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1)


def roots(p: np.ndarray) -> np.ndarray:
    """Real ones in order."""
    found = np.roots([-1.0, 0.0, p[1], p[0]])
    return np.sort(found.real[np.abs(found.imag) < 1e-9])


@pytest.mark.parametrize("at", [(0, 0), (12, 8), (6, 10)])
def test_all_roots_at_every_point(at: tuple[int, int]):
    values = grid(np.linspace(-1.0, 1.07, 17), np.linspace(-0.5, 1.5, 12))
    x = roots(values[at])[:1]
    start = Stationary(PROBLEM, x, values[at], Outcome.CONVERGED, 0.0, 0.0, 0, True)
    sheets = spread_sheets(values, [(at, start)])
    for place in np.ndindex(*values.shape[:2]):
        expected = roots(values[place])
        found = sorted(float(state.x[0]) for state in states_at(sheets, place))
        assert len(found) == len(expected), (place, values[place], found, expected)
        np.testing.assert_allclose(found, expected, atol=1e-7)
