"""The figure of a mode: how a small perturbation displaces the outline, how it flows, and its profiles along the curve."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shapespace.base.scales import Scales
from shapespace.study.modes import CRITICAL, ModeProfiles, Modes
from shapespace.view import style

DISPLACEMENT = 0.12
"""Of the drawn mode at its largest, relative to the size of the surface; so long is the longest arrow, too."""
ARROWS = 13
HEIGHT_MM = 95.0


def plot_mode(modes: Modes, index: int) -> Figure:
    """Mode number `index`, 0 being the leading one; of a pair the real part."""
    profiles = modes.profiles(index)
    with style.house_style():
        figure = style.new_figure(1.0, HEIGHT_MM)
        outline, curves = figure.subplots(1, 2, width_ratios=(1.0, 1.1))
        _draw_outline(outline, modes, profiles)
        _draw_profiles(curves, profiles, modes.scenario.scales)
        figure.suptitle(_title(modes, index), fontsize=8.5)
    return figure


def _draw_outline(axes: Axes, modes: Modes, at: ModeProfiles) -> None:
    """The state, the state displaced either way, and arrows of the velocity that belongs to the first of these."""
    unit = modes.scenario.scales.factor("length")
    size = max(float(at.r.max()), 0.5 * float(np.ptp(at.z)))
    sin, cos = np.sin(at.angle), np.cos(at.angle)
    displacement, tangential, normal = at.displacement.real, at.tangential.real, at.normal.real
    largest = float(np.abs(displacement).max())
    moved = DISPLACEMENT * size * displacement / largest if largest > 1e-9 * _largest(at) else 0.0 * at.u
    for side in (1.0, -1.0):
        for sign, colour, word in ((1.0, style.RED, "with the mode"), (-1.0, style.BLUE, "against it")):
            r, z = at.r + sign * moved * sin, at.z + sign * moved * cos
            axes.plot(unit * side * r, unit * z, color=colour, linewidth=0.9, label=word if side > 0.0 else None)
        label = "state" if side > 0.0 else None
        axes.plot(unit * side * at.r, unit * at.z, color=style.INK, linewidth=1.6, label=label)
    v_r, v_z = tangential * cos + normal * sin, -tangential * sin + normal * cos
    fastest = float(np.hypot(v_r, v_z).max())
    if fastest > 0.0:
        length = np.append(0.0, np.cumsum(np.hypot(np.diff(at.r), np.diff(at.z))))
        places = np.searchsorted(length, np.linspace(0.0, length[-1], ARROWS + 2)[1:-1])
        scale = 2.0 * DISPLACEMENT * size / fastest * unit
        for side in (1.0, -1.0):
            tails, heads = (side * at.r[places], at.z[places]), (side * v_r[places], v_z[places])
            axes.quiver(
                *(unit * tail for tail in tails), *(scale * head for head in heads),
                color=style.GREEN, angles="xy", scale_units="xy", scale=1.0, width=0.005, zorder=4,
            )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlabel(style.quantity_label(modes.scenario.scales, "radius"))
    axes.set_ylabel(style.quantity_label(modes.scenario.scales, "axial_position"))
    axes.margins(0.12)
    axes.plot([], [], color=style.GREEN, label="velocity of the mode")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _draw_profiles(axes: Axes, at: ModeProfiles, scales: Scales) -> None:
    """Each relative to its own largest value; what is zero throughout is left out."""
    curves = {
        "normal displacement": (at.displacement.real, style.RED),
        "tangential velocity": (at.tangential.real, style.GREEN),
        "concentration": (None if at.regulator is None else at.regulator.real, style.PURPLE),
    }
    axes.axhline(0.0, color=style.FAINT, linewidth=0.6)
    for word, (values, colour) in curves.items():
        if values is not None and np.abs(values).max() > 1e-9 * _largest(at):
            axes.plot(at.u, values / np.abs(values).max(), color=colour, label=word)
    axes.set_xlabel(style.quantity_label(scales, "mesh_coordinate"))
    axes.set_ylabel("change, relative to its largest")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _largest(at: ModeProfiles) -> float:
    parts = (at.displacement, at.tangential, at.regulator)
    return max(float(np.abs(part.real).max()) for part in parts if part is not None)


def _title(modes: Modes, index: int) -> str:
    """Mode, growth rate with its unit, parity, neutral or not."""
    growth, frequency = modes.growth_rates[index]
    unit = style.math_units(modes.scenario.scales.unit("turnover_rate"))
    pair = rf" $\pm$ {style.number(abs(frequency), 5)} i" if frequency else ""
    name = modes.neutral.get(index)
    kinds = [modes.parities[index] if index < len(modes.parities) else None]
    kinds.append(None if name is None else f"neutral: {name or CRITICAL}")
    told = ", ".join(kind for kind in kinds if kind)
    rate = f"growth rate {style.number(growth, 5)}{pair} {unit}".rstrip()
    return f"{modes.scenario.name}, mode {index}: {rate}" + (f" ({told})" if told else "")
