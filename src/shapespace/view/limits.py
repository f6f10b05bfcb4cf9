"""Limits and scales of axes: decades on both sides of zero without a kink, and no change so small that it is round-off."""

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator

from shapespace.study.telling import LEAST_CHANGE

Limits = tuple[float, float]


def not_magnified(low: float, high: float, scale: float) -> Limits:
    """The range of some values, or one of the width of their scale around them where they differ by round-off only.

    scale: of the quantity, its unit in the solver; values that are larger are a scale of their own.
    """
    scale = max(scale, abs(low), abs(high))
    if high - low > LEAST_CHANGE * scale:
        return low, high
    middle = 0.5 * (low + high)
    return middle - 0.5 * scale, middle + 0.5 * scale


def scale_by_powers(axes: Axes, which: Literal["x", "y"], linear: float, span: Limits, room: float) -> None:
    """A scale that is linear within `linear` of zero and logarithmic beyond, over a span that contains zero.

    Unlike one that is pieced together, asinh has no kink where both meet. Ticks are at zero and at whole powers of ten, no
    closer to each other than the part `room` of the axis.
    """
    width = 0.5 * linear
    low, high = (float(np.arcsinh(end / width)) for end in span)
    ticks = [0.0]
    for sign, end in ((-1.0, -span[0]), (1.0, span[1])):
        last = np.inf
        for power in range(
            int(np.floor(np.log10(max(end, linear)) + 1e-9)), int(np.floor(np.log10(linear) + 1e-9)) - 1, -1
        ):
            place = float(np.arcsinh(10.0**power / width))
            if 10.0**power <= end and min(place, last - place) >= room * (high - low):
                ticks.append(sign * 10.0**power)
                last = place
    if which == "x":
        axes.set_xscale("asinh", linear_width=width)
    else:
        axes.set_yscale("asinh", linear_width=width)
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(FixedLocator(sorted(ticks)))
    axis.set_minor_locator(NullLocator())
