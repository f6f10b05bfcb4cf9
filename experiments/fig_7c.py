"""Fig. 7c: where the symmetrically divided surface is stable, over the turnover rate and the hydrodynamic length.

What. Turnover holds the contractile ring at the equator against its tendency to slip to a pole. At Pe = 450, Delta_c = 4
we compute the symmetric stationary surface on a grid in (k, R0/L_h) with the number of its growing modes. Where that
changes we locate the pitchfork and follow it in both parameters: the boundary as a curve, with the re-entrant finger that
Fig. S1 passes through (Sec. V B 2 of the paper). At some points the dynamics starts from that surface with a little of its
leading mode added: crosses, blue where it returns and red where it leaves.

Parameters: Table 5, Pe = 450, Delta_c = 4, c_s = 10. The ranges k = 10 to 50, R0/L_h = 0.3 to 6 are ours. Units: R0,
kappa, tau = eta_b R0^2/kappa.

Run:   python experiments/fig_7c.py [--quick] [--out DIR]        Time: 8 to 15 min on one core, --quick 30 s.

Expect: the surface is stable for k above a threshold, which is 37.594 at R0/L_h = 0.3 (Fig. 7d), and falls with R0/L_h
first; the boundary is not monotonic, and around R0/L_h = 4.6 a finger of instability reaches to k = 30.05, so
that at k = 28 stability is lost and found again at R0/L_h = 4.32662 and 4.84038 (Fig. S1).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D

import shapespace as ss
from common import Row, main, near, panels, save
from shapespace.study.boundaries import distances, find_changes
from shapespace.study.curve_store import Curve, outline
from shapespace.view import style
from shapespace.view.curve import MARKS
from shapespace.view.diagram import draw_boundaries, draw_regimes

TURNOVER, LENGTH = "turnover_rate", "inverse_hydrodynamic_length"
THRESHOLD = 37.594
"""k at R0/L_h = 0.3, by Fig. 7d."""
FINGER = (4.32662, 4.84038)
"""R0/L_h at k = 28, by Fig. S1."""
CHECKS = ((45.0, 0.3), (34.0, 0.3), (28.0, 3.5), (28.0, 4.6), (28.0, 5.1), (20.0, 1.0))
"""k and R0/L_h of the dynamic checks; the fourth is in the finger."""
KICK, SWIMS = 1e-2, 1e-2
"""Of the leading mode, and the speed from which on a surface has left the symmetric one."""
TURNING = "degenerate-pitchfork"
"""Special points where the pitchfork turns from super- to subcritical."""


def run(out: Path, quick: bool) -> list[Row]:
    """The map with its boundary, figure, table."""
    axes = (f"{TURNOVER}=35:45:3", f"{LENGTH}=0.3:0.5:2") if quick else (f"{TURNOVER}=10:50:41", f"{LENGTH}=0.3:6:58")
    found = ss.diagram(
        ss.scenario("guided-division"), *axes, stability=True, boundaries=True, out=out / "map", resume=True,
        workers=1 if quick else None,
    )  # fmt: skip
    rows = check_boundary(found) + check_threshold(found)
    seen = dynamics(found.scenario, CHECKS[:1] if quick else CHECKS)
    draw(found, seen, out)
    return rows + ([] if quick else check_finger(found)) + check_dynamics(found, seen)


def crossings(curve: Curve, key: str, value: float) -> list[float]:
    """Values of the other key where a curve passes a value of one."""
    at = curve.keys.index(key)
    values, others = outline(curve.points)[[at, 1 - at]]
    below = values < value
    places = np.flatnonzero(below[1:] != below[:-1])
    shares = (value - values[places]) / (values[places + 1] - values[places])
    return sorted((others[places] + shares * (others[places + 1] - others[places])).tolist())


def check_boundary(found: ss.Diagram) -> list[Row]:
    """The map's changes of stability lie on curves of pitchforks."""
    changes = find_changes(found)
    places = np.stack([change.middle for change in changes])
    apart = np.min([distances(places, curve, found) for curve in found.boundaries], axis=0).max()
    kinds = {curve.of for curve in found.boundaries}
    counts = found.dataset["n_unstable"]
    return [
        Row("symmetric surface", "stable and unstable", f"{int(counts.min())} to {int(counts.max())} growing modes", "",
            int(counts.min()) == 0 and int(counts.max()) > 0),
        Row("boundary", "an interface", f"{len(found.boundaries)} curves: {', '.join(sorted(kinds))}", "", "pitchfork" in kinds),
        Row("changes of the map, cells from it", "-", f"{apart:.2f}", "", bool(apart < 1.0) and not found.unexplained,
            "not in the paper"),
        Row("states on the grid", "all", f"{found.converged} of {found.points}", "", found.converged == found.points),
    ]  # fmt: skip


