"""Fig. 3a: height of a coated membrane against the coat's spontaneous curvature: a Gibbs loop that ends in a bud.

What. A clamped incompressible membrane, drawn from a reservoir of tension gamma0, carries a coat of spontaneous
curvature C0 around its centre. We follow the stationary shape from the flat disc in C0, through two folds, to where the
neck closes, with the leading growth rates at every point (Sec. V A 1 of the paper).

Parameters: Table 4 (areas per 2 pi), no pull. Units: R_b, kappa, tau = eta_s R_b^2/kappa.

Run:   python experiments/fig_3a.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 10 s.

Expect: stable without neck up to a fold at C0 R_b = 10.6481068; unstable back to a fold at 6.8964162; stable with neck
from there to C0 R_b = 11.756, where the neck closes: the limiting shape of the paper's budding transition. At C0 R_b =
9 three states, of which the outer two are stable, the lower one without and the higher one with a neck.
"""

from pathlib import Path

import shapespace as ss
from common import Row, draw_states, labelled, main, near, panels, resumed_branch, save
from shapespace.study.branch_point import BranchPoint
from shapespace.view import style
from shapespace.view.branch import MARKS, draw_lines, line_handles

KEY = "spontaneous_curvature"
SHOWN = 9.0
"""Spontaneous curvature of the paper's dashed line."""


def gibbs_loop(out: Path, stability: bool = True, **keys: object) -> ss.Branch:
    """The branch from the flat disc to where its neck closes."""
    case = ss.scenario("membrane-protrusion", **keys)
    return resumed_branch(out, case, KEY, 14.0, start=0.0, state="trivial", at=(SHOWN,), stability=stability)


def three_states(branch: ss.Branch) -> list[BranchPoint]:
    """The states at the paper's dashed line, in the order of the branch."""
    return labelled(branch, "user")


def run(out: Path, quick: bool) -> list[Row]:
    """Branch, figure, table; in full also the branch on a finer mesh of a higher degree."""
    branch = gibbs_loop(out / "gibbs", stability=not quick)
    draw(branch, out)
    rows = check(branch)
    if quick:
        return rows
    finer = gibbs_loop(out / "gibbs-finer", stability=False, elements=80, degree=5, mesh_tolerance=1e-6)
    return [*check_convergence(branch, finer), *rows, *check_stability(branch)]


def check_convergence(branch: ss.Branch, finer: ss.Branch) -> list[Row]:
    """The folds and the end, on two meshes."""
    (end,), (other,) = (labelled(one, "neck-closed") for one in (branch, finer))
    pairs = zip(("upper", "lower"), *(labelled(one, "fold") for one in (branch, finer)), strict=True)
    return [
        *(
            near(f"{name} fold, and on a finer mesh", "shown, no number", one.parameter, two.parameter, 1e-6)
            for name, one, two in pairs
        ),
        near("neck closes at C0 =, and on a finer mesh", "budding limit", end.parameter, other.parameter, 1e-5),
    ]


def check(branch: ss.Branch) -> list[Row]:
    """The loop and its end."""
    folds = labelled(branch, "fold")
    low, middle, high = three_states(branch)
    (end,) = labelled(branch, "neck-closed")
    return [
        Row(
            "folds, and the end where the neck closes",
            "two, budding limit",
            ", ".join(f"{point.parameter:.5f}" for point in (*folds, end)),
            f"{max(point.parameter_error for point in folds):.0e}",
            len(folds) == 2 and folds[1].parameter < SHOWN < folds[0].parameter < end.parameter,
        ),
        Row(
            f"states at C0 = {SHOWN:g}, heights",
            "three",
            ", ".join(f"{point.observables['height']:.4f}" for point in (low, middle, high)),
            "",
            low.observables["height"] < high.observables["height"] < middle.observables["height"],
        ),
        Row(
            "the outer two",
            "without and with neck",
            f"none, r_n = {high.observables['neck_radius']:.4f}",
            "",
            "neck_radius" not in low.observables and "neck_radius" in high.observables,
        ),
    ]


def check_stability(branch: ss.Branch) -> list[Row]:
    """Which parts are stable."""
    folds = labelled(branch, "fold")
    counts = [count for count in (point.n_unstable for point in branch.points if point.is_step) if count is not None]
    changes = [count for i, count in enumerate(counts) if i == 0 or count != counts[i - 1]]
    return [
        Row(
            "growing modes along the branch",
            "stable, unstable, stable",
            " ".join(map(str, changes)),
            "",
            changes == [0, 1, 0],
        ),
        Row(
            "they change at the folds",
            "yes",
            ", ".join(f"{fold.n_unstable_before} to {fold.n_unstable_after}" for fold in folds),
            "",
            [(fold.n_unstable_before, fold.n_unstable_after) for fold in folds] == [(0, 1), (1, 0)],
        ),
    ]


def draw(branch: ss.Branch, out: Path) -> None:
    """The loop, its end, and the three states at the dashed line."""
    with style.house_style():
        figure, (left, right) = panels((1.2, 1.0))
        left.legend(
            handles=line_handles(draw_lines(left, branch.points, "height", colour=style.BLUE)), loc="upper left"
        )
        for point in branch.special_points:
            if point.kind == "fold":
                left.plot(point.parameter, point.observables["height"], MARKS["fold"], color=style.BLUE, ms=3.5)
        end = branch.points[-1]
        left.plot(end.parameter, end.observables["height"], "o", color=style.INK, ms=5)
        left.annotate(
            "neck closes", (end.parameter, end.observables["height"]), (2, -12), textcoords="offset points", ha="center"
        )
        left.axvline(SHOWN, color=style.FAINT, linestyle="--", linewidth=0.8, zorder=0)
        for point, colour in zip(three_states(branch), (style.GREEN, style.FAINT, style.RED), strict=True):
            left.plot(point.parameter, point.observables["height"], "o", color=colour, ms=4, zorder=4)
        left.set_xlabel(style.quantity_label(branch.scenario.scales, KEY))
        left.set_ylabel(style.quantity_label(branch.scenario.scales, "height"))
        draw_states(right, branch, [*three_states(branch), end], ["no neck, stable", "unstable", "neck, stable", "bud"])
        right.set_title(r"states at $C_0 R_b = 9$, and where the neck closes")
        save(figure, out, "fig_3a")


if __name__ == "__main__":
    main(run)
