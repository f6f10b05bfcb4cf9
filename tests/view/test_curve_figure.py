"""The outline of a curve: smooth through its points, and pointed at a cusp."""

from types import SimpleNamespace

import numpy as np
import pytest

from shapespace.study.curve_store import outline


def point(s: float) -> SimpleNamespace:
    """Of the folds of a + b x - x^3: (a, b) = (-2 s^3, 3 s^2)."""
    return SimpleNamespace(
        place=s, parameters=np.array([-2.0 * s**3, 3.0 * s**2]), slope=np.array([-6.0 * s**2, 6.0 * s])
    )


def test_a_cusp_is_pointed():
    """Cubics are exact here: every point drawn lies on the curve, also between -1 and 0.5, where the points miss the cusp."""
    a, b = outline([point(s) for s in (-1.0, -1.0, 0.5, 2.0)])
    np.testing.assert_allclose(27.0 * a**2, 4.0 * b**3, atol=1e-12)
    assert b.min() < 0.05


def test_one_point_is_no_line():
    assert outline([point(1.0)]).shape == (2, 1)
    assert outline([point(1.0)])[:, 0] == pytest.approx([-2.0, 3.0])
