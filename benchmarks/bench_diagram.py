"""Maps of swimmers (Fig. 5: Peclet number and hydrodynamic length): what a point costs, beside single solves and solve_bvp.

Run from the root: python -m benchmarks.bench_diagram [PART ...]
    points      COUNT x COUNT points tile by tile, a loop over single solves on a diagonal of them, and solve_bvp with natural
                continuation along a row of them; processor time on one core, everything compiled (a minute)
    growth      cost per point on grids of 50 x 50 to 500 x 500, sampled by tiles (two minutes)
    workers     the same map by one and by two processes, wall-clock; wants an idle machine (a minute)
    batch       residual and Jacobian of B states at once, by jax.vmap and jax.lax.map, against a loop over single ones, on one
                core (two minutes, of which most is compiling)
    scheduler   many short tasks through a Dask scheduler, and what a tile costs besides its points (half a minute)
    full        the map of Fig. 5, 500 x 500, as `shapespace diagram` computes it: time, memory, points without a state (a quarter
                of an hour on two idle cores)
Without PART: all but full. --count N: another COUNT than 40, for full than 500; --workers N: for full.
"""

import sys

from benchmarks.timing import machine, use_one_core

PARTS = ("points", "growth", "workers", "batch", "scheduler", "full")
if not {*sys.argv[1:]} & {"workers", "scheduler", "full"} and len(sys.argv) > 1:
    use_one_core()

import argparse
import os
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np
from benchmarks.peer_solve_bvp import Parameters
from benchmarks.peer_steady_bvp import along
from benchmarks.timing import milliseconds

from shapespace.base.outcome import Outcome
from shapespace.study.diagram_anchors import lay_anchors
from shapespace.study.diagram_store import DiagramStore, open_diagram
from shapespace.study.diagrams import diagram, make_request
from shapespace.study.grid import Axis, Grid
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.settling import settle
from shapespace.study.steady import Steady, steady, steady_of
from shapespace.study.tiles import Done, compute_tile, observable_names

PECLET, LENGTH = (25.0, 300.0), (0.1, 10.0)
SAMPLE = 20
"""Points of the loop and of the peer's row."""
TILES = 16
"""That stand for a large map."""
TASKS = 2000
BATCHES = (1, 8, 32)


def axes(count: int) -> tuple[Axis, Axis]:
    return Axis("peclet", *PECLET, count), Axis("inverse_hydrodynamic_length", *LENGTH, count)


@contextmanager
def prepared(case: Scenario, count: int, folder: Path) -> Iterator[DiagramStore]:
    """A store with its anchors."""
    grid = Grid(*axes(count))
    request = make_request(case, grid, ("default",), stability=False)
    with DiagramStore.create(folder / f"map-{count}", case, request, observable_names(case, grid.keys)) as store:
        start = time.process_time()
        lay_anchors(store)
        print(f"{count} x {count}: {len(grid.tiles)} anchors in {time.process_time() - start:.1f} s")
        yield store


def sampled(store: DiagramStore, most: int | None = None) -> tuple[list[Done], float]:
    """Tiles from all over a map, all where it has no more than `most`, and the processor time that they took."""
    grid = store.request.grid
    tiles = grid.tiles
    if most and most < len(tiles):
        # One of every so many would all lie at the same Peclet number.
        spread = dict.fromkeys(grid.tile_of(at) for at in grid.spread(8 * most))
        tiles = [*spread][:most]
    compute_tile(store.path, tiles[0])
    start = time.process_time()
    done = [compute_tile(store.path, tile) for tile in tiles]
    return done, time.process_time() - start


def per_point(done: list[Done], seconds: float) -> str:
    points = sum(one.points for one in done)
    return (
        f"{points} points, {sum(one.converged for one in done)} converged: {1e3 * seconds / points:.2f} ms a point, "
        f"{points / seconds:.0f} points/s"
    )


def points(count: int) -> None:
    """A map, a loop, and the peer."""
    case = scenario("polar-swimmer")
    with tempfile.TemporaryDirectory() as folder, prepared(case, count, Path(folder)) as store:
        print("map:", per_point(*sampled(store)))
        data = open_diagram(store.path).dataset
        for name in ("iterations", "elements"):
            values, counts = np.unique(data[name].values[np.isfinite(data[name])], return_counts=True)
            print(f"    {name}: " + ", ".join(f"{n} x {v:g}" for v, n in zip(values, counts, strict=True)))
    middle = steady(case)
    state = middle.problem.base.unpack(middle.found.x)
    grid = Grid(*axes(count))
    diagonal = np.linspace(0, count - 1, SAMPLE).round().astype(int)
    start, converged = time.process_time(), 0
    for i in diagonal.tolist():
        there = at(case, grid, i, i)
        found = steady_of(there, settle(there, state))
        converged += found.outcome is Outcome.CONVERGED and bool(found.observables)
    each = 1e3 * (time.process_time() - start) / SAMPLE
    print(f"loop over single solves from one state: {each:.1f} ms a point, {converged} of {SAMPLE} converged")
    peer(case, grid)


