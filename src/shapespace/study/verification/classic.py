"""Classic boundary value problems whose folds and branch points are known in closed form or published: no surface in them."""

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
    """dy/dt = y'' + (d - 1)/x y' + f(x, y, p) with y or y' zero at each end, d = dimension; x = start + length u, y' = dy/dx."""

    forcing: PointFunction = eqx.field(static=True)
    neumann: tuple[bool, bool] = eqx.field(static=True, default=(False, False))
    length: float = eqx.field(static=True, default=1.0)
    start: float = eqx.field(static=True, default=0.0)
    dimension: int = eqx.field(static=True, default=1)
    mirror: Symmetry | None = eqx.field(static=True, default=None)
    fields: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("y", "slope"))
    algebraic: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    scalars: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    parameters: tuple[str, ...] = eqx.field(static=True, kw_only=True)

    @property
    def symmetry(self) -> Symmetry | None:
        return self.mirror

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        x = self.start + self.length * u
        bend = (self.dimension - 1) / x * y[1] if self.dimension > 1 else 0.0
        return jnp.stack([dy[0] - self.length * y[1], dy[1] + self.length * (bend + self.forcing(x, y[0], p) - dq[0])])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return jnp.stack([y0[int(self.neumann[0])], y1[int(self.neumann[1])]])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.zeros((0,))


class MeanFree(AbstractSystem):
    """dy/dt = y'' + p1 e^y with y(0) - y(1) = p2 and int y = 0."""

    fields: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("y", "slope"))
    algebraic: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    scalars: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    parameters: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("p1", "p2"))

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.stack([dy[0] - y[1], dy[1] + p[0] * jnp.exp(y[0]) - dq[0]])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return (y0[0] - y1[0] - p[1])[None]

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return y[:1]

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.zeros((1,))


def start_from(
    problem: CollocationProblem,
    values: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    scalars: Array | None = None,
) -> Array:
    """x of given fields (m, n) and their u-derivatives at u (m,), on the problem's mesh."""
    mesh, rule = problem.mesh, gauss_rule(problem.degree)
    stages = mesh[:-1, None] + np.diff(mesh)[:, None] * rule.points
    inner = slopes(stages.ravel()).reshape(*stages.shape, -1)
    none = np.zeros((*stages.shape, len(problem.system.algebraic)))
    scalars = np.zeros(len(problem.system.scalars)) if scalars is None else scalars
    return problem.pack(state_from_functions(mesh, problem.degree, values(mesh), inner, none, scalars))


def at_rest(problem: CollocationProblem) -> Array:
    """x = 0."""

    def zero(u: Array) -> Array:
        return np.zeros((len(u), problem.n))

    return start_from(problem, zero, zero)


REFLECTION = Symmetry(True, (1.0, -1.0), (0.0, 0.0))
"""y(x) -> y(-x)."""
SIGN = Symmetry(False, (-1.0, -1.0), (0.0, 0.0))
"""y -> -y."""


def _heat_source(T: Traced, b: Traced) -> Traced:
    return 1.0 + (T + 0.5 * T**2) / (1.0 + b * T**2)


# Made once, so that their compiled functions are shared.
BRATU = SecondOrder(lambda x, y, p: p[0] * jnp.exp(y), parameters=("lam",))
GELFAND = SecondOrder(lambda x, y, p: p[0] * jnp.exp(y), parameters=("lam",), neumann=(True, False), dimension=3)
NEUMANN_BRATU = SecondOrder(
    lambda x, y, p: -10.0 * (y - p[0] * jnp.exp(y)), parameters=("lam",), neumann=(True, True), mirror=REFLECTION
)
CHAN = SecondOrder(lambda x, y, p: p[0] * _heat_source(y + p[1], p[1]), parameters=("a", "b"), mirror=REFLECTION)
CHAFEE_INFANTE = SecondOrder(lambda x, y, p: p[0] * (y - y**3), parameters=("lam",), length=float(np.pi), mirror=SIGN)


def on_uniform_mesh(system: AbstractSystem, elements: int, degree: int) -> CollocationProblem:
    """A system on equal elements, whose mesh moves where the error demands it."""
    return CollocationProblem(system, uniform_mesh(elements), degree, 1e-8)


def bratu(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + lam e^y = 0, y(0) = y(1) = 0: fold at 3.513830719125161; at lam = 1, y(1/2) = 0.140539214400472 and
    4.091467246189261 (closed form; Buckmire).
    """
    return on_uniform_mesh(BRATU, elements, degree)


def gelfand(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + (2/r) y' + lam e^y = 0, y'(0) = y(1) = 0: folds at 3.321992118, 1.664156190, 2.108541102, 1.967465559,
    2.009976405 and on towards 2; a pole at r = 0. Joseph & Lundgren 1973.
    """
    return on_uniform_mesh(GELFAND, elements, degree)


def neumann_bratu(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' - 10 (y - lam e^y) = 0, y'(0) = y'(1) = 0: y constant with lam = y e^-y, a fold at 1/e, branch points at
    y = 1 + (n pi)^2/10.
    """
    return on_uniform_mesh(NEUMANN_BRATU, elements, degree)


def mean_free(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + p1 e^y = 0, y(0) - y(1) = p2, int y = 0: fold at p1 = 11.923790201 for p2 = 0 (AUTO demo `int`: 11.9238)."""
    return on_uniform_mesh(MeanFree(), elements, degree)


def chan(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """T'' + a (1 + (T + T^2/2)/(1 + b T^2)) = 0, T = b at both ends, y = T - b.

    Folds for b = 0.01 at a = 4.041401867 and 3.155897933 (problem: tutorials of LOCA and BifurcationKit).
    """
    return on_uniform_mesh(CHAN, elements, degree)


def chafee_infante(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + lam (y - y^3) = 0, y(0) = y(pi) = 0: pitchforks at lam = n^2."""
    return on_uniform_mesh(CHAFEE_INFANTE, elements, degree)
