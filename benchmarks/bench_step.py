"""One backward-Euler step of guided division (dt = 1e-3) against `scipy.integrate.solve_bvp` at matched accuracy.

Both march the same steps of the same scheme, warm-started; errors of (r(1/2), h, p) after STEPS steps are measured against
a fine reference (degree 6, 160 elements). Ours takes, for each run of the peer, the first mesh of CANDIDATES whose error is
not larger than the peer's. The peer has two set-ups (peer_solve_bvp.py): USUAL, as published codes have it, and TUNED, the best
found. Times are processor time, the same in both, since other work on the machine does not count in it.
Run: python benchmarks/bench_step.py [--neck]   (about two minutes; --neck adds the peer's march into the neck, ten more)
"""

import sys
from collections.abc import Iterator

from benchmarks.timing import machine, use_one_core

use_one_core()

import time  # noqa: E402  (threads are set before the libraries load)

import numpy as np  # noqa: E402
from benchmarks.peer_solve_bvp import TUNED, USUAL, Peer, StepResult, march  # noqa: E402

from shapespace.analysis.evolution import Evolution, Moment, Stepping  # noqa: E402
from shapespace.base.arrays import Array  # noqa: E402
from shapespace.numerics.collocation import CollocationProblem  # noqa: E402
from shapespace.study.engine import Engine  # noqa: E402
from shapespace.study.scenario import scenario  # noqa: E402

DT = 1e-3
STEPS = 60
CANDIDATES = ((20, 3), (20, 4), (40, 4), (40, 5), (80, 4), (80, 5), (160, 5))


def ours(elements: int, degree: int, steps: int, tolerance: float = 1.0) -> Iterator[tuple[Array, float, int]]:
    """(r(1/2), h, p) after each step, the seconds it took, and the number of elements."""
    engine = Engine.of(scenario("guided-division", elements=elements, degree=degree, mesh_tolerance=tolerance))
    start = Moment(0.0, engine.problem, engine.problem.pack(engine.initial_state()))
    stepping = Stepping(order=1, fixed_step=DT, stationary_rate=0.0)
    clock = time.process_time()
    for moment in Evolution([start], engine.p, steps * DT, stepping):
        seconds = time.process_time() - clock
        assert isinstance(moment.problem, CollocationProblem)
        state = moment.problem.unpack(moment.x)
        neck = state.values(np.array([0.5]))[0, 0]
        yield np.array([neck, *state.scalars[:2]]), seconds, moment.problem.elements
        clock = time.process_time()


def numbers(step: StepResult) -> Array:
    """(r(1/2), h, p) of the peer."""
    return np.array([step.neck_radius, step.h, step.p])


def compare(name: str, peer: Peer, tol: float, exact: Array) -> None:
    """One line for the peer at a tolerance, one for us at its accuracy."""
    run = list(march(STEPS, DT, tol, peer))
    error = float(np.abs(numbers(run[-1]) / exact - 1.0).max())
    seconds = float(np.median([step.cpu_seconds for step in run]))
    print(f"solve_bvp {name}, tol {tol:.0e}:  error {error:.1e} {1e3 * seconds:9.1f} ms/step   {run[-1].nodes} nodes")
    for elements, degree in CANDIDATES:
        for _ in ("compile", "measure"):
            steps = list(ours(elements, degree, STEPS))
        own_error = float(np.abs(steps[-1][0] / exact - 1.0).max())
        if own_error <= error:
            break
    own = float(np.median([step[1] for step in steps]))
    ratio = f"ratio {seconds / own:.0f}" if own_error <= error else "not as accurate"
    print(f"  shapespace, {elements:3d} x {degree}:       error {own_error:.1e} {1e3 * own:9.1f} ms/step   {ratio}")


def into_the_neck(tol: float, steps: int = 220) -> None:
    """How far the peer gets, and the same march with us."""
    for step in march(steps, DT, tol, TUNED):
        last = step
        if not step.success:
            break
    print(f"solve_bvp, tol {tol:.0e}: last step at t = {last.time:.3f}, r(1/2) = {last.neck_radius:.4f}, "
          f"{last.nodes} nodes, {last.seconds:.1f} s; {last.message}")  # fmt: skip
    done = list(ours(40, 4, steps, 1e-5))
    times = np.array([seconds for _, seconds, _ in done])
    print(f"shapespace: t = {DT * len(done):.3f}, r(1/2) = {done[-1][0][0]:.6f}, {done[-1][2]} elements, "
          f"median {1e3 * np.median(times):.1f} ms, largest {1e3 * times.max():.0f} ms with compilation")  # fmt: skip


def main() -> None:
    """Print the comparison."""
    print(machine())
    *_, reference = ours(160, 6, STEPS)
    exact = reference[0]
    print(f"after {STEPS} steps: r(1/2) = {exact[0]:.10f}, h = {exact[1]:.10f}, p = {exact[2]:.8f}")
    for tol in (1e-3, 1e-6):
        compare("USUAL", USUAL, tol, exact)
        compare("TUNED", TUNED, tol, exact)
    if "--neck" in sys.argv[1:]:
        into_the_neck(1e-3)


if __name__ == "__main__":
    main()