def at(case: Scenario, grid: Grid, i: int, j: int) -> Scenario:
    """The scenario at a point of the grid."""
    return case.with_overrides(dict(zip(grid.keys, grid.values(i, j).ravel().tolist(), strict=True)))


def peer(case: Scenario, grid: Grid) -> None:
    """Points of the map side by side along the Peclet number, from next to (100, 1) on."""
    i, j = (int(np.abs(axis.values - value).argmin()) for axis, value in ((grid.x, 100.0), (grid.y, 1.0)))
    cases = [at(case, grid, i + k, j) for k in range(SAMPLE)]
    first = steady(cases[0])
    for tol in (1e-3, 1e-6):
        found = list(along([parameters(one) for one in cases], *guess(first), tol))
        state, off = first, 0.0
        for one, theirs in zip(cases, found, strict=False):
            state = steady(one, start=state)
            off = max(off, abs(theirs.velocity - state.observables["velocity"]))
        print(
            f"solve_bvp, tol {tol:g}: {1e3 * float(np.mean([one.seconds for one in found[1:]])):.0f} ms a point, "
            f"{sum(one.solved for one in found)} of {SAMPLE} solved with up to {max(one.nodes for one in found)} nodes, "
            f"speeds within {off:.1e} of ours"
        )


def parameters(case: Scenario) -> Parameters:
    v = case.dimensionless()
    return Parameters(
        friction=v["friction"], tension=v["tension"], active_tension=v["active_tension"],
        saturation_concentration=v["saturation_concentration"], turnover_rate=v["turnover_rate"], ring_amplitude=0.0,
    )  # fmt: skip


def guess(state: Steady) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Our state as the peer's first guess; the volume between pole and u by the trapezoidal rule."""
    base = state.problem.base
    solved, column = base.unpack(state.found.x), {name: i for i, name in enumerate(base.system.fields)}
    u = np.linspace(0.0, 1.0, 201)
    values, h = solved.values(u), solved.scalars[base.system.scalars.index("h")]
    names = ("r", "z", "psi", "moment", "alpha", "beta", "v", "meridional_force", "c")
    fields = [values[:, column[name]] for name in names]
    slope = solved.derivatives(u)[:, column["c"]]
    growth = np.pi * fields[0] ** 2 * h * np.sin(fields[2])
    volume = np.concatenate([[0.0], np.cumsum(0.5 * (growth[1:] + growth[:-1]) * np.diff(u))])
    scalars = [h, state.observables["pressure"], state.observables["velocity"]]
    return u, np.array([*fields, fields[0] * slope / h, volume]), np.array(scalars)


def growth() -> None:
    """Cost per point as the grid grows."""
    for count in (50, 100, 200, 500):
        with tempfile.TemporaryDirectory() as folder, prepared(scenario("polar-swimmer"), count, Path(folder)) as store:
            print("   ", per_point(*sampled(store, TILES)))


def workers(count: int) -> None:
    """One process and two, from the same anchors, wall-clock."""
    case, times = scenario("polar-swimmer"), {}
    for number in (1, 2):
        with tempfile.TemporaryDirectory() as folder, prepared(case, 2 * count, Path(folder)) as store:
            from shapespace.study.workers import Workers

            tiles = store.request.grid.tiles
            with Workers(number) as processes:
                # Importing and loading compiled functions is no part of a long map.
                list(processes.map(store.path, tiles[:number]))
                start = time.perf_counter()
                done = list(processes.map(store.path, tiles[number:]))
                times[number] = (time.perf_counter() - start) / sum(one.points for one in done)
        print(f"    {number} at work: {1e3 * times[number]:.2f} ms a point, wall-clock")
    print(f"two processes: {times[1] / times[2]:.2f} times one, on {os.cpu_count()} cores")


def fastest(function: Callable[[np.ndarray], Any], tiles: np.ndarray) -> float:
    """Milliseconds of one call, its results waited for."""
    return milliseconds(lambda: jax.block_until_ready(function(tiles)), 50)[0]


