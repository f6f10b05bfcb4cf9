"""Outlines that are simple and outlines that cross themselves."""

import numpy as np
import pytest

from shapespace.geometry.contact import self_crossing


def outline(overlap: float, points: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """A bud on a neck as a curve whose neck radius is -overlap at its narrowest: r = sin(t) (1 + ...) pinched at the middle."""
    t = np.linspace(0.0, np.pi, points)
    return np.sin(t) * (np.cos(t) ** 2 - overlap), 2.0 * np.cos(t)


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_spheres_and_discs_are_simple(radius: float):
    angle = np.linspace(0.0, np.pi, 300)
    assert self_crossing(radius * np.sin(angle), radius * np.cos(angle)) is None
    assert self_crossing(np.linspace(0.0, radius, 50), np.zeros(50)) is None


@pytest.mark.parametrize("overlap", [-0.1, -1e-3])
def test_a_thin_neck_is_no_contact(overlap: float):
    assert self_crossing(*outline(overlap)) is None


@pytest.mark.parametrize("overlap", [1e-3, 0.1])
def test_a_neck_through_the_axis_is_found(overlap: float):
    found = self_crossing(*outline(overlap))
    assert found is not None
    assert found[0] == found[1]


@pytest.mark.parametrize(("width", "crosses"), [(0.5, False), (1.05, False), (1.3, True), (1.6, True)])
def test_an_omega_that_closes_its_mouth_crosses_itself(width: float, crosses: bool):
    """A stomatocyte's mouth: an arc of a torus section that turns by more than a full circle meets its own start."""
    turn = np.linspace(-np.pi * width, np.pi * width, 401)
    grow = 1.0 + 0.02 * np.abs(turn)
    r, z = 3.0 + grow * np.cos(turn), np.sin(turn) * grow + 0.1 * turn
    found = self_crossing(r, z)
    assert (found is not None) == crosses
    if found is not None:
        i, j = found
        gap = np.hypot(r[i] - r[j], z[i] - z[j])
        assert gap < 2.0 * np.hypot(np.diff(r), np.diff(z)).max()
