"""Fig. 6: guided division: a prescribed ring contracts a sphere until a thin neck remains.

What. Recruitment of stress regulator around the equator makes a contractile ring that turnover keeps in place. The surface
ingresses almost completely; bending rigidity keeps the neck open (Sec. V B 2 of the paper).

Parameters: Table 5, Pe = 450, Delta_c = 4, k = 45, R0/L_h = 0.3, c_s = 10, w^2 = 0.02: the scenario guided-division.
Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_6.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 30 s.

Expect: the neck radius falls from 1 to 0.0038, below 0.02 around t = 0.2; the meridional curvature at the neck is a few
hundred; the end is the divided stationary state found directly.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, main, near, settled_run


def run(out: Path, quick: bool) -> list[Row]:
    """The run with its figure, table."""
    found, steady = settled_run("fig_6", out, ss.scenario("guided-division"), quick)
    data = found.dataset
    radius, time = (data[name].to_numpy() for name in ("equator_radius", "time"))
    late = float(time[np.flatnonzero(radius < 0.02)[0]])
    curvature = found.observables["max_meridional_curvature"]
    value, known = found.observables["equator_radius"], steady.observables["equator_radius"]
    return [
        Row("neck radius", "1 to almost 0", f"{radius[0]:.4f} to {value:.5f}", "",
            abs(radius[0] - 1.0) < 1e-6 and 0.0 < value < 0.01),
        Row("it is below 0.02 at t", "0.2", f"{late:.3f}", "", 0.1 < late < 0.3),
        Row("meridional curvature at the neck", "about 300", f"{curvature:.0f}", "", 200.0 < curvature < 800.0),
        Row("the neck", "stays open, at rest", str(found.outcome), "",
            found.outcome in (ss.Outcome.STATIONARY, ss.Outcome.REACHED_END)),
        near("its radius in the end (second column: found directly)", f"{known:.7g}", value, known, 1e-5),
    ]  # fmt: skip


if __name__ == "__main__":
    main(run)
