"""Classic boundary value problems with known bifurcations, to test continuation and stability without any surface."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.mesh import uniform_mesh
from shapespace.numerics.state import state_from_functions
from shapespace.numerics.system import AbstractSystem, Symmetry

PointFunction = Callable[[Traced, Traced, Traced], Traced]
"""f(x, y, p)."""


class SecondOrder(AbstractSystem):
    """length^2 dy/dt = y'' + f(x, y, p) with y or y' given as zero at each end, x = start + length u; y' is d/du."""

    forcing: PointFunction = eqx.field(static=True)
    parameters: tuple[str, ...] = eqx.field(static=True)
    neumann: tuple[bool, bool] = eqx.field(static=True, default=(False, False))
    length: float = eqx.field(static=True, default=1.0)
    start: float = eqx.field(static=True, default=0.0)
    mirror: Symmetry | None = eqx.field(static=True, default=None)
    fields: tuple[str, ...] = eqx.field(static=True, default=("y", "slope"))
    algebraic: tuple[str, ...] = eqx.field(static=True, default=())
    scalars: tuple[str, ...] = eqx.field(static=True, default=())

    @property
    def symmetry(self) -> Symmetry | None:
        return self.mirror

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        x = self.start + self.length * u
        return jnp.stack([dy[0] - self.length * y[1], dy[1] + self.length * (self.forcing(x, y[0], p) - dq[0])])

    def stored(self, y: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return jnp.stack([y0[int(self.neumann[0])], y1[int(self.neumann[1])]])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))


def start_from(
    problem: CollocationProblem, values: Callable[[Array], Array], slopes: Callable[[Array], Array]
) -> Array:
    """x of given fields (m, n) and their u-derivatives at u (m,), on the problem's mesh."""
    mesh, rule = problem.mesh, gauss_rule(problem.degree)
    stages = mesh[:-1, None] + np.diff(mesh)[:, None] * rule.points
    inner = slopes(stages.ravel()).reshape(*stages.shape, -1)
    none = np.zeros((*stages.shape, len(problem.system.algebraic)))
    return problem.pack(state_from_functions(mesh, problem.degree, values(mesh), inner, none, np.zeros(0)))


def at_rest(problem: CollocationProblem) -> Array:
    """x = 0."""
    zero = lambda u: np.zeros((len(u), problem.n))  # noqa: E731
    return start_from(problem, zero, zero)


def bratu(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + lam e^y = 0, y(0) = y(1) = 0 (row 1): fold at 3.513830719125161."""
    system = SecondOrder(lambda x, y, p: p[0] * jnp.exp(y), ("lam",))
    return CollocationProblem(system, uniform_mesh(elements), degree, 0, 1e-8)


def chafee_infante(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + lam (y - y^3) = 0, y(0) = y(pi) = 0 (row 7): pitchforks at lam = n^2."""
    mirror = Symmetry(False, (-1.0, -1.0), (0.0, 0.0))
    system = SecondOrder(lambda x, y, p: p[0] * (y - y**3), ("lam",), length=float(np.pi), mirror=mirror)
    return CollocationProblem(system, uniform_mesh(elements), degree, 0, 1e-8)
