"""The cortex of a cell as an incompressible chiral active gel: a model that the package does not ship, in thirty lines.

What. A closed surface whose area is kept everywhere, around a fixed volume. At the equator an upstream signal keeps a ring of
motor filaments, a species c that diffuses and turns over. They contract along the ring, an active tension zeta (c/c_m - 1)
about the axis, and, being chiral, exert a torque tau c/c_m about the normal (Naganathan et al., eLife 3, e04165 (2014)). The
two halves of the cell turn against each other; a gel that cannot be compressed flows in no other way once its shape rests.

Everything below uses the public interface `shapespace.modelling` only; `shapespace --import experiments/chiral_cortex.py run
chiral-cortex`, and steady, branch, diagram alike, work without any change to the package.

Parameters: zeta = 20, tau = 4, Gamma = 1, D = 1, k = 9, ring of amplitude 2 and width 0.1414 in u, reduced volume 0.95.
Units: R_A, the radius of the sphere of the same area, kappa, tau = eta R_A^2/kappa, c_m.

Run:   python experiments/chiral_cortex.py [--quick] [--out DIR]        Time: 30 s on one core, --quick 20 s.

Expect: all of the chemical power that does work turns into heat of the rotation; the rotation is proportional to tau, the
shape does not know of it; near a sphere it is v_phi = -sum_l (tau_l/2R) dP_l/d theta/(Gamma + eta (l-1)(l+2)/R^2) with the
amplitudes tau_l of the torque, to the order sqrt(1 - v) by which the shape differs from a sphere. No such figure is in the
paper.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

import shapespace as ss
from shapespace.modelling import Free, Parameter, Ring, Species, define_model, define_scenario, power

if TYPE_CHECKING:
    from common import Row
    from shapespace.base.arrays import Array

PARAMETERS = {
    "ring_contraction": Parameter("zeta", "active tension along the ring", "E/L^2", 20.0),
    "torque": Parameter("tau", "active torque about the normal", "E/L^2", 4.0),
    "motor_concentration": Parameter("c_m", "concentration of motors without a ring", "C", 1.0, least=1e-6),
    "diffusivity": Parameter("D", "diffusivity of the motors", "L^2/T", 1.0, least=1e-6),
    "turnover_rate": Parameter("k", "turnover rate of the motors", "1/T", 9.0, least=0.0),
    "ring_amplitude": Parameter("Delta_c", "relative amplitude of the ring", "1", 2.0, least=0.0),
    "ring_width": Parameter("w", "width of the ring in u", "1", 0.02**0.5, least=1e-3),
}


@power("chemical")
def ring_tension(concentration, azimuthal_strain_rate, ring_contraction, motor_concentration):
    """Filaments along the ring contract it."""
    return -ring_contraction * (concentration / motor_concentration - 1.0) * azimuthal_strain_rate


@power("chemical")
def chiral_torque(concentration, vorticity, torque, motor_concentration):
    """Torque times the rate of spinning about the normal."""
    return 0.5 * torque * concentration / motor_concentration * vorticity


def motors(p):
    """They diffuse, and turn over towards a ring at the equator."""
    return Species(p.diffusivity, p.turnover_rate, Ring(p.motor_concentration, p.ring_amplitude, p.ring_width))


def define() -> None:
    """The model and its scenario."""
    define_model(
        "chiral-cortex",
        like="vesicle",
        laws=[ring_tension, chiral_torque],
        parameters=PARAMETERS,
        species=motors,
        ends={"species": (Free(), Free())},
        incompressible=True,
    )
    cell = {"reduced_volume": 0.95, "friction": 1.0, "azimuthal_flow": True, "until": 2.0}
    define_scenario("chiral-cortex", "A chiral cortex", "chiral-cortex", like="vesicle", **cell)


define()


def run(out: Path, quick: bool) -> "list[Row]":
    """Dynamics, states at rest, branch, map, figure, table."""
    from common import Row, near, resumed_branch

    define()
    case = ss.scenario("chiral-cortex", elements=20 if quick else 40)
    rest = ss.steady(case)
    at = rest.observables
    moving = ss.run(case.with_overrides({"until": 0.05 if quick else 2.0}))
    area = moving.dataset.area
    flows = {tau: azimuthal(case.with_overrides({"torque": tau}))[1] for tau in (2.0, 4.0)}
    gap = {v: sphere_gap(case.with_overrides({"reduced_volume": v})) for v in ((0.999,) if quick else (0.999, 0.9999))}
    rows = [
        Row("at rest", "", str(rest.outcome), f"residual {rest.found.residual:.0e}", rest.outcome.is_success, "not in the paper"),
        near("heat over chemical power", "1", at["dissipation"] / at["chemical_power"], 1.0, 1e-9, "not in the paper"),
        near("flow at twice the torque, over the flow", "2", ratio(flows), 2.0, 1e-9, "not in the paper"),
        near("area over its first value", "1", float(area[-1] / area[0]), 1.0, 1e-9, "not in the paper"),
        near("v_phi(u) + v_phi(1 - u)", "0", oddness(flows[4.0]), 0.0, 1e-6, "not in the paper"),
        *(
            near(f"flow beside that of a sphere, v = {v:g}", "0", one, 0.0, 2.0 * (1.0 - v) ** 0.5, "not in the paper")
            for v, one in gap.items()
        ),
    ]  # fmt: skip
    branches = {}
    for zeta in (0.0, 20.0):
        start = case.with_overrides({"ring_contraction": zeta})
        store = out / f"ring-{zeta:g}"
        branches[zeta] = resumed_branch(
            store, start, "reduced_volume", 0.85 if quick else 0.7, start=0.95, stability=not quick
        )
    ends = {zeta: branch.points[-1].observables["equator_radius"] for zeta, branch in branches.items()}
    narrower = ends[0.0] - ends[20.0]
    rows.append(Row("the ring narrows the waist", "", f"{narrower:.6f}", "", narrower > 1e-4, "not in the paper"))
    if not quick:
        axes = ("torque=1:4:4", "reduced_volume=0.85:0.95:3")
        found = ss.diagram(case, *axes, out=out / "map", workers=1)
        rows.append(
            Row(
                "map of torque and volume",
                "",
                f"{found.converged} states",
                "",
                found.converged == 12,
                "not in the paper",
            )
        )
    draw(rest, flows, branches, out)
    return rows


def azimuthal(case: ss.Scenario) -> "tuple[Array, Array, Array, Array]":
    """u, v_phi, the tangent angle and c of the state at rest."""
    from shapespace.study.dataset import profile_of

    fields = profile_of(case, ss.steady(case).frame)
    return tuple(fields[name] for name in ("mesh_coordinate", "azimuthal_velocity", "tangent_angle", "concentration"))


def ratio(flows: "dict[float, Array]") -> float:
    """Of the flows at torques 4 and 2, where they are largest."""
    one, two = flows[2.0], flows[4.0]
    return float(two[np.abs(one).argmax()] / one[np.abs(one).argmax()])


def oddness(flow: "Array") -> float:
    """What half a turn about a horizontal axis leaves over; the points are evenly spaced up to the mesh."""
    return float(np.abs(flow + flow[::-1]).max() / np.abs(flow).max())


def sphere_gap(case: ss.Scenario) -> float:
    """Largest difference of v_phi from that of the sphere with the same torque, over its largest value."""
    _, flow, psi, c = azimuthal(case)
    v = case.values()
    x = np.cos(psi)
    degrees = 30
    torque = legendre.legfit(x, float(v["torque"]) * c / float(v["motor_concentration"]), degrees)
    expected = np.zeros_like(x)
    for l in range(1, degrees + 1):
        slope = -np.sqrt(1.0 - np.minimum(x**2, 1.0)) * legendre.legval(x, legendre.legder(np.eye(degrees + 1)[l]))
        expected -= 0.5 * torque[l] * slope / (float(v["friction"]) + float(v["shear_viscosity"]) * (l - 1) * (l + 2))
    return float(np.abs(flow - expected).max() / np.abs(expected).max())


def draw(rest: "ss.Steady", flows: "dict[float, Array]", branches: "dict[float, ss.Branch]", out: Path) -> None:
    """The cell at rest, how its halves turn, and its waist against the volume."""
    from common import panels, save
    from shapespace.study.dataset import profile_of
    from shapespace.view import style

    fields, scales = profile_of(rest.scenario, rest.frame), rest.scenario.scales
    with style.house_style():
        figure, (left, middle, right) = panels((0.7, 1.0, 1.0), 62.0)
        z, r, turn = fields["axial_position"], fields["radius"], fields["azimuthal_velocity"]
        left.plot(np.append(r, -r[::-1]), np.append(z, z[::-1]), color=style.INK, linewidth=0.8)
        for place in range(10, len(z), 20):
            left.annotate(
                "", (turn[place] * 0.6, z[place]), (0.0, z[place]), arrowprops={"arrowstyle": "->", "lw": 0.7}
            )
        left.set_aspect("equal")
        left.set_axis_off()
        left.set_title("seen from the side")
        for (torque, flow), colour in zip(flows.items(), (style.BLUE, style.ORANGE), strict=True):
            middle.plot(fields["mesh_coordinate"], flow, color=colour, label=rf"$\tau$ = {torque:g}")
        middle.set_xlabel(style.quantity_label(scales, "mesh_coordinate"))
        middle.set_ylabel(style.quantity_label(scales, "azimuthal_velocity"))
        middle.legend()
        for (zeta, branch), colour in zip(branches.items(), (style.BLUE, style.ORANGE), strict=True):
            points = [(point.parameter, point.observables["equator_radius"]) for point in branch.points]
            right.plot(*np.array(points).T, color=colour, label=rf"$\zeta$ = {zeta:g}")
        right.set_xlabel(style.quantity_label(scales, "reduced_volume"))
        right.set_ylabel(style.quantity_label(scales, "equator_radius"))
        right.legend()
        save(figure, out, "chiral_cortex")


if __name__ == "__main__":
    from common import main

    main(run)
