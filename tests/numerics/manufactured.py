"""Boundary value problems with known solutions: one with everything that a system may have, and two layers."""

from collections.abc import Callable
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from scipy.special import erf

from shapespace.base.arrays import Array, Traced
from shapespace.base.problem import Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.newton import Newton, Root, solve_root
from shapespace.numerics.state import State, state_from_functions
from shapespace.numerics.system import AbstractSystem


class Everything(AbstractSystem):
    """y1' = s y2, y2' = a^2 y1 + dq/dt + g(u), a (1 + y1^2) = 1, int y1 y2 du = p1 s, y1(0) y2(1) = p2, y1(1) = p3.

    Solved by y1 = exp(sin(3u)), s = 1.3 for the g and p of `exact`; q = y1, whose rate at rest is -2 y1 + cos(u).
    """

    fields: ClassVar[tuple[str, ...]] = ("y1", "y2")
    algebraic: ClassVar[tuple[str, ...]] = ("a",)
    scalars: ClassVar[tuple[str, ...]] = ("s",)
    parameters: ClassVar[tuple[str, ...]] = ("p1", "p2", "p3")

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        f = exact(u, jnp)
        g = f["dy2"] - f["a"] ** 2 * f["y1"] + 2.0 * f["y1"] - jnp.cos(u)
        return jnp.stack([dy[0] - s[0] * y[1], dy[1] - a[0] ** 2 * y[0] - dq[0] - g, a[0] * (1.0 + y[0] ** 2) - 1.0])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return jnp.stack([y0[0] * y1[1] - p[1], y1[0] - p[2]])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return (y[0] * y[1])[None]

    def targets(self, s: Traced, p: Traced) -> Traced:
        return (p[0] * s[0])[None]


SCALAR = 1.3


def exact(u, xp=np):
    """The solution of `Everything` and its slopes, by name."""
    y1 = xp.exp(xp.sin(3.0 * u))
    dy1 = 3.0 * xp.cos(3.0 * u) * y1
    ddy1 = (9.0 * xp.cos(3.0 * u) ** 2 - 9.0 * xp.sin(3.0 * u)) * y1
    return {"y1": y1, "y2": dy1 / SCALAR, "dy1": dy1, "dy2": ddy1 / SCALAR, "a": 1.0 / (1.0 + y1**2)}


def exact_parameters() -> Array:
    """p of `Everything`: int y1 y2 du = [y1^2/2]/s."""
    first, last = exact(np.array(0.0)), exact(np.array(1.0))
    integral = 0.5 * (last["y1"] ** 2 - first["y1"] ** 2) / SCALAR
    return np.array([integral / SCALAR, first["y1"] * last["y2"], last["y1"]])


def solve_everything(mesh: Array, degree: int, newton: Newton = Newton(1e-12)) -> tuple[CollocationProblem, Root]:
    """`Everything` on a mesh, from a guess 5 % off; dq/dt = -2 q + cos(u), known at the Gauss points."""
    problem = CollocationProblem(Everything(), mesh, degree)
    shape = State(mesh, np.zeros((len(mesh), 2)), np.zeros((len(mesh) - 1, degree, 2)), np.zeros(0), np.zeros(0))
    stages = shape.stage_points
    nodal, inner = exact(mesh), exact(stages)
    guess = state_from_functions(
        mesh,
        degree,
        1.05 * np.stack([nodal["y1"], nodal["y2"]], axis=1),
        1.05 * np.stack([inner["dy1"], inner["dy2"]], axis=2),
        0.95 * inner["a"][..., None],
        np.array([1.05 * SCALAR]),
    )
    rate = Rate(-2.0, np.cos(np.append(stages.ravel(), [0.0, 1.0])))
    return problem, solve_root(problem, problem.pack(guess), exact_parameters(), rate, newton)


class BoundaryLayer(AbstractSystem):
    """e^2 y'' = y, y(0) = y(1) = 1: layers of thickness e at both ends."""

    fields: ClassVar[tuple[str, ...]] = ("y", "flux")
    algebraic: ClassVar[tuple[str, ...]] = ()
    scalars: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[tuple[str, ...]] = ("e",)

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.stack([p[0] * dy[0] - y[1], p[0] * dy[1] - y[0]])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return jnp.stack([y0[0] - 1.0, y1[0] - 1.0])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))

    @staticmethod
    def solution(u: Array, e: float) -> Array:
        """[e^(-u/e) + e^((u-1)/e)]/[1 + e^(-1/e)]."""
        return (np.exp(-u / e) + np.exp((u - 1.0) / e)) / (1.0 + np.exp(-1.0 / e))


class InteriorLayer(AbstractSystem):
    """e^2 y'' + (u - 0.3) y' = 0, y = -1 and 1 far to the left and right of 0.3."""

    fields: ClassVar[tuple[str, ...]] = ("y", "flux")
    algebraic: ClassVar[tuple[str, ...]] = ()
    scalars: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[tuple[str, ...]] = ("e",)

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.stack([p[0] * dy[0] - y[1], p[0] ** 2 * dy[1] + (u - 0.3) * y[1]])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return jnp.stack([y0[0] + 1.0, y1[0] - 1.0])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))

    @staticmethod
    def solution(u: Array, e: float) -> Array:
        """erf((u - 0.3)/(sqrt(2) e)), for e so small that both ends are far."""
        return np.asarray(erf((u - 0.3) / (np.sqrt(2.0) * e)))


def solve_layer(
    system: BoundaryLayer | InteriorLayer, mesh: Array, degree: int, e: float, tolerance: float
) -> tuple[CollocationProblem, Array]:
    """A layer of thickness e on a mesh; the problem is linear, so that one correction from nothing solves it."""
    problem = CollocationProblem(system, mesh, degree, tolerance)
    elements, p = len(mesh) - 1, np.array([e])
    nothing = np.zeros(2 * (elements + 1) + 2 * elements * degree)
    residual, linearisation = problem.linearise(nothing, p, Rate(0.0, np.zeros(elements * degree + 2)))
    return problem, -linearisation.solve(residual)


def largest_error(problem: CollocationProblem, x: Array, solution: Callable[[Array], Array]) -> float:
    """Of the first field, at ten points per element."""
    mesh = problem.mesh
    u = (mesh[:-1, None] + np.diff(mesh)[:, None] * np.linspace(0.0, 1.0, 10)).ravel()
    return float(np.abs(problem.unpack(x).values(u)[:, 0] - solution(u)).max())
