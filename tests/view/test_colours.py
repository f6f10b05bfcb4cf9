"""Colours are told apart by everyone: as normal eyes see them, and as those do who lack the red or the green receptor."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from shapespace.view import curve, panels, style

SIGHT = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
"""On linear RGB: Machado, Oliveira and Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009) 1291, severity 1."""
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
LINES, FIELDS = 20.0, 12.0
"""Least distances in CIELAB, where 2.3 is just seen: of lines, and of regions, which lie side by side."""


def seen(colours: list[object], sight: str) -> np.ndarray:
    """CIELAB (n, 3) of colours."""
    rgb = np.array([to_rgb(one) for one in colours])
    linear = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    relative = np.clip(linear @ SIGHT[sight].T, 0.0, 1.0) @ XYZ.T / XYZ.sum(axis=1)
    f = np.where(relative > 216 / 24389, np.cbrt(relative), (24389 / 27 * relative + 16.0) / 116.0)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def assert_told_apart(colours: list[object], sight: str, least: float) -> None:
    places = dict(zip(colours, seen(colours, sight), strict=True))
    for one, other in combinations(places, 2):
        assert np.linalg.norm(places[one] - places[other]) > least, (one, other, sight)


@pytest.mark.parametrize("sight", SIGHT)
def test_lines_and_regions_are_told_apart(sight: str):
    assert_told_apart([*style.LINES], sight, LINES)
    assert_told_apart([*style.REGIMES, "white"], sight, FIELDS)
    assert_told_apart([style.MEMBRANE, style.COAT], sight, LINES)


def test_whatever_is_drawn_is_of_these_colours():
    """Arrows, profiles, boundaries and powers."""
    from shapespace.view.budget import LINES as POWERS

    used = {colour for _, colour, _ in (*panels.VELOCITIES, *panels.CURVATURES)}
    used |= {*curve.COLOURS.values()} | {colour for _, colour, _ in POWERS.values()}
    assert used <= {*style.LINES}


@pytest.mark.parametrize("sight", SIGHT)
def test_maps_are_ordered_for_all(sight: str):
    """Lightness falls along the map of concentrations; from the middle of the signed one to both ends, which differ in hue."""
    places = np.linspace(0.0, 1.0, 41)
    lightness = seen([tuple(c) for c in style.regulator_map()(places)], sight)[:, 0]
    assert (np.diff(lightness) < 0.0).all()
    lab = seen([tuple(c) for c in style.signed_map()(places)], sight)
    assert (np.diff(lab[:21, 0]) > 0.0).all()
    assert (np.diff(lab[20:, 0]) < 0.0).all()
    assert_told_apart([tuple(style.signed_map()(place)) for place in (0.0, 0.25, 0.5, 0.75, 1.0)], sight, LINES)
