"""A backward-Euler step of guided division against `scipy.integrate.solve_bvp` at matched accuracy.

Both march the whole division, warm-started: 200 steps of 1e-3, from the sphere through the closing neck. The error of a
setting is the largest relative difference of (r(1/2), h, p) at any step from the same code on a fine grid; for each class
of accuracy each code runs at the cheapest of its settings, tried from cheap to dear, whose error is in the class. The two
codes discretise time differently (ours the conserved c r h, the peer c), so each is measured against its own reference;
that the references differ by O(dt) only is checked by halving dt.

The peer has two set-ups (peer_solve_bvp.py): USUAL, as published codes have it, with the hole r = 1e-3 at the poles, and
TUNED, the best found. The hole is an error of its own, printed apart: USUAL's class is that of its discretisation alone.
Times are processor time, mean over the steps, the same in both, since other work on the machine hardly counts in it.
Run: python benchmarks/bench_step.py [--neck]   (about seven minutes; --neck adds USUAL at tol 1e-6, some more)
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, NamedTuple

from benchmarks.timing import machine, use_one_core

use_one_core()

import time

import numpy as np
from benchmarks.peer_solve_bvp import TUNED, USUAL, Peer, StepResult, march

from shapespace.analysis.evolution import STEP_NEWTON, Evolution, Moment, Stepping
from shapespace.base.arrays import Array
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.engine import Engine
from shapespace.study.scenario import scenario

DT, STEPS = 1e-3, 200
CLASSES = (1e-3, 1e-6)
TOLERANCES = ((1e-1,), (1e-2,), (1e-3,), (1e-4,), (1e-5,))
MESHES = ((20, 3, 1e-2), (20, 3, 1e-3), (40, 4, 1e-4), (40, 4, 1e-5), (40, 4, 1e-6))
"""Elements to start with, degree, tolerance of the mesh."""
FINE_MESH, FINE_TOLERANCE = (160, 6, 1e-9), 1e-6
EARLY = 60
"""Steps of the check by halving dt."""


class March(NamedTuple):
    """(r(1/2), h, p) after each step (steps, 3), seconds of each step (steps,), size of the last mesh, how it ended."""

    values: Array
    seconds: Array
    size: int
    ending: str


def ours(elements: int, degree: int, tolerance: float, dt: float = DT, steps: int = STEPS) -> March:
    """March with us, by backward Euler on an adapted mesh; Newton stops at a hundredth of the mesh's tolerance."""
    engine = Engine.of(scenario("guided-division", elements=elements, degree=degree, mesh_tolerance=tolerance))
    start = Moment(0.0, engine.problem, engine.problem.pack(engine.initial_state()))
    stepping = Stepping(order=1, fixed_step=dt, stationary_rate=0.0)
    newton = replace(STEP_NEWTON, tolerance=max(1e-2 * tolerance, 1e-9))
    evolution = Evolution([start], engine.p, steps * dt, stepping, newton)
    values, seconds, clock = [], [], time.process_time()
    for moment in evolution:
        seconds.append(time.process_time() - clock)
        assert isinstance(moment.problem, CollocationProblem)
        state = moment.problem.unpack(moment.x)
        values.append([state.values(np.array([0.5]))[0, 0], *state.scalars[:2]])
        size, clock = moment.problem.elements, time.process_time()
    return March(np.array(values), np.array(seconds), size, str(evolution.outcome))


def peers(peer: Peer, tol: float, dt: float = DT, steps: int = STEPS) -> March:
    """March with the peer."""
    run: list[StepResult] = list(march(steps, dt, tol, peer))
    values = [[step.neck_radius, step.h, step.p] for step in run if step.success]
    return March(np.array(values), np.array([step.cpu_seconds for step in run]), run[-1].nodes, run[-1].message)


@cache
def warm(elements: int, degree: int, tolerance: float) -> March:
    """Our march when everything is compiled."""
    ours(elements, degree, tolerance)
    return ours(elements, degree, tolerance)


