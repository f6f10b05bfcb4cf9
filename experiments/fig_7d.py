"""Fig. 7d: neck radius of guided division against the hydrodynamic length, at several rates of turnover.

What. Where turnover is fast the prescribed ring holds the neck in the middle; where it is slow the ring slips. At Pe =
450, Delta_c = 4 we follow the symmetric stationary surface in R0/L_h at fixed k, with its growth rates: slices through
the stability diagram of Fig. 7c (Sec. V B 2 of the paper).

Parameters: Table 5, Pe = 450, Delta_c = 4. k = 45 as in Fig. 6; the other slices are not named in the text, 35, 25 and
15 are ours. Units: R0, kappa, tau = eta_b R0^2/kappa.

Run:   python experiments/fig_7d.py [--quick] [--out DIR]        Time: 2 min on one core, --quick 20 s.

Expect: at k = 45 stable throughout, and the neck widens most around R0/L_h = 1, and in a second step at 3.2, from 0.004
R0 to 0.064 R0. At R0/L_h = 0.3 the symmetric surface is stable only for k above a threshold, 37.594, in the paper also
but without a number; at k = 35 it is stable from a pitchfork at R0/L_h = 0.6395 on, at k = 25 and 15 only between two
pitchforks.
"""

from pathlib import Path

import numpy as np
from matplotlib.ticker import FixedLocator, NullFormatter

import shapespace as ss
from common import Row, draw_states, handle, labelled, main, panels, resumed_branch, save
from shapespace.view import style
from shapespace.view.branch import MARKS, draw_lines, line_handles

KEY, TURNOVER, NECK = "inverse_hydrodynamic_length", "turnover_rate", "equator_radius"
FIRST, LAST = 0.3, 5.0
MIDDLE = 2.0
"""R0/L_h that parts the range around 1 from what is beyond."""
SLICES = (45.0, 35.0, 25.0, 15.0)


def run(out: Path, quick: bool) -> list[Row]:
    """Branches, figure, table."""
    case = ss.scenario("guided-division", inverse_hydrodynamic_length=FIRST)
    slices = SLICES[:1] if quick else SLICES
    branches, rows = {}, []
    line = None
    if not quick:
        line = resumed_branch(out / "turnover", case, TURNOVER, min(SLICES), start=max(SLICES), at=SLICES[1:-1])
        rows += check_threshold(line)
    for value in slices:
        at = case.with_overrides({TURNOVER: value})
        origin = None
        if line is not None:
            point = next(one for one in line.points if one.label and one.parameter == value)
            origin = f"{line.store}:{point.label}"
        branches[value] = resumed_branch(
            out / f"k-{value:g}", at, KEY, LAST, start=FIRST, origin=origin, stability=not quick
        )
    rows += check_widening(branches[45.0])
    for value, branch in branches.items():
        rows += [] if quick else check_stability(value, branch)
    draw(branches, out)
    return rows


def check_threshold(line: ss.Branch) -> list[Row]:
    """Where, with less turnover, the ring slips."""
    (fork,) = labelled(line, "pitchfork")
    counts = (fork.n_unstable_before, fork.n_unstable_after)
    return [
        Row(
            f"R0/L_h = {FIRST:g}: stable for k above",
            "a threshold",
            f"{fork.parameter:.4f}, a pitchfork",
            f"{fork.parameter_error:.0e}",
            counts == (0, 1) and 35.0 < fork.parameter < 45.0,
        )
    ]


def check_widening(branch: ss.Branch) -> list[Row]:
    """By how much the neck widens around R0/L_h = 1 and beyond."""
    steps = [point for point in branch.points if point.is_step]
    lengths, necks = (
        np.array(values) for values in zip(*((p.parameter, p.observables[NECK]) for p in steps), strict=True)
    )
    middle = float(np.interp(MIDDLE, lengths, necks))
    near_one, beyond = middle / necks[0], necks[-1] / middle
    told = f"times {near_one:.1f} up to {MIDDLE:g}, times {beyond:.1f} beyond"
    return [
        Row("k = 45: the neck", "widens", f"{necks[0]:.4f} to {necks[-1]:.4f}", "", bool((np.diff(necks) > 0.0).all())),
        Row("most of it around R0/L_h = 1", "yes", told, "", near_one > 2.0 * beyond),
    ]


def check_stability(value: float, branch: ss.Branch) -> list[Row]:
    """Where one slice is stable."""
    forks = [point.parameter for point in labelled(branch, "pitchfork")]
    start = branch.points[0].n_unstable
    told = ", ".join(f"{fork:.4f}" for fork in forks)
    if value == 45.0:
        return [
            Row("k = 45", "fully stable", "stable" if not forks and start == 0 else told, "", start == 0 and not forks)
        ]
    expected = 1 if value == 35.0 else 2
    return [
        Row(
            f"k = {value:g}: from unstable, stability changes at",
            "changes",
            told,
            "",
            start == 1 and len(forks) == expected,
        )
    ]


def draw(branches: dict[float, ss.Branch], out: Path) -> None:
    """Neck radius along the slices, and shapes along the stable one."""
    with style.house_style():
        figure, (left, right) = panels((1.2, 1.0))
        scales, drawn = branches[45.0].scenario.scales, set[str]()
        colours = dict(zip(branches, style.LINES, strict=False))
        for turnover, branch in branches.items():
            drawn |= draw_lines(left, branch.points, NECK, colour=colours[turnover])
            for point in labelled(branch, "pitchfork"):
                left.plot(point.parameter, point.observables[NECK], MARKS["pitchfork"], color=colours[turnover], ms=3.5)
        left.set_xscale("log")
        left.set_yscale("log")
        for axis, ticks in ((left.xaxis, (0.3, 0.5, 1.0, 2.0, 3.0, 5.0)), (left.yaxis, (0.003, 0.01, 0.03, 0.1))):
            axis.set_major_locator(FixedLocator(ticks))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        left.set_xlabel(style.quantity_label(scales, KEY))
        left.set_ylabel(style.quantity_label(scales, NECK))
        handles = [handle(style.quantity_value(scales, TURNOVER, value), colour) for value, colour in colours.items()]
        handles += line_handles(drawn, style.INK)
        left.legend(handles=handles, loc="upper left")
        branch = branches[45.0]
        steps = [point for point in branch.points if point.is_step]
        shown = [min(steps, key=lambda p: abs(p.parameter - wanted)) for wanted in (FIRST, 1.0, LAST)]
        draw_states(
            right, branch, shown, [style.quantity_value(scales, KEY, point.parameter, ".2g") for point in shown]
        )
        right.set_title(style.quantity_value(scales, TURNOVER, 45.0))
        save(figure, out, "fig_7d")


if __name__ == "__main__":
    main(run)
