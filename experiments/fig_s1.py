"""Fig. S1: inside the finger of Fig. 7c: a symmetric dividing surface that loses and regains stability as R0/L_h grows.

What. At Pe = 450, Delta_c = 4 and a turnover somewhat below k = 30 the symmetrically ingressed surface is unstable on a
short stretch of R0/L_h between two pitchforks, which two mirror-image branches with the neck off the middle connect.
Such a surface swims, so that its velocity tells the branches apart. We follow the symmetric branch with its growth
rates and leave it at the first pitchfork to both sides.

Parameters: Table 5, Pe = 450, Delta_c = 4, k = 28: the paper's red line has no number; the finger's tip is just below k
= 30, where the leading rate rises to -0.06/tau and falls again. Units: R0, kappa, tau = eta_b R0^2/kappa.

Run:   python experiments/fig_s1.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 15 s.

Expect: pitchforks at R0/L_h = 4.32662 and 4.84038 with the symmetric surface unstable between; stable asymmetric
branches with velocities of up to 0.74 R0/tau either way from the one to the other. Not in the paper: they leave the
first pitchfork backwards and are stable only from a fold at 4.32603 on, so that there is a hysteresis of 6e-4 in
R0/L_h; and a third pitchfork at 5.977 ends the symmetric surface's stability for good.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, draw_starts, handle, labelled, main, near, panels, resumed_branch, save
from shapespace.base.arrays import Array
from shapespace.study.starts import find_start
from shapespace.view import style
from shapespace.view.branch import MARKS, draw_lines, line_handles

KEY = "inverse_hydrodynamic_length"
FIRST, LAST = 3.0, 7.0
SHOWN = 4.6
"""R0/L_h of the three states drawn."""


def run(out: Path, quick: bool) -> list[Row]:
    """Branches, figure, table."""
    case = ss.scenario("guided-division", turnover_rate=28.0, inverse_hydrodynamic_length=FIRST)
    stability = not quick
    symmetric = resumed_branch(out / "symmetric", case, KEY, LAST, at=(SHOWN,), stability=stability)
    first, second = labelled(symmetric, "pitchfork")[:2]
    origin, stop = f"{symmetric.store}:{first.label}", second.parameter - 1e-3
    options = {"start": first.parameter, "origin": origin, "at": (SHOWN,), "stability": stability}
    sides = [
        resumed_branch(out / f"side-{side}", case, KEY, stop, side=side, **options)
        for side in ((1,) if quick else (1, -1))
    ]
    draw(symmetric, sides, out)
    rows = check_branches(symmetric, sides[0])
    return rows if quick else rows + check_stability(symmetric, sides)


def speeds(branch: ss.Branch) -> Array:
    """R0/L_h and velocity along a branch, (2, points)."""
    return np.array([(point.parameter, point.observables["velocity"]) for point in branch.points]).T


def check_branches(symmetric: ss.Branch, side: ss.Branch) -> list[Row]:
    """Two pitchforks and what connects them."""
    first, second = labelled(symmetric, "pitchfork")[:2]
    lengths, velocities = speeds(side)
    # Near a pitchfork v0^2 is linear in the parameter: where it vanishes the branch meets the symmetric one again.
    _, offset = np.polyfit(velocities[-2:] ** 2, lengths[-2:], 1)
    rest = float(np.abs(speeds(symmetric)[1]).max())
    return [
        Row("symmetric surface", "v0 = 0", f"|v0| < {rest:.0e}", "", rest < 1e-8),
        Row("finger", "two pitchforks", f"{first.parameter:.6f}, {second.parameter:.6f}",
            f"{max(first.parameter_error, second.parameter_error):.0e}", second.parameter - first.parameter > 0.1),
        Row("asymmetric surface", "v0 not 0", f"|v0| to {np.abs(velocities).max():.3f}", "", np.abs(velocities).max() > 0.1),
        near("it meets the symmetric one at (its v0^2 = 0)", "second pitchfork", offset, second.parameter, 1e-4),
    ]  # fmt: skip


def check_stability(symmetric: ss.Branch, sides: list[ss.Branch]) -> list[Row]:
    """Who is stable where."""
    first, second = labelled(symmetric, "pitchfork")[:2]
    counts = [first.n_unstable_before, first.n_unstable_after, second.n_unstable_before, second.n_unstable_after]
    folds = [labelled(side, "fold")[0] for side in sides]
    inside = [p.n_unstable for side in sides for p in side.points if p.is_step and p.parameter > first.parameter + 1e-4]
    apart = abs(folds[0].parameter - folds[1].parameter)
    ends = [side.points[-1].observables["velocity"] for side in sides]
    return [
        Row("symmetric: growing modes", "stable, unstable, stable", " ".join(map(str, counts)), "", counts == [0, 1, 1, 0]),
        Row("asymmetric: growing modes", "stable", str(max(inside)), "", max(inside) == 0),
        near("velocity of the mirror image", "-v0", -ends[1], ends[0], 1e-6),
        Row("asymmetric ones start at", "the pitchfork", f"a fold at {folds[0].parameter:.6f}", f"{apart:.0e}",
            folds[0].parameter < first.parameter and apart < 1e-7, "differs"),
    ]  # fmt: skip


def draw(symmetric: ss.Branch, sides: list[ss.Branch], out: Path) -> None:
    """Velocity along the branches, and the states at one R0/L_h."""
    with style.house_style():
        figure, (left, right) = panels((1.2, 1.0))
        scales = symmetric.scenario.scales
        drawn = draw_lines(left, symmetric.points, "velocity", colour=style.BLUE)
        for side in sides:
            drawn |= draw_lines(left, side.points, "velocity", colour=style.RED)
        for point in labelled(symmetric, "pitchfork"):
            left.plot(point.parameter, 0.0, MARKS["pitchfork"], color=style.BLUE, ms=3.5)
        left.set_xlabel(style.quantity_label(scales, KEY))
        left.set_ylabel(style.quantity_label(scales, "velocity"))
        names = [handle("symmetric", style.BLUE), handle("neck off the middle", style.RED)]
        left.legend(handles=[*names, *line_handles(drawn, style.INK)])
        states = [(symmetric, "symmetric"), *((side, "asymmetric") for side in sides)]
        starts = [find_start(f"{branch.store}:{labelled(branch, 'user')[0].label}") for branch, _ in states]
        draw_starts(right, starts, [name for _, name in states])
        right.set_title(style.quantity_value(scales, KEY, SHOWN))
        save(figure, out, "fig_s1")


if __name__ == "__main__":
    main(run)