def check_threshold(found: ss.Diagram) -> list[Row]:
    """The turnover rate above which the ring stays in place where screening is weak."""
    ends = [point.parameters for curve in found.boundaries for point in curve.points]
    keys = found.boundaries[0].keys
    k, length = keys.index(TURNOVER), keys.index(LENGTH)
    value = float(min(ends, key=lambda one: abs(one[length] - 0.3) + 1e-3 * abs(one[k] - THRESHOLD))[k])
    return [near("R0/L_h = 0.3: stable for k above (Fig. 7d)", "a threshold", value, THRESHOLD, 1e-3)]


def check_finger(found: ss.Diagram) -> list[Row]:
    """Where stability is lost and found again at k = 28."""
    passed = sorted(value for curve in found.boundaries for value in crossings(curve, TURNOVER, 28.0))
    pair = [min(passed, key=lambda one: abs(one - wanted)) for wanted in FINGER]
    return [
        near(f"k = 28: stability {word} at R0/L_h (Fig. S1)", "a finger", value, wanted, 5e-3)
        for word, value, wanted in zip(("lost", "found again"), pair, FINGER, strict=True)
    ]


def dynamics(case: ss.Scenario, points: Sequence[tuple[float, float]]) -> dict[tuple[float, float], float]:
    """Speeds at the ends of runs from the symmetric surface with a little of its leading mode."""
    speeds = {}
    for turnover, length in points:
        at = case.with_overrides({TURNOVER: turnover, LENGTH: length, "until": 500.0})
        found = ss.run(at, start=ss.steady(at).perturbed(KICK))
        speeds[turnover, length] = abs(found.observables["velocity"])
    return speeds


def check_dynamics(found: ss.Diagram, seen: dict[tuple[float, float], float]) -> list[Row]:
    """The dynamics leaves the symmetric surface where the map says that it is unstable."""
    counts = found.dataset["n_unstable"]
    rows = []
    for (turnover, length), speed in seen.items():
        count = int(counts.sel({TURNOVER: turnover, LENGTH: length}, method="nearest"))
        expected = "leaves" if count else "returns"
        told = f"{'leaves' if speed > SWIMS else 'returns'}, speed {speed:.1e}"
        rows.append(
            Row(f"dynamics at k = {turnover:g}, R0/L_h = {length:g}", expected, told, "", told.startswith(expected))
        )
    return rows


def draw(found: ss.Diagram, seen: dict[tuple[float, float], float], out: Path) -> None:
    """Regimes by stability, with the boundary and the dynamic checks."""
    with style.house_style():
        figure, (axes,) = panels((1.0,), 90.0)
        draw_regimes(axes, found, found.regimes)
        draw_boundaries(axes, found)
        for point, speed in seen.items():
            colour, told = (style.RED, "dynamics leaves") if speed > SWIMS else (style.BLUE, "dynamics returns")
            axes.plot(*point, "x", color=colour, ms=5.0, zorder=4, label=told)
        axes.set_xlabel(style.quantity_label(found.scenario.scales, TURNOVER))
        axes.set_ylabel(style.quantity_label(found.scenario.scales, LENGTH))
        handles, names = axes.get_legend_handles_labels()
        once = dict(zip(names, handles, strict=True))
        if any(point.kind == TURNING for curve in found.boundaries for point in curve.special_points):
            once["turns subcritical"] = Line2D([], [], color=style.RED, linestyle="", marker=MARKS[TURNING], ms=4.0)
        figure.legend(once.values(), once.keys(), loc="outside right upper")
        save(figure, out, "fig_7c")


if __name__ == "__main__":
    main(run)
