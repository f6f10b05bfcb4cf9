"""Small problems with dense linear algebra, to test what never sees a grid: Newton's method and time stepping."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, Rate

COMPLEX_STEP = 1e-30


@dataclass(frozen=True)
class DenseLinearisation(AbstractLinearisation):
    """A dense Jacobian."""

    matrix: Array

    @property
    def is_singular(self) -> bool:
        return not np.isfinite(self.matrix).all() or not np.linalg.cond(self.matrix) < 1e15

    @property
    def sign(self) -> float:
        return float(np.linalg.slogdet(self.matrix).sign)

    def solve(self, residual: Array) -> Array:
        return np.asarray(np.linalg.solve(self.matrix, residual))


@dataclass(frozen=True)
class DenseProblem(AbstractProblem):
    """F(x, dq/dt, p) = 0 with q(x), by default x itself; functions must accept complex x, from which J is differenced.

    `calls` counts the Jacobians.
    """

    function: Callable[[Array, Array, Array], Array]
    quantities: Callable[[Array], Array] = lambda x: x
    calls: list[int] = field(default_factory=lambda: [0])

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            return self.function(x, rate.coefficient * self.quantities(x) + rate.history, p)

    def linearise(self, x: Array, p: Array, rate: Rate) -> tuple[Array, AbstractLinearisation]:
        self.calls[0] += 1
        shifted = x + 1j * COMPLEX_STEP * np.eye(len(x))
        columns = [self.residual(column, p, rate).imag / COMPLEX_STEP for column in shifted]
        return self.residual(x, p, rate), DenseLinearisation(np.stack(columns, axis=1))

    def stored(self, x: Array, p: Array) -> Array:
        return self.quantities(x)

    def norm(self, dx: Array, x: Array) -> float:
        return float(np.max(np.abs(dx) / np.maximum(np.abs(x), 1.0)))

    def stored_norm(self, dq: Array, q: Array) -> float:
        return self.norm(dq, q)


NO_PARAMETERS = np.zeros(0)


def at_rest(size: int) -> Rate:
    """dq/dt = 0."""
    return Rate(0.0, np.zeros(size))
