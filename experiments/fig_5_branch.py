"""Swimmers along a line of Fig. 5: the branch that leaves the resting sphere at its pitchfork in the Peclet number.

What. A sphere with uniform regulator is stable below Pe* = (2 + k R0^2/D)/(c0 f'(c0)) = 22. There the polarized,
swimming state leaves it to both sides, and we follow it in Pe, and then at Pe = 300 in R0/L_h: cuts through the two
maps of Fig. 5 (Sec. V B 1 of the paper), with the growth rates that the maps do not show.

Parameters: Table 5 with k = 9, c_s = c0 (Fig. 5). Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_5_branch.py [--quick] [--out DIR]        Time: 2 min on one core, --quick 15 s.

Expect: a pitchfork at Pe = 22 whatever R0/L_h is; both sides mirror each other; near it the speed follows v0 = -(R0/2)
(xi Delta mu)_0 f'(c0) dc/eta_b, dc being half the difference of c between the poles, up to a relative miss that falls
as dc^2; speed and polarity rise with Pe at R0/L_h = 5 (Fig. 5c); at Pe = 300 the polarity rises with R0/L_h and
saturates, while the speed hardly changes (Fig. 5d).
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, draw_states, handle, labelled, main, near, panels, resumed_branch, save
from shapespace.study.branch_point import BranchPoint
from shapespace.study.dataset import profile_of
from shapespace.view import style
from shapespace.view.branch import MARKS, draw_lines, line_handles

PECLET, LENGTH = "peclet", "inverse_hydrodynamic_length"
ONSET = 22.0
"""(2 + k R0^2/D)/(c0 f'(c0)) for k = 9, c_s = c0."""


def run(out: Path, quick: bool) -> list[Row]:
    """Branches, figure, table."""
    lengths, top = ((5.0,), 40.0) if quick else ((5.0, 1.0), 300.0)
    rows, swimmers = [], {}
    for length in lengths:
        case = ss.scenario("polar-swimmer", **{LENGTH: length})
        sphere = resumed_branch(out / f"sphere-{length:g}", case, PECLET, 30.0, start=15.0, state="trivial")
        rows += check_onset(length, sphere)
        origin = f"{sphere.store}:{labelled(sphere, 'pitchfork')[0].label}"
        sides = [
            resumed_branch(
                out / f"swimmer-{length:g}-{name}", case, PECLET, stop, origin=origin, side=side, stability=not quick
            )
            for name, side, stop in (("up", 1, top), ("down", -1, 40.0))
        ]
        rows += check_swimmers(length, *sides)
        swimmers[length] = sides[0]
    across = None if quick else screening(out, swimmers[1.0])
    if across is not None:
        rows += check_screening(across)
    draw(swimmers, across, out)
    return rows


def check_onset(length: float, sphere: ss.Branch) -> list[Row]:
    """The sphere's pitchfork."""
    (fork,) = labelled(sphere, "pitchfork")
    return [
        near(f"Pe* at R0/L_h = {length:g}", "22", fork.parameter, ONSET, 1e-8),
        Row("sphere", "stable, then not", f"{fork.n_unstable_before} to {fork.n_unstable_after} growing", "",
            (fork.n_unstable_before, fork.n_unstable_after) == (0, 1)),
    ]  # fmt: skip


def pattern(branch: ss.Branch, point: BranchPoint) -> float:
    """Half the difference of c between the upper and the lower pole."""
    c = profile_of(branch.scenario_at(point), point.frame)["concentration"]
    return 0.5 * float(c[0] - c[-1])


def check_swimmers(length: float, one: ss.Branch, other: ss.Branch) -> list[Row]:
    """Mirror images, the law of the speed, and how speed and polarity go with the Peclet number."""
    at_end = other.points[-1]
    mirrored = np.interp(
        at_end.parameter, *([p.parameter for p in one.points], [p.observables["velocity"] for p in one.points])
    )
    first = [point for point in one.points if point.is_step][1:4]
    sizes = np.array([pattern(one, point) for point in first])
    speeds = np.array([point.observables["velocity"] for point in first])
    # (xi Delta mu)_0 = Pe and c0 f'(c0) = 1/2 in these units.
    misses = np.abs(speeds / (-0.25 * np.array([point.parameter for point in first]) * sizes) - 1.0)
    order = np.polyfit(np.log(np.abs(sizes)), np.log(misses), 1)[0]
    values = {name: np.abs([p.observables[name] for p in one.points]) for name in ("velocity", "polarity")}
    rows = [
        near(f"R0/L_h = {length:g}: v0, other side", "-v0", -at_end.observables["velocity"], mirrored, 1e-2 * abs(mirrored)),
        Row("v0 over its first-order law, minus one", "small", f"{misses[0]:.1e} at dc = {sizes[0]:.3f}", "", misses[0] < 0.05),
        near("its power of dc", "2 (next order)", order, 2.0, 0.2),
        Row("speed rises with Pe", "yes", f"to {values['velocity'][-1]:.4f} at Pe = {one.points[-1].parameter:g}", "",
            bool((np.diff(values["velocity"]) > 0.0).all())),
    ]  # fmt: skip
    if length >= 5.0:
        rising = bool((np.diff(values["polarity"][1:]) > 0.0).all())
        rows.append(Row("polarity rises with Pe", "yes", f"|P| to {values['polarity'][-1]:.4f}", "", rising))
    return rows


def screening(out: Path, swimmers: ss.Branch) -> ss.Branch:
    """From the swimmer at the largest Peclet number on, in R0/L_h."""
    case = swimmers.scenario_at(swimmers["end-1"])
    origin = f"{swimmers.store}:end-1"
    return resumed_branch(out / "screening", case, LENGTH, 10.0, origin=origin, start=1.0, both=False)


def check_screening(across: ss.Branch) -> list[Row]:
    """How the polarity saturates while the speed hardly changes."""
    lengths = np.array([point.parameter for point in across.points])
    polarity, speed = (np.abs([p.observables[name] for p in across.points]) for name in ("polarity", "velocity"))
    early, late = (np.interp(pair, lengths, polarity) for pair in ((1.0, 3.0), (8.0, 10.0)))
    return [
        Row("Pe = 300, R0/L_h 1 to 10: |P|", "rises, saturates", f"{polarity[0]:.3f} to {polarity[-1]:.3f}", "",
            early[1] - early[0] > 5.0 * abs(late[1] - late[0])),
        Row("speed", "roughly constant", f"{speed.min():.2f} to {speed.max():.2f}", "", bool(np.ptp(speed) < 0.5 * speed.max())),
    ]  # fmt: skip


def draw(swimmers: dict[float, ss.Branch], across: ss.Branch | None, out: Path) -> None:
    """Speed and polarity along the branches, and some of the shapes."""
    with style.house_style():
        figure, axes = panels((1.0, 1.0, *([] if across is None else [1.25]), 1.75), 65.0)
        branch = swimmers[5.0]
        scales, drawn = branch.scenario.scales, set[str]()
        if across is not None:
            twin = axes[2].twinx()
            twin.spines["right"].set_visible(True)
            for place, name, colour in ((axes[2], "polarity", style.ORANGE), (twin, "velocity", style.GREEN)):
                drawn |= draw_lines(place, across.points, name, colour=colour)
                place.set_ylabel(style.quantity_label(scales, name), color=colour)
            twin.set_ylim(-40.0, 0.0)
            axes[2].set_ylim(0.0, 1.0)
            axes[2].set_title(style.quantity_value(scales, PECLET, across.scenario.values()[PECLET]))
            axes[2].set_xlabel(style.quantity_label(scales, LENGTH))
        colours = dict(zip(swimmers, style.LINES, strict=False))
        for place, name in zip(axes, ("velocity", "polarity"), strict=False):
            for length, one in swimmers.items():
                drawn |= draw_lines(place, one.points, name, colour=colours[length])
            place.plot(ONSET, 0.0, MARKS["pitchfork"], color=style.INK, ms=3.5)
            place.set_xlabel(style.quantity_label(scales, PECLET))
            place.set_ylabel(style.quantity_label(scales, name))
        handles = [handle(style.quantity_value(scales, LENGTH, length), colour) for length, colour in colours.items()]
        handles += [*line_handles(drawn, style.INK), handle("pitchfork", marker=MARKS["pitchfork"], linestyle="")]
        figure.legend(handles=handles, ncols=len(handles), loc="outside lower center")
        steps = [point for point in branch.points if point.is_step]
        shown = [
            min(steps, key=lambda p: abs(p.parameter - wanted)) for wanted in np.geomspace(25.0, steps[-1].parameter, 3)
        ]
        draw_states(
            axes[-1], branch, shown, [style.quantity_value(scales, PECLET, point.parameter, ".0f") for point in shown]
        )
        save(figure, out, "fig_5_branch")


if __name__ == "__main__":
    main(run)
