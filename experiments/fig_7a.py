"""Fig. 7a: regimes of guided division over the ring's amplitude and the Peclet number: ellipsoids, dumbbells, and both.

What. A weak ring or weak contractility leaves an ellipsoid, both strong a dumbbell, and between these lies a wedge where
either is found (Sec. V B 2 of the paper). We compute all stationary states that folds connect at each point of a grid in
(Delta_c, Pe), and follow in both parameters what bounds the wedge, far beyond the paper's range: the folds of the ellipsoid
and of the dumbbell, and the pitchforks at which the ellipsoid polarizes and the dumbbell yields to a slipping ring. The
dynamics is run from a sphere and from a slightly slipped dumbbell: crosses are points where both come to the same
surface, circles those where they do not.

Parameters: Table 5, k = 45, R0/L_h = 0.3, c_s = 10, w^2 = 0.02. The paper considers Pe < 500; the ranges Delta_c = 0 to 8,
Pe = 60 to 500 are ours. Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_7a.py [--quick] [--out DIR]        Time: 3 to 10 min on two cores, --quick 30 s on one.

Expect: at Pe = 450 folds at Delta_c = 2.36247419 and 1.29348538, which AUTO-07p finds as well; three states at every
point between the two curves and one elsewhere. Well before its fold the ellipsoid has a slight waist, so that in a part of
the wedge both surfaces have a neck, a wide one and a narrow one. The two folds never meet:

Towards weak contractility both turn to ever stronger rings, the ellipsoid's at Pe = 66.98, Delta_c = 41.5, the dumbbell's
at Pe = 32.72, Delta_c = 28.6: a ring that saturates the tension everywhere no longer pinches. Below Pe = 66.98 there is an
ellipsoid at any amplitude, below Pe = 32.72 no dumbbell at any.

Towards strong contractility both surfaces lose stability before they vanish. The ellipsoid does at a pitchfork that parts
from its fold at Pe = 620.3 and comes to Delta_c = 0 where the sphere polarizes, Pe* = 2397.2. The dumbbell is stable from
its own pitchfork on, which parts from its fold at Pe = 221.3, up to where its neck grows too thin: another stretch of that
pitchfork, from Pe = 487.5 on, a third fold, from Pe = 668.5 on, or oscillations. Between Pe = 860 and 900 nothing is left
in between, and with it of the wedge of two stable shapes. The dumbbell's fold itself goes on to a cusp at Delta_c = 0.116,
Pe = 1954.9, where it meets that third fold; the ellipsoid's is then at Delta_c = 0.46.
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
from shapespace.view.curve import MARKS, draw_curve
from shapespace.view.diagram import draw_regimes

RING, PECLET, NECK = "ring_amplitude", "peclet", "equator_radius"
LEAST, MOST = 60.0, 500.0
"""Peclet numbers of the map,"""
WEAKEST, STRONGEST = 30.0, 2000.0
"""how far the folds are followed,"""
POLAR = (2.0 + 45.0) * (1.0 + 10.0**2) ** 2 / (2.0 * 10.0**2)
"""up to where the ellipsoid's pitchfork, the sphere's own number (2 + k)(1 + c_s^2)^2/(2 c_s^2),"""
SLIPPING = (220.0, 900.0)
"""and the dumbbell's; below, what it parts is unstable anyway."""
TURNS = {"ellipsoid": (41.5473, 66.9772), "dumbbell": (28.6405, 32.7154)}
"""Ring amplitude and Peclet number where the folds turn,"""
CUSPS = ((0.115992, 1954.913), (1.161233, 668.543))
"""of the cusps where the dumbbell's fold meets a third one and that a fourth: the same on 40 and 80 elements,"""
PARTING = {"ellipsoid": 620.2698, "dumbbell": 221.3145}
"""and Peclet numbers at which fold and pitchfork meet, found on both curves alike;"""
THIN = (2.37071, 487.5378)
"""where the dumbbell's pitchfork comes back to it, at a neck of radius 0.003,"""
STABLE, GONE = 860.0, 900.0
"""and Peclet numbers between which no stable dumbbell is left beside its fold."""
CHECKS = (
    *((amplitude, 450.0) for amplitude in (1.0, 1.36, 1.8, 3.0)),
    *((amplitude, 300.0) for amplitude in (1.2, 2.6, 4.5)),
    *((amplitude, 150.0) for amplitude in (2.5, 5.0, 8.0)),
)
"""Ring amplitude and Peclet number of the dynamic checks."""
SAME = 1e-3
"""Neck radii of one and the same surface differ by less."""
KICK = 1e-3
POINTS = {"fold-pitchfork": "pitchfork meets fold", "cusp": "two folds meet", "turn": "fold turns"}
"""Special points of the curves that the legend names."""
BEYOND = "not in the paper"


