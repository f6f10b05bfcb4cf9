"""A map of swimmers (Fig. 5: Peclet number and hydrodynamic length) tile by tile, beside a loop over single solves.

The same observables are measured in both. Times are processor time on one core, everything compiled; where the map begins
(its anchors) is timed apart, because it does not grow with the number of points in a tile.
Run from the root: python -m benchmarks.bench_diagram [COUNT]   (COUNT x COUNT points, 40 without; a minute)
"""

from benchmarks.timing import machine, use_one_core

use_one_core()

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from shapespace.base.outcome import Outcome
from shapespace.study.diagram_store import DiagramStore, open_diagram
from shapespace.study.diagrams import make_anchors, make_request
from shapespace.study.grid import Axis, Grid
from shapespace.study.paths import StateName
from shapespace.study.scenario import scenario
from shapespace.study.steady import steady, steady_from
from shapespace.study.tiles import compute_tile, observable_names

PECLET, LENGTH = (25.0, 300.0), (0.1, 10.0)
SINGLE = 20
"""Points of the loop."""


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    most = int(sys.argv[2]) if len(sys.argv) > 2 else None
    case = scenario("polar-swimmer")
    grid = Grid(Axis("peclet", *PECLET, count), Axis("inverse_hydrodynamic_length", *LENGTH, count))
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        path, request = Path(folder) / "map", make_request(case, grid, ("default",), False)
        with DiagramStore.create(path, case, request, observable_names(case, grid.keys)) as store:
            make_anchors(case, grid, StateName.DEFAULT)
            start = time.process_time()
            store.append(make_anchors(case, grid, StateName.DEFAULT))
            print(f"{len(grid.tiles)} anchors: {time.process_time() - start:.1f} s")
            compute_tile(path, grid.tiles[0])
            # Tiles from all over the map stand for the rest where it is large.
            tiles = grid.tiles[:: max(1, len(grid.tiles) // most)] if most else grid.tiles
            start = time.process_time()
            done = [compute_tile(path, tile) for tile in tiles]
            seconds = time.process_time() - start
        points = sum(one.points for one in done)
        data = open_diagram(path).dataset
        print(f"{points} points, {sum(one.converged for one in done)} converged: {1e3 * seconds / points:.1f} ms a point, "
              f"{points / seconds:.0f} points/s")  # fmt: skip
        for name in ("iterations", "elements"):
            values, counts = np.unique(data[name].values[np.isfinite(data[name])], return_counts=True)
            print(f"    {name}: " + ", ".join(f"{n} x {v:g}" for v, n in zip(values, counts, strict=True)))
    middle = steady(case)
    x, y = (np.linspace(*ends, SINGLE) for ends in (PECLET, LENGTH))
    state = middle.problem.base.unpack(middle.found.x)
    start, converged = time.process_time(), 0
    for i in range(SINGLE):
        found = steady_from(case.with_overrides({"peclet": x[i], "inverse_hydrodynamic_length": y[i]}), state)
        converged += found.outcome is Outcome.CONVERGED and bool(found.observables)
    print(f"loop over single solves from one state: {1e3 * (time.process_time() - start) / SINGLE:.1f} ms a point, "
          f"{converged} of {SINGLE} converged")  # fmt: skip


if __name__ == "__main__":
    main()
