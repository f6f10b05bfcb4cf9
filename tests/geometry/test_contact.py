"""Outlines that are simple and outlines that cross themselves."""

import numpy as np
import pytest

from shapespace.base.arrays import Array
from shapespace.geometry.contact import Outline, crosses_itself

U = np.linspace(0.0, 1.0, 240)


def pinched(overlap: float) -> Outline:
    """A bud on a neck whose radius is -overlap at its narrowest."""
    return lambda u: (np.sin(np.pi * u) * (np.cos(np.pi * u) ** 2 - overlap), 2.0 * np.cos(np.pi * u))


def lips(gap: float) -> Outline:
    """Two lips that touch at t = -1 and 1 where the gap vanishes: z = t ((t^2 - 1)^2 + gap), r = 3 + t^2."""

    def outline(u: Array) -> tuple[Array, Array]:
        t = 3.0 * u - 1.5
        return 3.0 + t**2, t * ((t**2 - 1.0) ** 2 + gap)

    return outline


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_spheres_and_discs_are_simple(radius: float):
    assert not crosses_itself(lambda u: (radius * np.sin(np.pi * u), radius * np.cos(np.pi * u)), U)
    assert not crosses_itself(lambda u: (radius * u, 0.0 * u), U)


@pytest.mark.parametrize("overlap", [-0.1, -1e-3])
def test_a_thin_neck_is_no_contact(overlap: float):
    assert not crosses_itself(pinched(overlap), U)


@pytest.mark.parametrize("overlap", [1e-3, 0.1])
def test_a_neck_through_the_axis_is_found(overlap: float):
    assert crosses_itself(pinched(overlap), U)


@pytest.mark.parametrize("gap", [0.1, 1e-3, 1e-6])
def test_first_contact_is_seen_far_below_the_distance_of_samples(gap: float):
    assert not crosses_itself(lips(gap), U)
    assert crosses_itself(lips(-gap), U)


@pytest.mark.parametrize(("width", "crosses"), [(0.5, False), (1.05, False), (1.3, True), (1.6, True)])
def test_an_omega_that_closes_its_mouth_crosses_itself(width: float, crosses: bool):
    """A stomatocyte's mouth: an arc of a torus section that turns by more than a full circle meets its own start."""

    def outline(u: Array) -> tuple[Array, Array]:
        turn = np.pi * width * (2.0 * u - 1.0)
        grow = 1.0 + 0.02 * np.abs(turn)
        return 3.0 + grow * np.cos(turn), np.sin(turn) * grow + 0.1 * turn

    assert crosses_itself(outline, U) == crosses