def run(out: Path, quick: bool) -> list[Row]:
    """The map, its curves, the dynamics, figure, table."""
    case = ss.scenario("guided-division", until=500.0)
    branch = resumed_branch(out / "branch", case, RING, 4.2, start=0.0, stability=False)
    bounds = (390.0, 510.0) if quick else (WEAKEST, STRONGEST)
    folds = zip(("ellipsoid", "dumbbell"), labelled(branch, "fold"), strict=True)
    curves = {name: followed(out, branch, fold.label, bounds) for name, fold in folds}
    axes = f"{RING}=0:8:33", f"{PECLET}={LEAST:g}:{MOST:g}:12"
    if quick:
        axes = f"{RING}=0.5:3.5:5", f"{PECLET}=400:{MOST:g}:2"
    found = ss.diagram(case, *axes, branches=3, out=out / "map", resume=True, workers=1 if quick else None)
    rows = check_folds(curves) + check_map(found, curves)
    if not quick:
        forks = labelled(branch, "pitchfork")
        curves["slipping"] = followed(out, branch, forks[-1].label, SLIPPING)
        curves["polarizing"] = followed(out, branch, forks[0].label, (450.0, POLAR))
        rows += check_weak_end(curves) + check_strong_end(curves) + check_necks(out, case)
    seen = dynamics(case, CHECKS[:3:2] if quick else CHECKS)
    rows += check_dynamics(seen, curves)
    draw(found, curves, seen, out)
    return rows


def followed(out: Path, branch: ss.Branch, name: str, bounds: tuple[float, float]) -> Curve:
    """A point of the branch, followed in both parameters."""
    return ss.curve(
        f"{branch.store}:{name}", PECLET, bounds[1], start=bounds[0], out=out / f"curve-{name}", resume=True
    )


def special(kind: str, peclet: float, *curves: Curve) -> tuple[float, float]:
    """Ring amplitude and Peclet number of the special point of a kind, on any of the curves, nearest to a Peclet number."""
    found = [dict(zip(curve.keys, one.parameters.tolist(), strict=True)) for curve in curves
             for one in curve.special_points if one.kind == kind]  # fmt: skip
    nearest = min(found, key=lambda one: abs(one[PECLET] - peclet))
    return nearest[RING], nearest[PECLET]


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


def check_weak_end(curves: dict[str, Curve]) -> list[Row]:
    """Towards weak contractility the folds turn to stronger rings, one after the other."""
    rows = []
    for name, (amplitude, peclet) in TURNS.items():
        ring, found = special("turn", peclet, curves[name])
        rows.append(near(f"{name}'s fold turns at Pe", "not shown", found, peclet, 1e-2, BEYOND))
        rows.append(near("and Delta_c", "not shown", ring, amplitude, 1e-2, BEYOND))
    return rows


def check_strong_end(curves: dict[str, Curve]) -> list[Row]:
    """Towards strong contractility pitchforks part from both folds; the dumbbell's goes on to a cusp with a third fold."""
    rows = [near(f"{name}'s pitchfork parts from its fold at Pe", paper,
                 special("fold-pitchfork", PARTING[name], curves[name], curves[fork])[1], PARTING[name], 1e-2, verdict)
            for name, fork, paper, verdict in (("ellipsoid", "polarizing", "not shown", BEYOND),
                                               ("dumbbell", "slipping", "stable up to the fold", "differs"))]  # fmt: skip
    rows.append(near("ellipsoid's pitchfork, at the sphere's own Pe, at Delta_c", "0",
                     amplitude_at(curves["polarizing"], POLAR - 1e-3), 0.0, 1e-3, BEYOND))  # fmt: skip
    for with_, (amplitude, peclet) in zip(
        ("dumbbell's fold meets a third", "which meets a fourth"), CUSPS, strict=True
    ):
        ring, found = special("cusp", peclet, curves["dumbbell"])
        rows.append(near(f"{with_} in a cusp at Delta_c", "not shown", ring, amplitude, 1e-4, BEYOND))
        rows.append(near("and Pe", "not shown", found, peclet, 0.1, BEYOND))
    apart = amplitude_at(curves["ellipsoid"], CUSPS[0][1]) - CUSPS[0][0]
    rows.append(
        Row("at the first cusp, ellipsoid's fold is away by Delta_c", "-", f"{apart:.3f}", "", apart > 0.3, BEYOND)
    )
    return rows


