"""Fig. 3d: shapes of a coated membrane under a pull of F/2pi = 0.7 that relax to a state without or with neck.

What. At this force fig_3c.py has stable states on two branches that do not meet. Which one the membrane relaxes to, at
fixed force, depends on its initial shape (Sec. V A 2 of the paper). The paper does not say what its initial shapes are;
ours are a flat disc, the state without neck pulled on to d0 = 0.67 R_b, and the states with neck at F = 0 and at F/2pi
= 3.

Parameters: Table 4, C0 R_b = 9, F/2pi = 0.7 kappa/R_b. Units: R_b, kappa, tau = eta_s R_b^2/kappa.

Run:   python experiments/fig_3d.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 15 s.

Expect: the first two come to the state without neck, the other two to the one with neck, at the heights of the
branches.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, draw_starts, labelled, main, near, panels, save
from fig_3b import pulled_out
from fig_3c import KEY, SHOWN, TURN, coated
from shapespace.study.branch_point import BranchPoint
from shapespace.study.starts import Start
from shapespace.view import style

WITHOUT, WITH = "without neck", "with neck"
HIGH = 3.0 * TURN
PULLED = 0.67


def run(out: Path, quick: bool) -> list[Row]:
    """Branches, relaxations, figure, table."""
    branches = coated(out, quick)
    targets = {name: stable_at(branch, SHOWN) for name, branch in branches.items()}
    case = branches[WITHOUT].scenario.with_overrides({KEY: SHOWN, "until": 50.0, "time_tolerance": 1e-5})
    flat = ss.steady(case.with_overrides({KEY: 0.0, "spontaneous_curvature": 0.0}), state="trivial")
    start, high = branches[WITH]["start"], min(branches[WITH].points, key=lambda point: abs(point.parameter - HIGH))
    starts = {
        "flat": (Start("flat", case, flat.frame), WITHOUT),
        "pulled, no neck": (pulled_out(case, branches[WITHOUT], targets[WITHOUT].label, PULLED), WITHOUT),
        "neck, F = 0": (Start("necked", branches[WITH].scenario_at(start), start.frame), WITH),
        f"neck, F/2pi = {high.parameter / TURN:.1f}": (
            Start("high", branches[WITH].scenario_at(high), high.frame),
            WITH,
        ),
    }
    runs = {name: ss.run(case, start=first) for name, (first, _) in starts.items()}
    rows = []
    for name, found in runs.items():
        target = targets[starts[name][1]]
        rows += [
            Row(f"{name}: neck at the end", starts[name][1], f"{found.observables.get('neck_radius', np.nan):.4f}", "",
                ("neck_radius" in found.observables) == (starts[name][1] == WITH)),
            near("height", "shown, no number", found.observables["height"], target.observables["height"], 1e-5),
        ]  # fmt: skip
    draw(runs, out)
    return rows


def stable_at(branch: ss.Branch, force: float) -> BranchPoint:
    """The state at a force on the part of a branch that starts at its first point, which is stable."""
    points = [point for point in labelled(branch, "user") if point.parameter == force]
    return min(points, key=lambda point: abs(point.place))


def draw(runs: dict[str, ss.Run], out: Path) -> None:
    """Heights over time, and the shapes at both ends."""
    with style.house_style():
        figure, (left, starts, ends) = panels((1.4, 1.0, 1.0), 80.0)
        colours = (style.GREEN, style.ORANGE, style.BLUE, style.PURPLE)
        scales = next(iter(runs.values())).scenario.scales
        for (name, found), colour in zip(runs.items(), colours, strict=True):
            data = found.dataset
            left.plot(data["time"][1:], data["height"][1:], color=colour, label=name.replace("2pi", "2π"))
        left.set_xscale("log")
        left.set_xlabel(style.quantity_label(scales, "time"))
        left.set_ylabel(style.quantity_label(scales, "height"))
        left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
        names = [name.replace("2pi", "2π") for name in runs]
        draw_starts(starts, [found.state(0) for found in runs.values()], names)
        draw_starts(ends, [found.state() for found in runs.values()], names)
        starts.set_title("start")
        ends.set_title("end")
        save(figure, out, "fig_3d")


if __name__ == "__main__":
    main(run)
