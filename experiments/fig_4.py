"""Fig. 4: a contractile ring pinches a surface, slips to a pole, and the polarized surface swims.

What. With turnover that is uniform a centred ring of stress regulator is not stable: it pinches the surface, moves to one
of the poles, and leaves a polar pattern and shape that friction against the surroundings propels (Sec. V B 1 of the paper).

Parameters: Table 5; k = 9 and c_s = c0, which the text does not state for this figure, are those of Fig. 5; a small seed
without mirror symmetry: the scenario ring-slipping. Units: R0, kappa, tau = eta_b R0^2/kappa, c0.

Run:   python experiments/fig_4.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 30 s.

Expect: the maximum of the concentration stays at u = 1/2 first and ends at a pole; before that the equator is pinched; the
speed, zero at first, peaks as the pinched-off part is drawn in, and stays in the end, which is the stationary swimmer found
directly.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, main, near, settled_run


def run(out: Path, quick: bool) -> list[Row]:
    """The run with its figure, table."""
    found, steady = settled_run("fig_4", out, ss.scenario("ring-slipping"), quick)
    data = found.dataset
    ring, radius, speed = (data[name].to_numpy() for name in ("ring_position", "equator_radius", "velocity"))
    slips = int(np.flatnonzero(np.abs(ring - 0.5) > 0.1)[0])
    value, known = abs(found.observables["velocity"]), abs(steady.observables["velocity"])
    return [
        Row("ring", "centred, then at a pole", f"u = {ring[0]:.3g} to {ring[-1]:.3g}", "",
            abs(ring[0] - 0.5) < 0.05 and abs(ring[-1] - 0.5) > 0.49),
        Row("before it slips the surface", "ingresses", f"equator from {radius[0]:.3f} to {radius[: slips + 1].min():.3f}",
            "", radius[: slips + 1].min() < 0.99 * radius[0]),
        Row("speed", "follows the polarization", f"{abs(speed[0]):.1e} centred, {value:.4f} in the end", "",
            value > 100.0 * abs(speed[0])),
        Row("the end", "polar, swims", str(found.outcome), "", found.outcome in (ss.Outcome.STATIONARY, ss.Outcome.REACHED_END)),
        near("speed in the end (second column: found directly)", f"{known:.7g}", value, known, 1e-4),
    ]  # fmt: skip


if __name__ == "__main__":
    main(run)