def check_necks(out: Path, case: ss.Scenario) -> list[Row]:
    """Dumbbells lose stability where their necks grow too thin, and beside their fold at all where contractility is strong."""
    left = {}
    for peclet in (STABLE, GONE):
        name = f"branch-{peclet:g}"
        # Oscillations set in beside the third fold, where some are not located.
        at = case.with_overrides({PECLET: peclet})
        found = resumed_branch(out / name, at, RING, 4.2, start=0.0, blind=(0.72, 0.78))
        places = [fold.place for fold in labelled(found, "fold")]
        left[peclet] = any(places[1] < point.place < places[2] and point.n_unstable == 0 for point in found.points)
    thin = resumed_branch(
        out / "branch-thin", case.with_overrides({PECLET: 495.0}), RING, 4.2, start=0.0, stability=False
    )
    fork = max(labelled(thin, "pitchfork"), key=lambda point: point.place)
    curve = ss.curve(f"{thin.store}:{fork.label}", PECLET, 480.0, out=out / "curve-thin", resume=True)
    ring, peclet = special("turn", THIN[1], curve)
    told = f"Pe between {STABLE:g} and {GONE:g}"
    return [
        Row("both surfaces stable up to", "beyond Pe = 500", told, "", left[STABLE] and not left[GONE], BEYOND),
        near("dumbbells with thin necks slip from Pe", "stable", peclet, THIN[1], 1e-2, "differs"),
        near("on, around Delta_c", "stable", ring, THIN[0], 1e-2, "differs"),
    ]


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
        ends = [amplitude_at(curves[name], peclet) for name in ("ellipsoid", "dumbbell", "slipping") if name in curves]
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
    found: ss.Diagram,
    curves: dict[str, Curve],
    seen: dict[tuple[float, float], tuple[float, float]],
    out: Path,
) -> None:
    """Regimes with curves and checks; on the right the same curves as far as they were followed."""
    with style.house_style():
        figure, (left, right) = panels((1.25, 1.0), 88.0)
        scales = found.scenario.scales
        draw_regimes(left, found, found.regimes)
        for axes in (left, right):
            for name, curve in curves.items():
                # The ellipsoid's pitchfork parts from the fold beyond the map; one curve of each kind stands in the legend.
                if axes is right or name != "polarizing":
                    draw_curve(axes, curve, (RING, PECLET), named=axes is left and name in ("ellipsoid", "slipping"))
        for (ring, peclet), (one, other) in seen.items():
            left.plot(
                ring, peclet, "o" if abs(one - other) > SAME else "x", color=style.INK, ms=4.0, mfc="none", zorder=4
            )
        x, y = found.request.grid.x, found.request.grid.y
        left.set(xlim=(max(x.start - 0.5 * x.step, 0.0), x.stop + 0.5 * x.step),
                 ylim=(y.start - 0.5 * y.step, y.stop + 0.5 * y.step))  # fmt: skip
        left.set_xlabel(style.quantity_label(scales, RING))
        show_beyond(right)
        right.set_xlabel(style.quantity_label(scales, RING))
        for axes in (left, right):
            axes.set_ylabel(style.quantity_label(scales, PECLET))
        handles, names = left.get_legend_handles_labels()
        marks = (("x", "dynamics: one attractor"), ("o", "dynamics: two attractors"))
        handles += [Line2D([], [], color=style.INK, linestyle="", marker=mark, ms=4.0, mfc="none") for mark, _ in marks]
        names += [text for _, text in marks]
        kinds = {point.kind for curve in curves.values() for point in curve.special_points}
        for kind, text in POINTS.items():
            if kind in kinds:
                handles.append(Line2D([], [], color=style.RED, linestyle="", marker=MARKS[kind], ms=4.0))
                names.append(text)
        figure.legend(handles, names, ncols=4, loc="outside lower center")
        save(figure, out, "fig_7a")


def show_beyond(axes: Axes) -> None:
    """The panel with the whole curves."""
    axes.set(xscale="log", yscale="log", xlim=(0.09, 60.0), ylim=(25.0, 2.6e3))
    axes.set_title("beyond the paper's range")


if __name__ == "__main__":
    main(run)
