"""Outlines of states: the generating curve and its mirror image, coloured by what the surface carries."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from shapespace.study.dataset import profile_of
from shapespace.study.frame import Frame
from shapespace.study.scenario import Scenario
from shapespace.view import style
from shapespace.view.frames import REGULATORS


def draw_outline(
    axes: Axes, scenario: Scenario, frame: Frame, at: tuple[float, float] = (0.0, 0.0), width: float = 2.0
) -> None:
    """The section of a state through its axis, in the scenario's units of length, its origin moved to `at`.

    Colours: the regulator's concentration, each state on its own scale, or the coat.
    """
    profile = profile_of(scenario, frame)
    name = REGULATORS[scenario.kind]
    r, z, carried = profile["radius"], profile["axial_position"], profile[name]
    colours = style.coat_map() if scenario.kind == "open-membrane" else style.regulator_map()
    for side in (1.0, -1.0):
        points = np.stack([at[0] + side * r, at[1] + z], axis=-1)
        segments = np.stack([points[:-1], points[1:]], axis=1)
        lines = LineCollection(list(segments), cmap=colours, linewidth=width, capstyle="round")
        lines.set_norm(Normalize(min(0.0, float(carried.min())), max(float(carried.max()), 1e-12)))
        lines.set_array(0.5 * (carried[1:] + carried[:-1]))
        axes.add_collection(lines)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
