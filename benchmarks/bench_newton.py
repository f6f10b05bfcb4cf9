"""One Newton iteration of the closed surface, warm, on one core, and where its time goes.

State: guided division in mid-ingression (t = 0.1), 40 elements x 4 Gauss points, 10 fields and 3 scalars. Peer: the same
condensation of the same blocks by LAPACK (numpy.linalg.solve over elements, scipy's banded solver for the chain).
Run: python benchmarks/bench_newton.py
"""

from benchmarks.timing import machine, milliseconds, use_one_core

use_one_core()

import numpy as np
from scipy.linalg import solve_banded

from shapespace.analysis.evolution import Evolution, Moment, Stepping
from shapespace.base.arrays import Array
from shapespace.base.problem import Rate
from shapespace.numerics import condensation
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.elimination import eliminate_stages
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.plan import make_plan
from shapespace.study.engine import Engine
from shapespace.study.scenario import scenario


def ingressing(elements: int, degree: int) -> tuple[Engine, CollocationProblem, Array, Rate]:
    """Guided division at t = 0.1 on a fixed mesh, with the rate of its last step."""
    engine = Engine.of(scenario("guided-division", elements=elements, degree=degree, mesh_tolerance=1.0))
    start = Moment(0.0, engine.problem, engine.problem.pack(engine.initial_state()))
    *_, last = Evolution([start], engine.p, 0.1, Stepping())
    assert isinstance(last.problem, CollocationProblem)
    assert last.rate is not None
    return engine, last.problem, last.x, last.rate


def lapack_condensation(points: Array, widths: Array, matrix: Array, n: int) -> Array:
    """The peer's work: stage systems of all elements by batched LAPACK; returns the stage responses."""
    rows, columns, k, elements = points.shape
    m = rows - 1
    block = points[:m].transpose(3, 2, 0, 1)
    system = np.zeros((elements, k, m, k, m))
    system[:, :, :, :, :n] = np.einsum("e,jl,ejrc->ejrlc", widths, matrix, block[..., m : m + n])
    for j in range(k):
        system[:, j, :, j, :] += block[:, j, :, :m]
    rhs = block[..., m:].reshape(elements, k * m, columns - m)
    return np.linalg.solve(system.reshape(elements, k * m, k * m), rhs)


def main() -> None:
    """Print the table."""
    engine, problem, x, rate = ingressing(40, 4)
    p, n, rule = engine.p, problem.n, gauss_rule(problem.degree)
    residual, linear = problem.linearise(x, p, rate)
    widths = np.diff(problem.mesh)
    _, points, ends, targets = problem.blocks(x, p, rate)
    plan = make_plan(widths, rule.matrix, points, n, problem.n_rows)
    jumps = np.zeros((problem.elements, n, len(targets[0])))
    size = (problem.elements + 1) * n
    bands = np.random.default_rng(0).normal(size=(4 * n + 1, size)) + 10.0 * (np.arange(4 * n + 1) == 2 * n)[:, None]
    borders = np.ones((size, 4))
    rows = {
        "whole iteration (linearise + solve)": lambda: problem.linearise(x, p, rate)[1].solve(residual),
        "  residual and Jacobian (JAX)": lambda: problem.blocks(x, p, rate),
        "  factorisation (numba)": lambda: condensation.factorise(
            widths, rule.matrix, rule.weights, points, ends, targets, n
        ),
        "    local elimination": lambda: eliminate_stages(
            widths, rule.weights, rule.matrix, points, jumps, problem.n_rows, plan
        ),
        "  one solve": lambda: linear.solve(residual),
        "residual alone": lambda: problem.residual(x, p, rate),
        "peer: local elimination by LAPACK": lambda: lapack_condensation(points, widths, rule.matrix, n),
        "peer: chain by LAPACK, banded": lambda: solve_banded((2 * n, 2 * n), bands, borders),
    }
    print(machine())
    print(f"{'':40s}{'best':>9s}{'median':>9s}  ms")
    for name, work in rows.items():
        best, median = milliseconds(work)
        print(f"{name:40s}{best:9.3f}{median:9.3f}")


if __name__ == "__main__":
    main()
