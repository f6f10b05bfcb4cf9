"""Classic boundary value problems for tests of continuation and stability: those of `verify`, Carrier's, and an elastic ring."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.system import AbstractSystem, Symmetry
from shapespace.study.verification.classic import REFLECTION, SecondOrder, on_uniform_mesh, start_from


class Ring(AbstractSystem):
    """dk/dt = k'' + k^3/2 - s k - p + c f(x) on a closed curve of length 2 pi, x = 2 pi u: an elastic ring under pressure.

    k: curvature, that of the unit circle being 1; s: tension and an integration constant. Forces balance as r moves with the
    ring, so that a periodic k with int k dx = 2 pi closes the curve wherever p != 0. Any shift of x gives another solution:
    int k g dx = 0 with an odd g chooses one, and its multiplier c, which pulls with an odd force f, vanishes at solutions.
    Perturbations of the circle by sin(n x) have the secular function sum_n f_n g_n/(n^2 - 1 - p) of the harmonics of f and
    g; these are chosen so that it is 1/prod_n (n^2 - 1 - p) up to n = 5, which nowhere vanishes.
    """

    fields: ClassVar[tuple[str, ...]] = ("k", "slope")
    algebraic: ClassVar[tuple[str, ...]] = ()
    scalars: ClassVar[tuple[str, ...]] = ("s", "c")
    parameters: ClassVar[tuple[str, ...]] = ("p",)

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


def _carrier(x: Traced, y: Traced, p: Traced) -> Traced:
    return (2.0 * (1.0 - x**2) * y + y**2 - 1.0) / p[0] ** 2


# Made once, so that its compiled functions are shared.
CARRIER = SecondOrder(_carrier, parameters=("eps",), length=2.0, start=-1.0, mirror=REFLECTION)


def carrier(elements: int = 20, degree: int = 4) -> CollocationProblem:
    """eps^2 y'' + 2 (1 - x^2) y + y^2 = 1, y(-1) = y(1) = 0 (row 6): layers of width eps; Chapman & Farrell, arXiv 1609.08842."""
    return on_uniform_mesh(CARRIER, elements, degree)


def ring(elements: int = 40, degree: int = 4) -> CollocationProblem:
    """An elastic ring under the pressure p (row 9): the circle buckles at p = n^2 - 1, n = 2, 3, ...; opposite sides touch at
    p = 5.24688696 for n = 2 (Flaherty, Keller and Rubinow 1972: 5.247).
    """
    return on_uniform_mesh(Ring(), elements, degree)


def circle(problem: CollocationProblem, pressure: float) -> Array:
    """The circular ring: k = 1, s = 1/2 - p."""
    still = np.zeros(problem.n)
    round_shape = np.array([1.0, 0.0])
    tension = np.array([0.5 - pressure, 0.0])
    return start_from(
        problem, lambda u: np.tile(round_shape, (len(u), 1)), lambda u: np.tile(still, (len(u), 1)), tension
    )


def middle(problem: CollocationProblem, x: Array) -> float:
    """y at u = 1/2."""
    return float(problem.unpack(x).values(np.array([0.5]))[0, 0])
