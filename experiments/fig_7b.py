"""Fig. 7b: neck radius of guided division against the amplitude of the ring, with folds, stability and hysteresis.

What. A sphere with a prescribed ring of stress regulator around its equator becomes an ellipsoid for a weak ring and a
dumbbell for a strong one. Followed in the ring's amplitude Delta_c at fixed Peclet number, the symmetric stationary
surface passes two folds, between which both shapes and a third one exist: a first-order transition (Sec. V B 2 of the
paper). We solve F(x; Delta_c) = 0 by pseudo-arclength continuation, take the leading growth rates at every point from
the linearised dynamics, and ramp the dynamics slowly up and down through the transition.

Parameters: Table 5, k = 45, R0/L_h = 0.3, c_s = 10, w^2 = 0.02. Pe = 450 as in Fig. 6; the other slices are not named
in the text, 300 and 150 are ours. Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_7b.py [--quick] [--out DIR]        Time: 2 min on one core, --quick 5 s.

Expect, at Pe = 450: folds at Delta_c = 2.36247419 and 1.29348538, which AUTO-07p (benchmarks/auto) finds as well; the
ellipsoid is stable up to the first; the dumbbell is stable from a pitchfork at 1.43472135 on, not from the second fold:
between the two it yields to an antisymmetric mode, its ring slips off the neck. The paper draws it stable up to its
fold. At Pe = 300 it is the same (1.9069 and 1.8424); at Pe = 150 the dumbbell is stable down to its fold. Ramps of the
dynamics leave the ellipsoid at the fold and the dumbbell at the pitchfork.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, draw_states, handle, jump, labelled, main, near, panels, ramp, resumed_branch, save
from shapespace.view import style
from shapespace.view.branch import MARKS, draw_lines, line_handles

KEY, NECK = "ring_amplitude", "equator_radius"
LAST = {450.0: 4.2, 300.0: 6.0, 150.0: 8.0}
"""Largest ring amplitude by Peclet number."""
AUTO = (2.362474188, 1.293485375)
"""Folds at Pe = 450 by AUTO-07p, 60 x 4, its two largest steps: benchmarks/README.md."""
SHOWN = 2.0
"""Ring amplitude of the three states drawn."""
RAMP_STEP = 0.01
RAMP_MARKS = {"up": "^", "down": "v"}


def run(out: Path, quick: bool) -> list[Row]:
    """Branches, ramps, figure, table."""
    branches = {
        peclet: resumed_branch(
            out / f"pe-{peclet:g}",
            ss.scenario("guided-division", peclet=peclet, until=500.0),
            KEY,
            LAST[peclet],
            start=0.0,
            at=(SHOWN,),
            stability=not quick,
        )
        for peclet in ([450.0] if quick else LAST)
    }
    rows = check_folds(branches[450.0], quick)
    loops: dict[str, list[dict[str, float]]] = {}
    if not quick:
        rows += [row for peclet, branch in branches.items() for row in check_stability(peclet, branch)]
        loops = hysteresis(branches[450.0])
        rows += check_loops(branches[450.0], loops)
    draw(branches, loops, out)
    return rows


def check_folds(branch: ss.Branch, quick: bool) -> list[Row]:
    """The two folds at Pe = 450 against another program."""
    folds = labelled(branch, "fold")
    rows = [
        Row("overhang at Pe = 450", "two folds", f"{len(folds)} folds", "", len(folds) == 2),
        Row(
            "shapes at its ends",
            "ellipsoid, dumbbell",
            "no neck, neck"
            if quick
            else f"r(1/2) = {branch['start'].observables[NECK]:.3f}, {branch['end-1'].observables[NECK]:.5f}",
            "",
            "neck_radius" not in branch["start"].observables and "neck_radius" in branch["end-1"].observables,
        ),
    ]
    tolerance = 1e-6
    return rows + [
        near(f"{name} fold (second column: AUTO-07p)", f"{auto:.9f}", fold.parameter, auto, tolerance)
        for name, fold, auto in zip(("ellipsoid's", "dumbbell's"), folds, AUTO, strict=True)
    ]


def check_stability(peclet: float, branch: ss.Branch) -> list[Row]:
    """Where the two shapes are stable."""
    first, last = labelled(branch, "fold")
    before = [point for point in branch.points if point.is_step and point.arclength < first.arclength]
    onset = next(
        point for point in reversed(branch.special_points) if point.n_unstable_before != point.n_unstable_after
    )
    is_fold = onset is last
    return [
        Row(
            f"ellipsoid at Pe = {peclet:g} stable up to",
            "its fold",
            f"{first.parameter:.6f}, its fold",
            f"{first.parameter_error:.0e}",
            first.n_unstable_after == 1 and all(point.n_unstable == 0 for point in before),
        ),
        Row(
            f"dumbbell at Pe = {peclet:g} stable from",
            "its fold",
            f"{onset.parameter:.6f}, " + ("its fold" if is_fold else f"a {onset.kind} (fold {last.parameter:.6f})"),
            f"{onset.parameter_error:.0e}",
            onset.n_unstable_after == 0 and is_fold == (peclet < 200.0) and onset.kind in ("fold", "pitchfork"),
            "agrees" if is_fold else "differs",
        ),
    ]


def hysteresis(branch: ss.Branch) -> dict[str, list[dict[str, float]]]:
    """The dynamics ramped up from the ellipsoid and down from the dumbbell, in steps, finest where it jumps."""
    fold = labelled(branch, "fold")[0].parameter
    onset = labelled(branch, "pitchfork")[-1].parameter
    up = np.r_[2.0:2.31:0.1, fold + RAMP_STEP * (np.arange(-4, 5) - 0.5), 2.5, 3.0]
    down = np.r_[3.0, 2.5, 2.0, 1.6, onset + RAMP_STEP * (0.5 - np.arange(-4, 5)), 1.3, 1.0]
    starts = (labelled(branch, "user")[0].label, "end-1")
    return {
        name: ramp(branch.scenario, KEY, values.tolist(), f"{branch.store}:{start}")
        for name, values, start in zip(("up", "down"), (up, down), starts, strict=True)
    }


def check_loops(branch: ss.Branch, loops: dict[str, list[dict[str, float]]]) -> list[Row]:
    """The jumps of the ramps lie where the spectrum changes sign."""
    places = {"up": labelled(branch, "fold")[0], "down": labelled(branch, "pitchfork")[-1]}
    rows = []
    for name, reached in loops.items():
        low, high = jump(reached, KEY, lambda seen: seen[NECK])
        at = places[name].parameter
        rows.append(
            Row(
                f"ramp {name} leaves its branch between",
                "a first-order transition",
                f"{low:.4f} and {high:.4f} ({places[name].kind}: {at:.4f})",
                f"{high - low:.0e}",
                low <= at <= high,
            )
        )
    return rows


def draw(branches: dict[float, ss.Branch], loops: dict[str, list[dict[str, float]]], out: Path) -> None:
    """Branches with their special points and the ramps; on the right the three states at one ring amplitude."""
    with style.house_style():
        figure, (left, right) = panels((1.35, 1.0))
        scales, drawn = branches[450.0].scenario.scales, set[str]()
        colours = dict(zip(branches, style.LINES, strict=False))
        for peclet, branch in branches.items():
            drawn |= draw_lines(left, branch.points, NECK, colour=colours[peclet])
            for point in branch.special_points:
                if point.kind in ("fold", "pitchfork"):
                    left.plot(
                        point.parameter, point.observables[NECK], MARKS[point.kind], color=colours[peclet], ms=3.5
                    )
        handles = [handle(style.quantity_value(scales, "peclet", peclet), colour) for peclet, colour in colours.items()]
        handles += line_handles(drawn, style.INK)
        handles += [handle(kind, marker=MARKS[kind], linestyle="") for kind in ("fold", "pitchfork")]
        for name, reached in loops.items():
            mark = {"marker": RAMP_MARKS[name], "ms": 3.0, "mfc": "none", "mew": 0.6, "linestyle": ""}
            left.plot([one[KEY] for one in reached], [one[NECK] for one in reached], color=style.INK, **mark)
            handles.append(handle(f"ramp {name}", **mark))
        left.set_xlabel(style.quantity_label(scales, KEY))
        left.set_ylabel(style.quantity_label(scales, NECK))
        left.set_xlim(0.0, None)
        figure.legend(handles=handles, ncols=5, loc="outside lower center")
        states = [point for point in branches[450.0].special_points if point.kind == "user"]
        names = ["ellipsoid, stable", "unstable", "dumbbell, stable"]
        draw_states(right, branches[450.0], states, names)
        at = ", ".join(style.quantity_value(scales, name, value) for name, value in (("peclet", 450.0), (KEY, SHOWN)))
        right.set_title(f"the three states at {at}")
        save(figure, out, "fig_7b")


if __name__ == "__main__":
    main(run)
