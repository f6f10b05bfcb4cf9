"""Fig. S2: perturb and wait: the dynamics near two dividing surfaces against their leading growth rates.

What. The paper tests the stability of a stationary surface by perturbing it and watching ||r - r0|| + ||z - z0|| + ||c
- c0|| in a simulation. We perturb along the leading mode of the linearised dynamics, so that the deviation has to
follow exp(s t) with the leading rate s as long as it is small: the sign that the paper's test asks for, and the rate
itself.

Parameters: Table 5, Pe = 450, Delta_c = 4, R0/L_h = 0.3 (Fig. 7c), at k = 45, stable, and k = 35, unstable; the paper's
two points are not named. Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_s2.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 20 s.

Expect: s = -4.66973/tau at k = 45 and 1.630/tau at k = 35, both antisymmetric: the ring slips off the neck or returns.
The rates of the simulations agree to 1 %.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, main, near, panels, resumed_branch, save
from shapespace.base.arrays import Array
from shapespace.base.scales import Scales
from shapespace.study.engine import Engine, state_of
from shapespace.study.starts import Start
from shapespace.view import style

KEY = "turnover_rate"
STABLE, UNSTABLE = 45.0, 35.0
KICK = {STABLE: 1e-3, UNSTABLE: 1e-5}
"""Size of the perturbation, in the norm in which modes have size one."""
FOLDS = 4.0
"""The simulated time, in units of 1/|s|."""
SAMPLES = np.linspace(0.0, 1.0, 401)


def run(out: Path, quick: bool) -> list[Row]:
    """States, simulations, figure, table."""
    case = ss.scenario("guided-division", elements=80, time_tolerance=1e-8, stationary_rate=0.0)
    branch = resumed_branch(out / "turnover", case, KEY, UNSTABLE, start=STABLE, stability=False)
    rows, curves = [], {}
    for value, label in ((STABLE, "start"), (UNSTABLE, "end-1")):
        at = branch.scenario_at(branch[label])
        rest = ss.steady(at, start=f"{branch.store}:{label}")
        rates = rest.rates()
        leading = rates.values[0][0]
        until = (2.0 if quick else FOLDS) / abs(leading)
        found = ss.run(at.with_overrides({"until": until}), start=rest.perturbed(KICK[value]))
        times, sizes = deviations(found, Start("", at, rest.frame))
        curves[value] = (times, sizes, leading)
        measured = fitted(times, sizes)
        sign = "stable" if leading < 0.0 else "unstable"
        rows += [
            Row(f"k = {value:g}", sign, f"n_unstable = {rates.n_unstable}", "", rates.n_unstable == int(leading > 0.0)),
            Row("its leading mode", "ring slips", str(rates.parities[0]), "", rates.parities[0] == "antisymmetric"),
            near("rate (second column: of the spectrum)", f"{leading:.5f}", measured, leading, 0.01 * abs(leading)),
        ]  # fmt: skip
    draw(curves, case.scales, out)
    return rows


def deviations(run: ss.Run, rest: Start) -> tuple[Array, Array]:
    """Times and ||r - r0|| + ||z - z0|| + ||c - c0|| over u, in the frame that moves with the surface."""
    known = sampled(rest)
    states = [run.state(number) for number in range(run.steps + 1)]
    gaps = np.array([sampled(state) - known for state in states])
    sizes = np.sqrt(np.trapezoid(gaps**2, SAMPLES, axis=1)).sum(axis=-1)
    return np.array([state.frame.time for state in states]), sizes


def sampled(state: Start) -> Array:
    """r, z and c at the samples, (samples, 3)."""
    names = Engine.of(state.scenario).system.fields
    return state_of(state.frame).values(SAMPLES)[:, [names.index(name) for name in ("r", "z", "c")]]


def fitted(times: Array, sizes: Array) -> float:
    """The rate of exponential growth after the first steps, in which what is not in the mode dies away."""
    late = times > 0.2 * times[-1]
    return float(np.polyfit(times[late], np.log(sizes[late]), 1)[0])


def draw(curves: dict[float, tuple[Array, Array, float]], scales: Scales, out: Path) -> None:
    """The deviation over time beside what the spectrum says of it."""
    with style.house_style():
        figure, axes = panels((1.0, 1.0), 70.0)
        for place, (value, (times, sizes, rate)) in zip(axes, reversed(curves.items()), strict=True):
            place.semilogy(times, sizes, "o", color=style.BLUE, ms=2.5, label="dynamics")
            place.semilogy(
                times,
                sizes[0] * np.exp(rate * times),
                color=style.INK,
                linewidth=0.8,
                label=f"exp({style.number(rate, 4)} t)",
            )
            at = style.quantity_value(scales, "turnover_rate", value)
            place.set_title(f"{at}: {'stable' if rate < 0.0 else 'unstable'}")
            place.set_xlabel(style.quantity_label(scales, "time"))
            place.set_ylabel(r"$\| f - f_0 \|$")
            place.legend()
        save(figure, out, "fig_s2")


if __name__ == "__main__":
    main(run)
