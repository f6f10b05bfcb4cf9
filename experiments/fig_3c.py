"""Fig. 3c: force against height of a coated membrane at C0 R_b = 9, with and without neck, and of a bare one.

What. Starting from the three states of fig_3a.py at C0 R_b = 9 we follow the stationary shape in the pulling force F
both ways, and for comparison the membrane without coat from the flat disc. The state without neck and the one with neck
lie on different branches, which do not meet in the plane of force and height (Sec. V A 2 of the paper). Forces are true
forces; the paper's are those over 2 pi (see shared conventions in docs/glossary.md), and so are the numbers below and
the axis.

Parameters: Table 4. Units: R_b, kappa.

Run:   python experiments/fig_3c.py [--quick] [--out DIR]        Time: 2 min on one core, --quick 20 s.

Expect: the state without neck ends in a fold at F/2pi = 1.082, the paper's transition near 1; the one with neck in a
fold at 5.073, the paper's near 5, after which the force oscillates around and settles at its tether plateau sqrt(2
kappa gamma0) = 5. Without coat the plateau is the same and the overshoot larger. Pushed, the branch with neck turns at
-0.276 and its neck closes at -0.173, so that the membrane buds under compression, unstable on this last part.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import shapespace as ss
from common import Row, handle, labelled, main, near, panels, resumed_branch, save
from fig_3a import gibbs_loop, three_states
from shapespace.view import style
from shapespace.view.branch import MARKS, draw_lines, line_handles

KEY, FORCE = "pulling_force", "pulling_force_per_2pi"
PLATEAU = 5.0
"""sqrt(2 kappa gamma0): the force of an infinite tube over 2 pi."""
TURN = 2.0 * np.pi
SWING = 1e-4
SHOWN = 0.7 * TURN
"""Force of the paper's dashed line, at which fig_3d.py relaxes shapes."""


def run(out: Path, quick: bool) -> list[Row]:
    """Branches, figure, table."""
    branches = coated(out, quick)
    bare = ss.scenario("membrane-protrusion", spontaneous_curvature=0.0)
    branches["without coat"] = follow(out / "bare", bare, None, quick)
    draw(branches, out)
    return check(branches, quick)


def follow(out: Path, case: ss.Scenario, origin: str | None, quick: bool) -> ss.Branch:
    """The branch through a state in the pulling force, both ways; a tether grows until its mesh gives out."""
    bounds = {"start": 0.0, "both": origin is not None, "at": (SHOWN,)}
    # The force swings around the plateau, each time less: soon by less than its error.
    blind = ((1.0 - SWING) * PLATEAU * TURN, (1.0 + SWING) * PLATEAU * TURN)
    return resumed_branch(
        out,
        case,
        KEY,
        6.0 * TURN,
        origin=origin,
        stability=not quick,
        ends=(ss.Outcome.BRANCH_STALLED,),
        blind=blind,
        **bounds,
    )


def forces(branch: ss.Branch, kind: str) -> list[float]:
    """Forces over 2 pi of the special points of a kind, in the order in which the force first rises along the branch."""
    return [point.parameter / TURN for point in labelled(branch, kind)]


def coated(out: Path, quick: bool) -> dict[str, ss.Branch]:
    """The branches with coat, without and with neck."""
    loop = gibbs_loop(out / "gibbs", stability=not quick)
    low, _, high = three_states(loop)
    return {
        name: follow(out / name.replace(" ", "-"), loop.scenario_at(point), f"{loop.store}:{point.label}", quick)
        for name, point in (("without neck", low), ("with neck", high))
    }


def check(branches: dict[str, ss.Branch], quick: bool) -> list[Row]:
    """Transitions, plateau, and the bud under compression."""
    bare, without, neck = (branches[name] for name in ("without coat", "without neck", "with neck"))
    transition, tether, overshoot = (max(forces(one, "fold")) for one in (without, neck, bare))
    turn, closing = min(forces(neck, "fold")), forces(neck, "neck-closed")[0]
    here, there = ([point.observables["height"] for point in labelled(one, "user")] for one in (without, neck))
    ends = {name: branches[name].points[-1].observables for name in ("without coat", "with neck")}
    rows = [
        near("transition of the state without neck", "near 1", transition, 1.0, 0.15),
        near("transition of the state with neck", "near 5", tether, 5.0, 0.15),
        *(
            near(
                f"{name}: F/2pi of a tether of d = {seen['height']:.1f}",
                "5, sqrt(2 kappa gamma0)",
                seen[FORCE],
                PLATEAU,
                1e-3,
            )
            for name, seen in ends.items()
        ),
        Row("overshoot without coat", "shown, no number", f"{overshoot:.5f}", "", overshoot > tether > PLATEAU),
        Row(
            "the neck closes when pushed",
            "F < 0",
            f"at F/2pi = {closing:.4f}, after a fold at {turn:.4f}",
            "",
            turn < closing < 0.0,
        ),
        Row(
            f"heights at F/2pi = {SHOWN / TURN:g}, without and with neck",
            "disconnected",
            " and ".join(", ".join(f"{height:.4f}" for height in heights) for heights in (here, there)),
            "",
            all(abs(a - b) > 0.01 for a in here for b in there),
        ),
    ]
    if not quick:
        (last,) = labelled(neck, "neck-closed")
        rows.append(
            Row(
                "growing modes of the last part",
                "not stated",
                f"{last.n_unstable_before}",
                "",
                last.n_unstable_before == 1,
                "not in the paper",
            )
        )
    return rows


def draw(branches: dict[str, ss.Branch], out: Path) -> None:
    """Force and height of all branches, and enlarged where the two shapes of the coated membrane are near each other."""
    with style.house_style():
        figure, (left, right) = panels((1.0, 1.2))
        colours = dict(zip(branches, (style.GREEN, style.BLUE, style.INK), strict=True))
        drawn: set[str] = set()
        for name, branch in branches.items():
            for axes in (left, right):
                drawn |= draw_lines(axes, branch.points, "height", across=FORCE, colour=colours[name])
                mark(axes, branch, colours[name])
        left.axvline(PLATEAU, color=style.FAINT, linewidth=0.8, zorder=0)
        left.axvline(0.0, color=style.FAINT, linestyle=":", linewidth=0.8, zorder=0)
        left.set_xlim(-1.0, 6.5)
        left.set_ylim(-0.1, 6.0)
        handles = [handle(name, colour) for name, colour in colours.items()] + line_handles(drawn, style.INK)
        handles += [handle("fold", marker=MARKS["fold"], linestyle=""), handle("neck closes", marker="o", linestyle="")]
        figure.legend(handles=handles, ncols=4, loc="outside lower center")
        right.axvline(0.0, color=style.FAINT, linestyle=":", linewidth=0.8, zorder=0)
        right.set_xlim(-0.5, 1.4)
        right.set_ylim(0.25, 0.95)
        for axes in (left, right):
            axes.set_xlabel(style.quantity_label(branch.scenario.scales, FORCE))
            axes.set_ylabel(style.quantity_label(branch.scenario.scales, "height"))
        save(figure, out, "fig_3c")


def mark(axes: Axes, branch: ss.Branch, colour: str) -> None:
    """Folds, and where the neck closes."""
    for point in branch.special_points:
        if point.kind in ("fold", "neck-closed"):
            axes.plot(
                point.observables[FORCE], point.observables["height"], MARKS.get(point.kind, "o"), color=colour, ms=3.5,
                clip_on=True,
            )  # fmt: skip


if __name__ == "__main__":
    main(run)
