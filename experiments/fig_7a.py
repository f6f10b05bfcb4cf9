"""Fig. 7a: regimes of guided division over the ring's amplitude and the Peclet number: ellipsoids, dumbbells, and both.

What. A weak ring or weak contractility leaves an ellipsoid, both strong a dumbbell, and between these lies a wedge where
either is found (Sec. V B 2 of the paper). We compute all stationary states that folds connect at each point of a grid in
(Delta_c, Pe). The wedge is bounded by the folds of the ellipsoid and of the dumbbell, which we locate on one branch and
follow in both parameters, the dumbbell's to the cusp where it ends, and by the pitchfork at which the dumbbell yields to
a slipping ring. The dynamics is run from a sphere and from a slightly slipped dumbbell: crosses are points where both
come to the same surface, circles those where they do not.

Parameters: Table 5, k = 45, R0/L_h = 0.3, c_s = 10, w^2 = 0.02. The paper considers Pe < 500; the ranges Delta_c = 0 to 8,
Pe = 60 to 500 are ours. Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_7a.py [--quick] [--out DIR]        Time: 15 min on two cores, --quick 1 min on one.

Expect: at Pe = 450 folds at Delta_c = 2.36247419 and 1.29348538, which AUTO-07p finds as well; three states at every
point between the two curves and one elsewhere; towards Pe = 67 the ellipsoid's fold goes to Delta_c = 41 and turns, so that
the wedge does not close at weak contractility; towards strong contractility it narrows, and the dumbbell's fold ends in a
cusp at Delta_c = 0.116, Pe = 1954.9, beyond the paper's range. Well before its fold the ellipsoid has a slight waist, so that
in a part of the wedge both surfaces have a neck, a wide one and a narrow one. Between the dumbbell's fold and the
pitchfork, which parts from it at Pe = 221.3, the dumbbell is unstable: there, too, the dynamics has one attractor.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

import shapespace as ss
from common import Row, labelled, main, near, panels, resumed_branch, save
from fig_7b import AUTO
from shapespace.study.boundaries import distances, find_changes
from shapespace.study.curve_store import Curve, outline
from shapespace.study.regimes import SHAPE, Regime, describe
from shapespace.view import style
from shapespace.view.curve import draw_curve
from shapespace.view.diagram import draw_regimes

RING, PECLET, NECK = "ring_amplitude", "peclet", "equator_radius"
LEAST, MOST = 60.0, 500.0
"""Peclet numbers of the map,"""
WEAKEST, STRONGEST, SLIPPING = 50.0, 2000.0, 220.0
"""how far the folds are followed, and how far down the pitchfork: from there on what it parts is unstable anyway."""
CUSP = (0.115992, 1954.913)
"""Where the dumbbell's fold ends: the same on 40 and 80 elements, tests/study/test_curves.py."""
PARTING = 221.3145
"""Peclet number at which fold and pitchfork of the dumbbell meet, found on both curves alike."""
CHECKS = (
    *((amplitude, 450.0) for amplitude in (1.0, 1.36, 1.8, 3.0)),
    *((amplitude, 300.0) for amplitude in (1.2, 2.6, 4.5)),
    *((amplitude, 150.0) for amplitude in (2.5, 5.0, 8.0)),
)
"""Ring amplitude and Peclet number of the dynamic checks."""
SAME = 1e-3
"""Neck radii of one and the same surface differ by less."""
KICK = 1e-3


def run(out: Path, quick: bool) -> list[Row]:
    """The map, its curves, the dynamics, figure, table."""
    case = ss.scenario("guided-division", until=500.0)
    branch = resumed_branch(out / "branch", case, RING, 4.2, start=0.0, stability=False)
    bounds = (400.0, MOST) if quick else (WEAKEST, STRONGEST)
    folds = zip(("ellipsoid", "dumbbell"), labelled(branch, "fold"), strict=True)
    curves = {name: followed(out, branch, fold.label, bounds) for name, fold in folds}
    rows = check_folds(curves)
    found = None
    if not quick:
        fork = labelled(branch, "pitchfork")[-1]
        curves["slipping"] = followed(out, branch, fork.label, (SLIPPING, MOST))
        axes = f"{RING}=0:8:33", f"{PECLET}={LEAST:g}:{MOST:g}:12"
        found = ss.diagram(case, *axes, branches=3, out=out / "map", resume=True)
        rows += check_map(found, curves) + check_cusp(curves)
    seen = dynamics(case, CHECKS[:3:2] if quick else CHECKS)
    rows += check_dynamics(seen, curves)
    draw(found, curves, seen, out)
    return rows