def error(march: March, reference: March) -> float:
    """The largest relative difference at any step; infinite where the march broke off."""
    if len(march.values) < len(reference.values):
        return float("inf")
    return float(np.abs(march.values / reference.values - 1.0).max())


def cheapest(
    run: Callable[..., March], settings: Sequence[tuple[Any, ...]], reference: March, goal: float
) -> tuple[tuple[Any, ...], March] | None:
    """The first setting whose error is in the class, and its march."""
    for setting in settings:
        if error(result := run(*setting), reference) <= goal:
            return setting, result
    return None


def line(name: str, setting: object, march: March, err: float) -> str:
    """One row of the table."""
    text = f"{setting:.0e}" if isinstance(setting, float) else "{} x {}, {:.0e}".format(*setting)
    return f"  {name:12s}{text:>16s}{err:10.1e}{1e3 * march.seconds.mean():10.1f} ms/step{march.size:7d}"


def compare() -> None:
    """One block per class of accuracy."""
    own = ours(*FINE_MESH)
    codes = {"USUAL": USUAL, "TUNED": TUNED}
    # USUAL's reference solves its equations with its hole; only the way to the solution is the tuned one.
    references = {name: peers(replace(TUNED, ends=peer.ends), FINE_TOLERANCE) for name, peer in codes.items()}
    runs = {name: cache(partial(peers, peer)) for name, peer in codes.items()}
    print(
        f"error of USUAL's hole at the poles, whatever its tolerance: {error(references['USUAL'], references['TUNED']):.1e}"
    )
    print(f"  {'':12s}{'setting':>16s}{'error':>10s}{'time':>18s}{'mesh':>7s}")
    for goal in CLASSES:
        print(f"class {goal:.0e}")
        found = cheapest(warm, MESHES, own, goal)
        if found is None:
            print("  shapespace   not reached")
            continue
        print(line("shapespace", *found, error(found[1], own)))
        for name, run in runs.items():
            theirs = cheapest(run, TOLERANCES, references[name], goal)
            if theirs is None:
                print(f"  {name:12s} not reached down to tol {TOLERANCES[-1][0]:.0e}")
                continue
            ratio = theirs[1].seconds.mean() / found[1].seconds.mean()
            print(f"{line(name, theirs[0][0], theirs[1], error(theirs[1], references[name]))}   ratio {ratio:.1f}")


def halve() -> None:
    """Whether the two codes agree but for O(dt): their difference at dt and at dt/2."""
    differences = []
    for fold in (1, 2):
        dt, steps = DT / fold, EARLY * fold
        mine, theirs = ours(*FINE_MESH, dt, steps), peers(TUNED, 1e-5, dt, steps)
        differences.append(mine.values[-1] / theirs.values[-1] - 1.0)
    whole, half = differences
    rows = {"at dt": whole, "at dt/2": half, "extrapolated to dt = 0": 2.0 * half - whole}
    print(f"ours less the peer at t = {DT * EARLY:g}, relative, of r(1/2), h, p")
    for name, row in rows.items():
        print(f"  {name:24s}" + "".join(f"{value:10.1e}" for value in row))


def into_the_neck() -> None:
    """How far USUAL gets at the tolerance of the finer class."""
    usual = peers(USUAL, CLASSES[-1], steps=250)
    print(f"USUAL, tol {CLASSES[-1]:.0e}: {len(usual.values)} steps, r(1/2) = {usual.values[-1, 0]:.4f}, {usual.size} nodes, "
          f"last step {usual.seconds[-1]:.0f} s: {usual.ending}")  # fmt: skip


def main() -> None:
    """Print the comparison."""
    print(machine())
    compare()
    halve()
    if "--neck" in sys.argv[1:]:
        into_the_neck()
    print(machine())


if __name__ == "__main__":
    main()
