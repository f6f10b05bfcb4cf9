"""Fig. 5: swimming speed and shape polarity of polarized surfaces over Peclet number and hydrodynamic length.

What. Above a critical Peclet number a sphere with uniform turnover polarizes and swims. We compute the stationary
swimmer at every point of a grid in (Pe, R0/L_h) directly, each from its neighbours, and map its speed v0 (a) and the
polarity P = 1 - H(0)/H(1) of its shape (b) (Sec. V B 1 of the paper). Shapes are those of its rows in (c) and (d).

Parameters: Table 5 with k = 9, c_s = c0 (Fig. 5). The ranges of the grid are not named in the text: Pe = 25 to 300,
R0/L_h = 0.1 to 10 are ours; 500 x 500 points as in the paper. Units: R0, kappa, tau = eta_b R0^2/kappa.

Run:   python experiments/fig_5abcd.py [--quick] [--out DIR]        Time: 3 to 12 min on two cores, --quick 1 min.

Expect: every point converges to 1e-8; where screening is strong (R0/L_h >> 1) speed and polarity rise with Pe; at Pe =
300 the polarity rises with R0/L_h and saturates, while the speed hardly changes. Along R0/L_h = 5 and Pe = 300 the map
has the values of single solves.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import shapespace as ss
from common import Row, draw_starts, main, near, save
from shapespace.study.starts import Start
from shapespace.view import style

PECLET, LENGTH = "peclet", "inverse_hydrodynamic_length"
FIRST, LAST, SHORT, LONG = 25.0, 300.0, 0.1, 10.0
PAPER = 500
"""Points on a side of the paper's grid."""
SHOWN = ([(35.0, 5.0), (120.0, 5.0), (300.0, 5.0)], [(300.0, 0.1), (300.0, 2.0), (300.0, 10.0)])
"""States of (c) and of (d)."""


def run(out: Path, quick: bool) -> list[Row]:
    """The map, figure, table."""
    count = 12 if quick else PAPER
    axes = f"{PECLET}={FIRST:g}:{LAST:g}:{count}", f"{LENGTH}={SHORT:g}:{LONG:g}:{count}"
    case = ss.scenario("polar-swimmer")
    workers = 1 if quick else None
    found = ss.diagram(case, *axes, out=out / "map", resume=True, workers=workers)
    rows = check_map(found, count)
    if not quick:
        draw(found, out)
        return rows + check_points(found, ((250, 250), (30, 480)))
    draw(found, out)
    return rows + check_points(found, ((7, 6),))


def check_map(found: ss.Diagram, count: int) -> list[Row]:
    """How many converged of count x count, and how speed and polarity change over the map."""
    data = found.dataset
    speed, polarity = (np.abs(data[name].transpose(LENGTH, PECLET).to_numpy()) for name in ("velocity", "polarity"))
    lengths = data[LENGTH].to_numpy()
    screened = lengths >= 4.0
    along = polarity[:, -1]
    early, late = (np.interp(pair, lengths, along) for pair in ((1.0, 3.0), (8.0, 10.0)))
    last = speed[:, -1]
    worst = float(data["correction"].max())
    lost = found.points - found.converged
    rising = [bool((np.diff(values[screened], axis=1) > 0.0).all()) for values in (speed, polarity)]
    return [
        Row("states on the grid", "500 x 500", f"{count} x {count}, {lost} without a state, corrections < {worst:.0e}", "",
            lost < 1e-3 * found.points and worst < 1e-8, "agrees" if count == PAPER else "coarser"),
        Row("speed rises with Pe at R0/L_h >> 1", "yes", f"to {speed[screened].max():.2f}", "", rising[0]),
        Row("polarity rises with Pe there", "yes", f"to {polarity[screened].max():.3f}", "", rising[1]),
        Row("Pe = 300: polarity with R0/L_h", "rises, saturates", f"{along[0]:.3f} to {along[-1]:.3f}", "",
            along[-1] > along[0] and early[1] - early[0] > 5.0 * abs(late[1] - late[0])),
        Row("Pe = 300: speed with R0/L_h", "roughly constant", f"{last.min():.2f} to {last.max():.2f}", "",
            bool(np.ptp(last[lengths >= 1.0]) < 0.5 * last.max())),
    ]  # fmt: skip


def check_points(found: ss.Diagram, places: tuple[tuple[int, int], ...]) -> list[Row]:
    """Points of the map against states that are found by themselves."""
    rows = []
    for i, j in places:
        point = found.dataset.isel({PECLET: i, LENGTH: j})
        keys = {name: float(point[name]) for name in (PECLET, LENGTH)}
        single = ss.steady(found.scenario.with_overrides(keys)).observables
        told = f"speed at Pe = {keys[PECLET]:.4g}, R0/L_h = {keys[LENGTH]:.3g} (by itself)"
        rows.append(
            near(told, f"{abs(single['velocity']):.8g}", abs(float(point["velocity"])), abs(single["velocity"]), 1e-5)
        )
    return rows


def draw(found: ss.Diagram, out: Path) -> None:
    """Speed and polarity with contours, and below shapes along R0/L_h = 5 and along Pe = 300."""
    with style.house_style():
        figure = style.new_figure(1.0, 115.0)
        axes = figure.subplots(2, 2, height_ratios=(1.0, 0.5))
        data, scales = found.dataset, found.scenario.scales
        for place, name in zip(axes[0], ("velocity", "polarity"), strict=True):
            values = np.abs(data[name].transpose(LENGTH, PECLET))
            image = place.pcolormesh(data[PECLET], data[LENGTH], values, cmap=style.regulator_map(), rasterized=True)
            place.contour(data[PECLET], data[LENGTH], values, levels=8, colors=style.INK, linewidths=0.4)
            figure.colorbar(
                image, ax=place, label=f"magnitude of {style.quantity_label(scales, name)}"
            ).outline.set_visible(False)
            place.set_xlabel(style.quantity_label(scales, PECLET))
        axes[0, 0].set_ylabel(style.quantity_label(scales, LENGTH))
        for place, shown, number in zip(axes[1], SHOWN, (0, 1), strict=True):
            draw_shapes(place, found.scenario, shown, number)
            other = 1 - number
            place.set_title(style.quantity_value(scales, (PECLET, LENGTH)[other], shown[0][other]))
        for place, letter in zip(axes.flat, "abcd", strict=True):
            place.set_title(f"({letter})", loc="left", fontweight="bold")
        save(figure, out, "fig_5abcd")


def draw_shapes(axes: Axes, case: ss.Scenario, shown: list[tuple[float, float]], number: int) -> None:
    """States side by side, each with the key that differs."""
    states = [ss.steady(case.with_overrides({PECLET: peclet, LENGTH: length})) for peclet, length in shown]
    names = [style.quantity_value(case.scales, (PECLET, LENGTH)[number], keys[number]) for keys in shown]
    draw_starts(axes, [Start("", state.scenario, state.frame) for state in states], names)


if __name__ == "__main__":
    main(run)
