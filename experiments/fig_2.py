"""Fig. 2: a coat with spontaneous curvature bends a flat membrane into a protrusion that stops growing.

What. A clamped fluid membrane with a coated patch of fixed material area starts flat and is drawn from a reservoir at
constant tension into a protrusion (Sec. V A of the paper). We run the dynamics to rest and compare its end with the
stationary state found directly.

Parameters: Table 4, C0 R_b = 9: the scenario membrane-protrusion. Units: R_b, kappa, tau = eta_s R_b^2/kappa.

Run:   python experiments/fig_2.py [--quick] [--out DIR]        Time: 1 min on one core, --quick 30 s.

Expect: the height rises all the time and saturates; the normal velocity is largest at the pole at first; all flows vanish
in the end, which is the stationary state without neck.
"""

from pathlib import Path

import numpy as np

import shapespace as ss
from common import Row, main, near, settled_run


def run(out: Path, quick: bool) -> list[Row]:
    """The run with its figure, table."""
    found, steady = settled_run("fig_2", out, ss.scenario("membrane-protrusion"), quick)
    data = found.dataset
    height = data["height"].to_numpy()
    first = np.abs(data["normal_velocity"].isel(time=1).to_numpy())
    value, known = found.observables["height"], steady.observables["height"]
    dissipation = data["dissipation"].to_numpy()
    return [
        Row("flat membrane", "bends, protrudes", f"height {height[0]:.1e} to {height[-1]:.4f}", "",
            bool((np.diff(height) > -1e-6).all()) and height[0] < 1e-6),
        Row("normal velocity is largest at first", "at the pole", f"at point {first.argmax()} of {first.size}", "",
            first.argmax() < 0.05 * first.size),
        Row("growth", "saturates", str(found.outcome), "", found.outcome in (ss.Outcome.STATIONARY, ss.Outcome.REACHED_END)),
        Row("flows in the end", "vanish", f"dissipation {dissipation[-1] / np.nanmax(dissipation):.0e} of its largest", "",
            dissipation[-1] < 1e-4 * np.nanmax(dissipation)),
        near("height in the end (second column: found directly)", f"{known:.7g}", value, known, 1e-4),
    ]  # fmt: skip


if __name__ == "__main__":
    main(run)
