"""Swimmers at rest as a peer: `scipy.integrate.solve_bvp` with natural continuation, from point to point of a map.

The equations of peer_solve_bvp.py with r_t = 0, z_t = v0 and c_t = 0: a shape that swims at v0 without changing. v0 is a third
scalar, and z(0) + z(1) = 0 its condition. Each point starts from the solution before. As there, the best set-up found: regular
pole expansion at the hole, exact Jacobian, mesh thinned between points.
Imported by bench_diagram.py, which runs it on points of its own map.
"""

import time
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from benchmarks.peer_solve_bvp import Array, Ends, Parameters, end_conditions, first_mesh, right_hand_side
from scipy.integrate import solve_bvp


class Swimmer(NamedTuple):
    """Whether a point was solved, its swimming speed, the nodes it took and the processor time in seconds."""

    solved: bool
    velocity: float
    nodes: int
    seconds: float


def rates(u: Array, y: Array, scalars: Array, par: Parameters) -> Array:
    """y' (11, m) of a shape that swims: what it was a unit of time ago is itself, v0 further down."""
    old = np.array([y[0], y[1] - scalars[2], y[8]])
    return right_hand_side(u, y, scalars[:2], old, 1.0, par)


def jacobian(u: Array, y: Array, scalars: Array, par: Parameters) -> tuple[Array, Array]:
    """d y'/d y (11, 11, m) and d y'/d(h, p, v0) (11, 3, m) by complex step."""
    n, s, step = len(y), len(scalars), 1e-30
    perturbed = np.repeat(y[:, None, :], n + s, axis=1).astype(complex)
    perturbed[range(n), range(n)] += 1j * step
    unknowns = np.repeat(scalars[:, None, None], n + s, axis=1).astype(complex)
    unknowns[range(s), range(n, n + s)] += 1j * step
    slopes = rates(u, perturbed, unknowns, par).imag / step
    return slopes[:, :n], slopes[:, n:]


def along(
    points: Sequence[Parameters], mesh: Array, fields: Array, scalars: Array, tol: float = 1e-6
) -> Iterator[Swimmer]:
    """Point after point from a first guess: fields (11, m) on a mesh of [0, 1], and (h, p, v0)."""
    ends = Ends()
    x, y, s = np.linspace(*ends.interval, len(mesh)), fields, scalars
    y = np.stack([np.interp(x, mesh, one) for one in fields])
    for par in points:
        start = time.process_time()

        def conditions(ya: Array, yb: Array, s: Array, par: Parameters = par) -> Array:
            moving = np.array([[0.0, s[2]], [0.0, s[2]]])
            return np.append(end_conditions(ya, yb, s[:2], ends, par, moving), ya[1] + yb[1])

        out = solve_bvp(
            lambda u, y, s, par=par: rates(u, y, s, par), conditions, x, y, s,
            fun_jac=lambda u, y, s, par=par: jacobian(u, y, s, par), tol=tol, max_nodes=20_000,
        )  # fmt: skip
        seconds = time.process_time() - start
        yield Swimmer(out.status == 0, float(out.p[2]), len(out.x), seconds)
        if out.status != 0:
            return
        state = SimpleNamespace(mesh=out.x, residuals=out.rms_residuals, earlier=out)
        x, s = first_mesh(state, tol, adapt=True), out.p
        y = out.sol(x)