def batch() -> None:
    """The kernel that takes most of a point's time, for many points in one call."""
    found = steady(scenario("polar-swimmer"))
    problem, x, p = found.problem.base, found.found.x, found.engine.p
    (tile,) = problem._tiles(x, p)
    single = problem.functions.linearised
    function = single._function
    expected = [np.asarray(one) for one in jax.tree.leaves(single(tile))]
    together = {"vmap": jax.vmap(function), "lax.map": lambda tiles: jax.lax.map(function, tiles)}
    for size in BATCHES:
        tiles = np.repeat(tile[None], size, axis=0)
        words = [f"loop {fastest(lambda batch: [single(one) for one in batch], tiles) / size:.3f}"]
        for name, mapped in together.items():
            start = time.perf_counter()
            compiled = jax.jit(mapped).lower(tiles).compile()
            seconds = time.perf_counter() - start
            for one, wanted in zip(jax.tree.leaves(compiled(tiles)), expected, strict=True):
                np.testing.assert_allclose(one[-1], wanted, rtol=1e-9, atol=1e-9)
            words.append(f"{name} {fastest(compiled, tiles) / size:.3f} (compiling {seconds:.0f} s)")
        print(f"    {size} points at once, ms a point: {', '.join(words)}", flush=True)


def scheduler(count: int) -> None:
    """What Dask takes for a task that does nothing, and what a tile takes besides its points."""
    from distributed import Client, LocalCluster

    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with LocalCluster(**options) as cluster, Client(cluster, set_as_default=False) as client:
        client.gather(client.map(abs, range(100), pure=False))
        wall, own = time.perf_counter(), time.process_time()
        client.gather(client.map(abs, range(TASKS), pure=False))
        wall, own = time.perf_counter() - wall, time.process_time() - own
        print(
            f"Dask: {1e3 * wall / TASKS:.2f} ms a task, of {TASKS} that do nothing; "
            f"{1e3 * own / TASKS:.2f} ms of it are the scheduler's and the client's processor time"
        )
    for edge in (count, 500):
        with tempfile.TemporaryDirectory() as folder, prepared(scenario("polar-swimmer"), edge, Path(folder)) as store:
            size = sum(path.stat().st_size for path in (store.path / "anchors").iterdir())
            start = time.process_time()
            for _ in range(10):
                list(DiagramStore.open(store.path))
            print(f"    a tile reads {size / 1e6:.1f} MB of anchors in {1e2 * (time.process_time() - start):.1f} ms")


def full(count: int, processes: int) -> None:
    """The whole map, as a user has it."""
    with tempfile.TemporaryDirectory() as folder:
        start, told = time.perf_counter(), [time.perf_counter()]

        def progress(done: Done) -> None:
            if time.perf_counter() - told[0] > 60.0:
                told[0] = time.perf_counter()
                print(f"    tile {done.tile} after {told[0] - start:.0f} s", flush=True)

        found = diagram(
            scenario("polar-swimmer"), *axes(count), out=Path(folder) / "map", workers=processes, progress=progress
        )
        seconds = time.perf_counter() - start
        own, child = (
            resource.getrusage(who).ru_maxrss / 2**20 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
        failed = Counter(one["outcome"] for one in found.failed)
        size = sum(path.stat().st_size for path in found.store.rglob("*") if path.is_file())
        largest = float(found.dataset["correction"].max())
        print(
            f"{count} x {count} on {processes} processes: {seconds:.0f} s = {seconds / 60.0:.1f} min, "
            f"{found.points / seconds:.0f} points/s, {found.converged} of {found.points} converged, "
            f"largest last correction {largest:.1e}"
        )
        share = 100.0 * len(found.failed) / found.points
        print(f"without a state: {len(found.failed)} = {share:.3f} %: {dict(failed)}")
        for one in found.failed[:50]:
            print(f"    {one}")
        print(
            f"memory: {own:.2f} GiB here, {child:.2f} GiB the largest process, at most {own + processes * child:.2f} GiB together"
        )
        print(f"store: {size / 1e6:.0f} MB")


def main() -> None:
    """Print the parts asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--count", type=int)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"{unknown[0]}: must be one of {', '.join(PARTS)}")
    print(machine())
    count = options.count or 40
    calls = {
        "points": lambda: points(count),
        "growth": growth,
        "workers": lambda: workers(count),
        "batch": batch,
        "scheduler": lambda: scheduler(count),
        "full": lambda: full(options.count or 500, options.workers),
    }
    for part in options.parts or PARTS[:-1]:
        print(f"-- {part}")
        calls[part]()


if __name__ == "__main__":
    main()
