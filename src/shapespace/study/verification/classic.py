"""Classic boundary value problems whose folds and branch points are known in closed form or published: no surface in them."""

from collections.abc import Callable, Sequence

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


class Ring(AbstractSystem):
    """dk/dt = k'' + k^3/2 - s k - p + c f(x) on a closed curve of length 2 pi, x = 2 pi u: an elastic ring under pressure.

    k: curvature, that of the unit circle being 1; s: tension and an integration constant. Forces balance as r moves with the
    ring, so that a periodic k with int k dx = 2 pi closes the curve wherever p != 0. Any shift of x gives another solution:
    int k g dx = 0 with an odd g chooses one, and its multiplier c, which pulls with an odd force f, vanishes at solutions.
    Perturbations of the circle by sin(n x) have the secular function sum_n f_n g_n/(n^2 - 1 - p) of the harmonics of f and
    g; these are chosen so that it is 1/prod_n (n^2 - 1 - p) up to n = 5, which nowhere vanishes.
    """

    fields: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("k", "slope"))
    algebraic: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    scalars: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("s", "c"))
    parameters: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("p",))

    @property
    def symmetry(self) -> Symmetry | None:
        """k(x) -> k(-x)."""
        return Symmetry(True, (1.0, -1.0), (0.0, 0.0), scalars=(1.0, -1.0))

    @staticmethod
    def phase(u: Traced) -> Traced:
        """g: a smooth derivative of the delta function at x = 0, with g_n proportional to n binomial(10, 5 - n)."""
        return jnp.cos(jnp.pi * u) ** 9 * jnp.sin(jnp.pi * u)

    @staticmethod
    def pull(u: Traced) -> Traced:
        """f: the first harmonics of the derivative of the delta function at x = pi."""
        n = jnp.arange(1, 6)
        return jnp.sum((-1.0) ** n * n * jnp.sin(2.0 * jnp.pi * n * u))

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        length, (k, slope) = 2.0 * jnp.pi, y
        force = k**3 / 2.0 - s[0] * k - p[0] + s[1] * self.pull(u)
        return jnp.stack([dy[0] - length * slope, dy[1] + length * (force - dq[0])])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return y1 - y0

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return jnp.stack([y[0], y[0] * self.phase(u)])

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.array([1.0, 0.0])


class Meridian(AbstractSystem):
    """dr/dt = r''/(1 + r'^2) - 1/r + (pressure) sqrt(1 + r'^2) with r = 1 at both ends of (0, L), z = L u: a film under tension.

    Without pressure a soap film between two rings; with it, and int r^2 du = 1, a column of liquid of given volume.
    """

    fields: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("r", "slope"))
    algebraic: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    scalars: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=())
    parameters: tuple[str, ...] = eqx.field(static=True, kw_only=True, default=("L",))

    @property
    def symmetry(self) -> Symmetry | None:
        """z -> L - z."""
        return Symmetry(True, (1.0, -1.0), (0.0, 0.0), scalars=(1.0,) * len(self.scalars))

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        (r, slope), pressure = y, s[0] if self.scalars else 0.0
        stretch = 1.0 + slope**2
        bend = dq[0] + 1.0 / r - pressure * jnp.sqrt(stretch)
        return jnp.stack([dy[0] - p[0] * slope, dy[1] - p[0] * stretch * bend])

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        return y[:1]

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        return jnp.stack([y0[0] - 1.0, y1[0] - 1.0])

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        return y[:1] ** 2 if self.scalars else jnp.zeros((0,))

    def targets(self, s: Traced, p: Traced) -> Traced:
        return jnp.ones(len(self.scalars))


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
    return constant(problem, (0.0,) * problem.n)


REFLECTION = Symmetry(True, (1.0, -1.0), (0.0, 0.0))
"""y(x) -> y(-x)."""
SIGN = Symmetry(False, (-1.0, -1.0), (0.0, 0.0))
"""y -> -y."""


def _carrier(x: Traced, y: Traced, p: Traced) -> Traced:
    return (2.0 * (1.0 - x**2) * y + y**2 - 1.0) / p[0] ** 2


def _heat_source(T: Traced, b: Traced) -> Traced:
    return 1.0 + (T + 0.5 * T**2) / (1.0 + b * T**2)