def followed(out: Path, branch: ss.Branch, name: str, bounds: tuple[float, float]) -> Curve:
    """A point of the branch, followed in both parameters."""
    return ss.curve(
        f"{branch.store}:{name}", PECLET, bounds[1], start=bounds[0], out=out / f"curve-{name}", resume=True
    )


def amplitude_at(curve: Curve, peclet: float) -> float:
    """The largest ring amplitude below 20 at which a curve passes a Peclet number; infinite where it does not."""
    rings, values = outline(curve.points)[[curve.keys.index(RING), curve.keys.index(PECLET)]]
    below = values < peclet
    places = np.flatnonzero((below[1:] != below[:-1]) & (rings[1:] < 20.0))
    shares = (peclet - values[places]) / (values[places + 1] - values[places])
    return float(max(rings[places] + shares * (rings[places + 1] - rings[places]), default=np.inf))


def check_folds(curves: dict[str, Curve]) -> list[Row]:
    """The curves pass the folds that another program finds at Pe = 450."""
    rows = []
    for (name, curve), auto in zip(curves.items(), AUTO, strict=True):
        start = next(point for point in curve.points if abs(point.parameters[curve.keys.index(PECLET)] - 450.0) < 1e-9)
        value = float(start.parameters[curve.keys.index(RING)])
        rows.append(near(f"Pe = 450: {name}'s fold (second column: AUTO-07p)", f"{auto:.9f}", value, auto, 1e-6))
    return rows


def check_map(found: ss.Diagram, curves: dict[str, Curve]) -> list[Row]:
    """Regimes, and the number of states against the two curves of folds."""
    data = found.dataset
    folds = [curves[name] for name in ("ellipsoid", "dumbbell")]
    upper, lower = (np.array([amplitude_at(fold, value) for value in data[PECLET].to_numpy()]) for fold in folds)
    rings = data[RING].to_numpy()
    is_inside = (rings > lower[:, None]) & (rings < upper[:, None])
    counts = data["n_states"].transpose(PECLET, RING).to_numpy()
    changes = find_changes(found)
    places = np.stack([change.middle for change in changes])
    apart = np.min([distances(places, curve, found) for curve in folds], axis=0).max()
    shapes = found.regimes & int(SHAPE)
    words = sorted({describe(int(code)) for code in shapes.ravel()})
    corners = describe(int(shapes[0, 0])), describe(int(shapes[-1, -1]))
    waists = int((is_inside & (shapes == Regime.NECK)).sum())
    wrong = int((counts != np.where(is_inside, 3, 1)).sum())
    return [
        Row("regimes", "ellipsoid, dumbbell, both", ", ".join(words), "", words == ["neck", "no neck", "no neck & neck"]),
        Row("small Pe and Delta_c; both large", "ellipsoid; dumbbell", "; ".join(corners), "",
            corners == ("no neck", "neck")),
        Row("points with three states between the folds, one elsewhere", "two stable, one unstable",
            f"{counts.size - wrong} of {counts.size}", "", wrong == 0),
        Row("of the points between the folds, ellipsoid with a waist at", "-", f"{waists} of {is_inside.sum()}", "",
            0 < waists < is_inside.sum(), "not in the paper"),
        Row("changes of the map, cells from the folds", "-", f"{apart:.2f}", "", bool(apart < 1.0), "not in the paper"),
    ]  # fmt: skip


