"""Sec. II D, Table 1: Eulerian, Lagrangian and scaling (SLE) parameterization: one trajectory, three meshes.

What. A sphere polarizes and swims. Its equations are solved with mesh points that move along the normal only (Eulerian,
q = v), that move with the matter (Lagrangian, q = 0), and that keep even distances (SLE, h' = 0). The physics is the same; the
stretch h(u) of the map from the mesh to arc length is not: the flow from pole to pole carries points along without end.

Parameters: as in polar-swimmer, Pe = 100, with a seed of 0.3. Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/parameterizations.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 20 s.

Expect: shapes agree to the error of the time steps (1e-5 per step) as long as all three go on. The ratio of the largest to the
smallest h stays 1 for SLE. It grows exponentially for the other two, and with it the work: they use up their 300 steps
while the SLE run swims steadily at t = 1 after some 125. The Lagrangian mesh fails first: it follows the whole flow.
The paper claims this in words only.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, main, near, panels, save
from shapespace.base.arrays import Array
from shapespace.study.frame import Frame
from shapespace.view import style

CHOICES = ("sle", "eulerian", "lagrangian")
STEPS = 300
"""As many as SLE needs more than twice over."""


def run(out: Path, quick: bool) -> list[Row]:
    """Three runs, figure, table."""
    until = 0.1 if quick else 1.0
    keys = {"seed_amplitude": 0.3, "time_tolerance": 1e-5, "max_steps": STEPS, "until": until}
    runs = {name: ss.run(ss.scenario("polar-swimmer", parameterization=name, **keys)) for name in CHOICES}
    both = 0.8 * min(one.observables["time"] for one in runs.values())
    reference = height_at(runs["sle"], both)
    rows = [
        near(f"height at t = {both:.3g}, {name}", "same", height_at(runs[name], both), reference, 1e-3)
        for name in CHOICES[1:]
    ]
    quality = {name: np.array([stretching(frame) for frame in one.frames]) for name, one in runs.items()}
    rows.append(near("largest over smallest h, SLE", "1", float(quality["sle"].max()), 1.0, 1e-12))
    for name in CHOICES[1:]:
        last = float(quality[name][-1])
        rows.append(Row(f"the same, {name}", "uncontrolled", f"{last:.3g}", "", last > (5.0 if quick else 1e3)))
    if not quick:
        ends = {name: one.observables["time"] for name, one in runs.items()}
        lives = ends["lagrangian"] < ends["eulerian"] < ends["sle"] == until
        text = ", ".join(f"{name} {end:.3g}" for name, end in ends.items())
        rows.append(Row(f"time that {STEPS} steps last", "SLE goes on", text, "", lives))
    draw(runs, quality, out)
    return rows


def stretching(frame: Frame) -> float:
    """max h/min h over the Gauss points of a frame; an SLE frame has one h."""
    h = frame.algebraic[..., -1] if frame.algebraic.size else np.ones(1)
    return float(h.max() / h.min())


def height_at(run: ss.Run, time: float) -> float:
    """Of a run's frames, by cubic interpolation between the nearest four."""
    times = np.array([frame.time for frame in run.frames])
    heights = np.array([frame.observables["height"] for frame in run.frames])
    near_by = np.sort(np.argsort(np.abs(times - time))[:4])
    return float(np.polyval(np.polyfit(times[near_by] - time, heights[near_by], 3), 0.0))


def draw(runs: dict[str, ss.Run], quality: dict[str, Array], out: Path) -> None:
    """The mesh quality over time, and the height of the surface, which knows of no mesh."""
    with style.house_style():
        figure, (left, right) = panels((1.0, 1.0), 70.0)
        scales = next(iter(runs.values())).scenario.scales
        names = {"sle": "SLE", "eulerian": "Eulerian", "lagrangian": "Lagrangian"}
        for (name, one), colour in zip(runs.items(), (style.BLUE, style.ORANGE, style.GREEN), strict=True):
            times = [frame.time for frame in one.frames]
            left.semilogy(times, quality[name], color=colour, label=names[name])
            left.plot(times[-1], quality[name][-1], "o", color=colour, ms=4)
            width = 3.0 if name == "sle" else 1.2
            right.plot(times, [frame.observables["height"] for frame in one.frames], color=colour, linewidth=width)
            right.plot(times[-1], one.observables["height"], "o", color=colour, ms=4)
        left.set_ylabel(r"mesh: $\max h/\min h$")
        right.set_ylabel(style.quantity_label(scales, "height"))
        for place in (left, right):
            place.set_xlabel(style.quantity_label(scales, "time"))
        left.legend()
        save(figure, out, "parameterizations")


if __name__ == "__main__":
    main(run)