# Made once, so that their compiled functions are shared.
BRATU = SecondOrder(lambda x, y, p: p[0] * jnp.exp(y), parameters=("lam",))
GELFAND = {
    dimension: SecondOrder(
        lambda x, y, p: p[0] * jnp.exp(y), parameters=("lam",), neumann=(True, False), dimension=dimension
    )
    for dimension in (2, 3)
}
RING = Ring()
SOAP_FILM = Meridian()
LIQUID_COLUMN = Meridian(scalars=("pressure",))
NEUMANN_BRATU = SecondOrder(
    lambda x, y, p: -10.0 * (y - p[0] * jnp.exp(y)), parameters=("lam",), neumann=(True, True), mirror=REFLECTION
)
CHAN = SecondOrder(lambda x, y, p: p[0] * _heat_source(y + p[1], p[1]), parameters=("a", "b"), mirror=REFLECTION)
CARRIER = SecondOrder(_carrier, parameters=("eps",), length=2.0, start=-1.0, mirror=REFLECTION)
ELASTICA = SecondOrder(lambda x, y, p: p[0] * jnp.sin(y), parameters=("load",), neumann=(True, True), mirror=SIGN)
NON_AUTONOMOUS = SecondOrder(lambda x, y, p: p[0] * jnp.exp(x**3 * y), parameters=("p",))
CHAFEE_INFANTE = SecondOrder(lambda x, y, p: p[0] * (y - y**3), parameters=("lam",), length=float(np.pi), mirror=SIGN)


def on_uniform_mesh(system: AbstractSystem, elements: int, degree: int) -> CollocationProblem:
    """A system on equal elements, whose mesh moves where the error demands it."""
    return CollocationProblem(system, uniform_mesh(elements), degree, 1e-8)


def bratu(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + lam e^y = 0, y(0) = y(1) = 0: fold at 3.513830719125161; at lam = 1, y(1/2) = 0.140539214400472 and
    4.091467246189261 (closed form; Buckmire).
    """
    return on_uniform_mesh(BRATU, elements, degree)


def gelfand(elements: int = 20, degree: int = 4, dimension: int = 3) -> CollocationProblem:
    """y'' + (d - 1)/r y' + lam e^y = 0, y'(0) = y(1) = 0, a pole at r = 0: for d = 3 folds at 3.321992118, 1.664156190,
    2.108541102, 1.967465559, 2.009976405 and on towards 2 (Joseph & Lundgren 1973); for d = 2 one at 2.
    """
    return on_uniform_mesh(GELFAND[dimension], elements, degree)


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


def non_autonomous(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """y'' + p e^(x^3 y) = 0, y(0) = y(1) = 0: a fold at 14.074498573 (AUTO demo `non`: 14.0745)."""
    return on_uniform_mesh(NON_AUTONOMOUS, elements, degree)


def carrier(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """eps^2 y'' + 2 (1 - x^2) y + y^2 = 1, y(-1) = y(1) = 0: layers of width eps; Chapman & Farrell, arXiv 1609.08842."""
    return on_uniform_mesh(CARRIER, elements, degree)


def elastica(elements: int = 40, degree: int = 4) -> CollocationProblem:
    """theta'' + P sin theta = 0, theta'(0) = theta'(1) = 0: pitchforks at P = (n pi)^2, and on the first branch
    P/pi^2 = (2 K(sin(alpha/2))/pi)^2 at the end angle alpha.
    """
    return on_uniform_mesh(ELASTICA, elements, degree)


def ring(elements: int = 40, degree: int = 4) -> CollocationProblem:
    """An elastic ring under the pressure p: the circle buckles at p = n^2 - 1, n = 2, 3, ...; opposite sides touch at
    p = 5.24688696 for n = 2 (Flaherty, Keller and Rubinow 1972: 5.247).
    """
    return on_uniform_mesh(RING, elements, degree)


def soap_film(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """A catenoid between rings of radius 1 at a distance L: none beyond L/2 = 0.662743419349, with r(1/2) = 0.552434124531."""
    return on_uniform_mesh(SOAP_FILM, elements, degree)


def liquid_column(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """A cylinder of liquid pinned at both ends: a pitchfork at L = 2 pi (Plateau)."""
    return on_uniform_mesh(LIQUID_COLUMN, elements, degree)


def constant(problem: CollocationProblem, value: Sequence[float], scalars: Sequence[float] = ()) -> Array:
    """x of fields that do not depend on u."""
    fields = np.array(value, dtype=float)
    return start_from(
        problem,
        lambda u: np.tile(fields, (len(u), 1)),
        lambda u: np.zeros((len(u), problem.n)),
        np.array(scalars, dtype=float) if len(scalars) else None,
    )


def circle(problem: CollocationProblem, pressure: float) -> Array:
    """The circular ring: k = 1, s = 1/2 - p."""
    return constant(problem, (1.0, 0.0), (0.5 - pressure, 0.0))


def middle(problem: CollocationProblem, x: Array) -> float:
    """y at u = 1/2."""
    return float(problem.unpack(x).values(np.array([0.5]))[0, 0])
