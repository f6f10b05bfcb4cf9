"""A problem with something observed prescribed and a parameter free: what holds the observed value becomes an unknown."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from shapespace.analysis.extended import AbstractMeasure
from shapespace.base.arrays import Array
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, AbstractSmoothProblem, Actions, Border, Rate

INCREMENT = 1e-5
"""Of the state, relative to it (or one), over which a measure's gradient is differenced."""


@dataclass(frozen=True)
class ControlledProblem(AbstractSmoothProblem):
    """F(x; p) = 0 with g(x; p) = value for X = (x, p[index]); the P of its methods is p with the value in place of p[index].

    g(x) holds at all times, also as perturbations grow: they are those of the state under control, where p[index] answers.
    """

    inner: AbstractSmoothProblem
    index: int
    measure: AbstractMeasure

    def split(self, X: Array, P: Array) -> tuple[Array, Array]:
        """x (n,) and p (n_p,)."""
        p = P.copy()
        p[self.index] = X[-1]
        return X[:-1], p

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """(F, g - value)."""
        state, full = self.split(x, p)
        miss = self.measure.value(self.inner, state, full) - p[self.index]
        return np.append(self.inner.residual(state, full, rate), miss)

    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, AbstractLinearisation]:
        """The inner problem's with the free parameter's column and g's row as (further) border."""
        (state, full), m = self.split(x, p), 0 if border is None else len(border.corner)
        column = self.inner.derivative(state, full, np.zeros_like(state), self._unit(p))
        row, slopes = self.measure.gradient(self.inner, state, full)
        columns, rows, corner = column[None], row[None], np.zeros((1 + m, 1 + m))
        corner[0, 0] = slopes[self.index]
        if border is not None:
            columns, rows = (
                np.concatenate([columns, border.columns[:, :-1]]),
                np.concatenate([rows, border.rows[:, :-1]]),
            )
            corner[0, 1:], corner[1:, 0] = border.columns[:, -1], border.rows[:, -1]
            corner[1:, 1:] = border.corner
        residual, linearisation = self.inner.linearise(state, full, rate, Border(columns, rows, corner))
        miss = self.measure.value(self.inner, state, full) - p[self.index]
        return np.append(residual, miss), linearisation

    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """Along (dx, dp[index]) and the other parameters; dp's entry `index` changes the value."""
        (state, full), (ds, dq) = self.split(x, p), self.split(dx, dp)
        row, slopes = self.measure.gradient(self.inner, state, full)
        change = row @ ds + slopes @ dq - dp[self.index]
        return np.append(self.inner.derivative(state, full, ds, dq), change)

    def second_derivative(self, x: Array, p: Array, one: Array, dp: Array, other: Array, ep: Array) -> Array:
        """Of F exactly, of g by a difference of its gradient."""
        (state, full), (d, dq), (e, eq) = self.split(x, p), self.split(one, dp), self.split(other, ep)
        sizes = [np.abs(dx).max(initial=0.0) / max(np.abs(at).max(), 1.0) for dx, at in ((d, state), (dq, full))]
        step = INCREMENT / max(*sizes, np.finfo(float).tiny)
        slopes = []
        for sign in (1.0, -1.0):
            row, parameters = self.measure.gradient(self.inner, state + sign * step * d, full + sign * step * dq)
            slopes.append(row @ e + parameters @ eq)
        bend = (slopes[0] - slopes[1]) / (2.0 * step)
        return np.append(self.inner.second_derivative(state, full, d, dq, e, eq), bend)

    def actions(self, x: Array, p: Array) -> Actions:
        """Of the inner problem; the condition holds at once."""
        inner, still = self.inner.actions(*self.split(x, p)), np.zeros_like(p)
        return Actions(
            lambda dx: self.derivative(x, p, dx, still),
            lambda dx: np.append(inner.mass(dx[:-1]), 0.0),
            lambda s: self.linearise(x, p, Rate.of_growth(self.stored(x, p), s))[1],
            np.append(inner.moving, False),
        )

    def stored(self, x: Array, p: Array) -> Array:
        """Of the inner problem."""
        return self.inner.stored(*self.split(x, p))

    def weights(self, x: Array) -> Array:
        """Of the inner problem, and of the free parameter relative to it (or one)."""
        return np.append(self.inner.weights(x[:-1]), max(abs(float(x[-1])), 1.0) ** -2)

    def norm(self, dx: Array, x: Array) -> float:
        """The inner problem's, or the change of the free parameter relative to it (or one)."""
        return max(self.inner.norm(dx[:-1], x[:-1]), abs(float(dx[-1])) / max(abs(float(x[-1])), 1.0))

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Of the inner problem."""
        return self.inner.stored_norm(dq, q)

    def adapted(self, x: Array) -> Self:
        """With the inner problem on the discretisation that it asks for."""
        better = self.inner.adapted(x[:-1])
        if better is self.inner:
            return self
        assert isinstance(better, AbstractSmoothProblem)
        return replace(self, inner=better)

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """The state carried, the free parameter kept."""
        assert isinstance(other, ControlledProblem)
        return np.append(self.inner.carried(x[:-1], other.inner), x[-1])

    def refined(self) -> Self | None:
        """With the inner problem refined."""
        finer = self.inner.refined()
        return None if finer is None else replace(self, inner=finer)

    def reflected(self, x: Array, increment: bool = False) -> Array | None:
        """The mirror image, the free parameter being the same. Of a measure that it changes, states are not symmetric"""
        image = self.inner.reflected(x[:-1], increment)
        return None if image is None else np.append(image, x[-1])

    def _unit(self, p: Array) -> Array:
        out = np.zeros_like(p)
        out[self.index] = 1.0
        return out
