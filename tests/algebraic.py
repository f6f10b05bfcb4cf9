"""Algebraic problems of a few unknowns, differentiated by JAX and solved by dense linear algebra."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
from tests.dense import DenseLinearisation

from shapespace.base.arrays import Array, Traced
from shapespace.base.problem import AbstractSmoothProblem, Actions, Border, Rate


@dataclass(frozen=True)
class AlgebraicProblem(AbstractSmoothProblem):
    """dx/dt = f(x, p), that is F = f - dq/dt with q = x. `size`: of x."""

    function: Callable[[Traced, Traced], Traced]
    size: int

    @cached_property
    def _jacobian(self) -> Callable[..., Traced]:
        return jax.jit(jax.jacfwd(self.function))

    @cached_property
    def _derivative(self) -> Callable[..., Traced]:
        return jax.jit(lambda x, p, dx, dp: jax.jvp(self.function, (x, p), (dx, dp))[1])

    @cached_property
    def _second_derivative(self) -> Callable[..., Traced]:
        def along(x, p, one, dp, other, ep):
            return jax.jvp(lambda x, p: jax.jvp(self.function, (x, p), (one, dp))[1], (x, p), (other, ep))[1]

        return jax.jit(along)

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        return np.asarray(self.function(jnp.asarray(x), jnp.asarray(p))) - rate.coefficient * x - rate.history

    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, DenseLinearisation]:
        matrix = np.asarray(self._jacobian(x, p)) - rate.coefficient * np.eye(self.size)
        if border is not None:
            matrix = np.block([[matrix, border.columns.T], [border.rows, border.corner]])
        return self.residual(x, p, rate), DenseLinearisation(matrix)

    def stored(self, x: Array, p: Array) -> Array:
        return x

    def norm(self, dx: Array, x: Array) -> float:
        return float(np.max(np.abs(dx) / np.maximum(np.abs(x), 1.0)))

    def stored_norm(self, dq: Array, q: Array) -> float:
        return self.norm(dq, q)

    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        return np.asarray(self._derivative(x, p, dx, dp))

    def second_derivative(self, x: Array, p: Array, one: Array, dp: Array, other: Array, ep: Array) -> Array:
        return np.asarray(self._second_derivative(x, p, one, dp, other, ep))

    def actions(self, x: Array, p: Array) -> Actions:
        return Actions(
            lambda dx: self.derivative(x, p, dx, np.zeros_like(p)),
            lambda dx: -dx,
            lambda s: self.linearise(x, p, Rate.of_growth(self.stored(x, p), s))[1],
            np.full(len(x), True),
        )

    def weights(self, x: Array) -> Array:
        return 1.0 / np.maximum(np.abs(x), 1.0) ** 2
