"""Fig. 3b: two initial shapes of a coated membrane at C0 R_b = 9 that relax to different states, and the hysteresis in C0.

What. At C0 R_b = 9 the membrane has two stable states (see fig_3a.py). Which one it relaxes to depends on whether it
has a neck, not on its height alone: a shape without neck pulled out to d0 = 0.67 R_b falls back to the lower state, a
lower shape with neck, d0 = 0.65 R_b, rises to the higher one. Slow ramps of C0 up and down jump at the folds.

The paper does not say what its two initial shapes are. Ours: the state without neck, pulled by a force until it is as
high as wanted, then let go; and the stationary state with neck of that height at a larger C0, brought to C0 R_b = 9.

Parameters: Table 4. Units: R_b, kappa, tau = eta_s R_b^2/kappa.

Run:   python experiments/fig_3b.py [--quick] [--out DIR]        Time: 2 min on one core, --quick 20 s without ramps.

Expect: 0.67 falls to 0.3968, 0.65 rises to 0.6769, the stationary states of fig_3a.py; the ramp up jumps at 10.648, the
ramp down at 6.896.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, draw_starts, handle, jump, labelled, main, near, panels, ramp, save
from fig_3a import KEY, SHOWN, gibbs_loop, three_states
from shapespace.study.starts import Start
from shapespace.view import style
from shapespace.view.branch import draw_lines, line_handles

WITHOUT, WITH = 0.67, 0.65
"""The paper's initial heights without and with neck."""
PULL = 2.0 * np.pi * 4.0
RAMP_STEP = 0.02
RAMP_MARKS = {"up": "^", "down": "v"}


def run(out: Path, quick: bool) -> list[Row]:
    """Relaxations, ramps, figure, table."""
    branch = gibbs_loop(out / "gibbs", stability=not quick)
    case = branch.scenario.with_overrides({KEY: SHOWN, "until": 50.0, "time_tolerance": 1e-5})
    low, _, high = three_states(branch)
    starts = {"without neck": pulled_out(case, branch, low.label, WITHOUT), "with neck": necked(branch, WITH)}
    runs = {name: ss.run(case, start=start) for name, start in starts.items()}
    rows = []
    for (name, found), target, height in zip(runs.items(), (low, high), (WITHOUT, WITH), strict=True):
        series = found.dataset["height"].values
        rows += [
            near(f"initial height {name}", f"{height:g}", series[0], height, 5e-3),
            Row(
                "neck",
                "no" if target is low else "yes",
                f"{starts[name].frame.observables.get('neck_radius', np.nan):.4f}",
                "",
                ("neck_radius" in starts[name].frame.observables) == (target is high),
            ),
            Row("then", "falls" if target is low else "rises", "", "", (series[-1] < series[0]) == (target is low)),
            near("to the stationary height", "shown, no number", series[-1], target.observables["height"], 1e-6),
        ]
    loops = {} if quick else hysteresis(branch)
    for (name, reached), fold in zip(loops.items(), labelled(branch, "fold"), strict=False):
        a, b = jump(reached, KEY, lambda seen: seen.get("neck_radius", 1.0))
        rows.append(
            Row(
                f"ramp {name} jumps between",
                "at the fold",
                f"{a:.4f} and {b:.4f} (fold {fold.parameter:.4f})",
                f"{b - a:.0e}",
                a <= fold.parameter <= b,
            )
        )
    draw(branch, runs, loops, out)
    return rows


def pulled_out(case: ss.Scenario, branch: ss.Branch, label: str, height: float) -> Start:
    """A labelled state, pulled at this scenario until it is this high; the second run ends at that moment."""
    start = f"{branch.store}:{label}"
    pulled = case.with_overrides({"pulling_force": PULL, "until": 1.0})
    data = ss.run(pulled, start=start).dataset
    assert float(data["height"][-1]) > height
    moment = float(np.interp(height, data["height"], data["time"]))
    return ss.run(pulled.with_overrides({"until": moment}), start=start).state()


def necked(branch: ss.Branch, height: float) -> Start:
    """The stationary state with neck of about this height, at another spontaneous curvature."""
    last = three_states(branch)[-1]
    beyond = [point for point in branch.points if point.is_step and point.arclength > last.arclength]
    point = min(beyond, key=lambda one: abs(one.observables["height"] - height))
    return Start("a state with neck", branch.scenario_at(point), point.frame)


def hysteresis(branch: ss.Branch) -> dict[str, list[dict[str, float]]]:
    """The dynamics ramped up from the lower state and down from the higher one, in steps, finest at the folds."""
    upper, lower = (fold.parameter for fold in labelled(branch, "fold"))
    fine = RAMP_STEP * (np.arange(-2, 3) - 0.5)
    ups, downs = np.r_[9.0:10.6:0.5, upper + fine, 11.0], np.r_[9.0:6.95:-0.5, lower - fine, 6.5]
    low, _, high = three_states(branch)
    case = branch.scenario.with_overrides({"until": 500.0})
    return {
        name: ramp(case, KEY, values.tolist(), f"{branch.store}:{point.label}")
        for name, values, point in (("up", ups, low), ("down", downs, high))
    }


def draw(branch: ss.Branch, runs: dict[str, ss.Run], loops: dict[str, list[dict[str, float]]], out: Path) -> None:
    """Heights over time, the shapes at both ends, and the ramps beside the branch."""
    with style.house_style():
        figure, (left, middle, right) = panels((1.0, 1.1, 1.0), 65.0)
        colours, scales = (style.GREEN, style.BLUE), branch.scenario.scales
        for (name, found), colour in zip(runs.items(), colours, strict=True):
            data = found.dataset
            left.plot(data["time"][1:], data["height"][1:], color=colour, label=name)
            left.axhline(float(data["height"][0]), color=colour, linewidth=0.5, linestyle=":")
        left.set_xscale("log")
        left.set_xlabel(style.quantity_label(scales, "time"))
        left.set_ylabel(style.quantity_label(scales, "height"))
        left.legend()
        states = [run.state(number) for run in runs.values() for number in (0, -1)]
        draw_starts(middle, states, ["start", "end", "start", "end"])
        handles = line_handles(draw_lines(right, branch.points, "height", colour=style.BLUE))
        for name, reached in loops.items():
            mark = {"marker": RAMP_MARKS[name], "ms": 3.0, "mfc": "none", "mew": 0.6, "linestyle": ""}
            right.plot([one[KEY] for one in reached], [one["height"] for one in reached], color=style.INK, **mark)
            handles.append(handle(f"ramp {name}", **mark))
        right.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
        right.set_xlim(6.0, 12.0)
        right.set_ylim(0.2, 0.8)
        right.set_xlabel(style.quantity_label(scales, KEY))
        right.set_ylabel(style.quantity_label(scales, "height"))
        save(figure, out, "fig_3b")


if __name__ == "__main__":
    main(run)