def check_cusp(curves: dict[str, Curve]) -> list[Row]:
    """Where the wedge ends, and where the dumbbell loses stability before its fold."""
    dumbbell, slipping = curves["dumbbell"], curves["slipping"]
    cusp = next(point for point in dumbbell.special_points if point.kind == "cusp")
    order = [dumbbell.keys.index(key) for key in (RING, PECLET)]
    ring, peclet = cusp.parameters[order]
    meeting = min((point for curve in (dumbbell, slipping) for point in curve.special_points
                   if point.kind == "fold-pitchfork"), key=lambda point: abs(point.parameters[order[1]] - PARTING))  # fmt: skip
    words = "not in the paper"
    return [
        near("dumbbell's fold ends in a cusp at Delta_c", "not shown", float(ring), CUSP[0], 1e-4, words),
        near("and Pe", "not shown", float(peclet), CUSP[1], 0.1, words),
        near("its pitchfork parts from the fold at Pe", "stable up to the fold", float(meeting.parameters[order[1]]),
             PARTING, 1e-2, "differs"),
    ]  # fmt: skip


def dynamics(
    case: ss.Scenario, points: Sequence[tuple[float, float]]
) -> dict[tuple[float, float], tuple[float, float]]:
    """Neck radii that the dynamics comes to from a sphere and from a dumbbell off its symmetry."""
    dumbbell = ss.steady(case).perturbed(KICK)
    seen = {}
    for ring, peclet in points:
        at = case.with_overrides({RING: ring, PECLET: peclet})
        runs = [ss.run(at, start=start) for start in (None, dumbbell)]
        assert all(one.outcome is ss.Outcome.STATIONARY for one in runs), [one.outcome for one in runs]
        seen[ring, peclet] = runs[0].observables[NECK], runs[1].observables[NECK]
    return seen


def check_dynamics(seen: dict[tuple[float, float], tuple[float, float]], curves: dict[str, Curve]) -> list[Row]:
    """Two attractors where, by the curves, ellipsoid and dumbbell are stable; one elsewhere."""
    rows = []
    for (ring, peclet), (one, other) in seen.items():
        ends = [amplitude_at(curve, peclet) for curve in curves.values()]
        stable_from = max(end for end in ends[1:] if np.isfinite(end))
        expected = 2 if stable_from < ring < ends[0] else 1
        told = f"neck radii {one:.4f}, {other:.4f}"
        is_strip = ends[1] < ring < stable_from
        rows.append(
            Row(f"attractors at Pe = {peclet:g}, Delta_c = {ring:g}", "1" if expected == 1 and not is_strip else "2", told,
                "", (abs(one - other) > SAME) == (expected == 2), "differs" if is_strip else "agrees")
        )  # fmt: skip
    return rows


def draw(
    found: ss.Diagram | None,
    curves: dict[str, Curve],
    seen: dict[tuple[float, float], tuple[float, float]],
    out: Path,
) -> None:
    """Regimes with curves and checks; on the right the same curves as far as they were followed."""
    with style.house_style():
        figure, (left, right) = panels((1.25, 1.0), 88.0)
        scales = next(iter(curves.values())).scenario.scales
        if found is not None:
            draw_regimes(left, found, found.regimes)
        for axes in (left, right):
            for number, curve in enumerate(curves.values()):
                draw_curve(axes, curve, (RING, PECLET), named=axes is left and number != 1)
        for (ring, peclet), (one, other) in seen.items():
            left.plot(
                ring, peclet, "o" if abs(one - other) > SAME else "x", color=style.INK, ms=4.0, mfc="none", zorder=4
            )
        if found is None:
            left.set(xlim=(0.0, 4.0), ylim=(400.0, MOST))
        else:
            left.set(xlim=(0.0, 8.12), ylim=(42.0, 518.0))
        left.set_xlabel(style.quantity_label(scales, RING))
        show_beyond(right)
        right.set_xlabel(style.quantity_label(scales, RING))
        for axes in (left, right):
            axes.set_ylabel(style.quantity_label(scales, PECLET))
        handles, names = left.get_legend_handles_labels()
        marks = (("x", "dynamics: one attractor"), ("o", "dynamics: two attractors"))
        handles += [Line2D([], [], color=style.INK, linestyle="", marker=mark, ms=4.0, mfc="none") for mark, _ in marks]
        figure.legend(handles, [*names, *(text for _, text in marks)], ncols=4, loc="outside lower center")
        save(figure, out, "fig_7a")


def show_beyond(axes: Axes) -> None:
    """The panel with the whole curves."""
    axes.set(xscale="log", yscale="log", xlim=(0.09, 60.0), ylim=(45.0, 2.3e3))
    axes.set_title("beyond the paper's range: the cusp")


if __name__ == "__main__":
    main(run)
