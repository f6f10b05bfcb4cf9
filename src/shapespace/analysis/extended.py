"""A problem with free parameters and as many extra scalar conditions, as one square system that Newton's method solves."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.problem import AbstractContinuableProblem, AbstractLinearisation, AbstractProblem, Border, Rate


class AbstractMeasure(ABC):
    """A smooth number g(x; p) of a state: a parameter, or something observed."""

    @abstractmethod
    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        """g at the state x of the problem, with all parameters p."""

    @abstractmethod
    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        """(dg/dx (n,), dg/dp (n_p,))."""


@final
@dataclass(frozen=True)
class Parameter(AbstractMeasure):
    """p[index]."""

    index: int

    def value(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        return float(p[self.index])

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        unit = np.zeros_like(p)
        unit[self.index] = 1.0
        return np.zeros_like(x), unit


class AbstractCondition(ABC):
    """One scalar equation c(x; p) = 0 beside those of a problem."""

    @abstractmethod
    def residual(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        """c at the state x of the problem, with all parameters p."""

    @abstractmethod
    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        """(dc/dx (n,), dc/dp (n_p,))."""


@final
@dataclass(frozen=True)
class Affine(AbstractCondition):
    """row . x + parameters . p = target: a plane, such as that of pseudo-arclength. Shapes: row (n,), parameters (n_p,)."""

    row: Array
    parameters: Array
    target: float

    def residual(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        return float(self.row @ x + self.parameters @ p - self.target)

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        return self.row, self.parameters


@final
@dataclass(frozen=True)
class Given(AbstractCondition):
    """measure(x; p) = target."""

    measure: AbstractMeasure
    target: float

    def residual(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> float:
        return self.measure.value(problem, x, p) - self.target

    def gradient(self, problem: AbstractContinuableProblem, x: Array, p: Array) -> tuple[Array, Array]:
        return self.measure.gradient(problem, x, p)


@dataclass(frozen=True)
class ExtendedProblem(AbstractProblem):
    """F(x; p) = 0 at rest with c_i(x; p) = 0 for X = (x, p[free]): as many conditions as free parameters.

    The p that methods take gives the parameters that are not free.
    """

    problem: AbstractContinuableProblem
    free: tuple[int, ...]
    conditions: tuple[AbstractCondition, ...]

    def __post_init__(self) -> None:
        if len(self.free) != len(self.conditions) or not self.free:
            raise ValueError(
                f"free parameters and conditions must be equally many, at least one; got {len(self.free)} and "
                f"{len(self.conditions)}."
            )

    def joined(self, x: Array, p: Array) -> Array:
        """X (n + m,)."""
        return np.concatenate([x, p[list(self.free)]])

    def split(self, X: Array, p: Array) -> tuple[Array, Array]:
        """x (n,) and all parameters (n_p,), the free ones from X."""
        full = p.copy()
        full[list(self.free)] = X[-len(self.free) :]
        return X[: -len(self.free)], full

    def residual(self, X: Array, p: Array, rate: Rate) -> Array:
        x, p = self.split(X, p)
        extra = [condition.residual(self.problem, x, p) for condition in self.conditions]
        return np.append(self.problem.residual(x, p, rate), extra)

    def linearise(self, X: Array, p: Array, rate: Rate) -> tuple[Array, AbstractLinearisation]:
        x, p = self.split(X, p)
        free = list(self.free)
        still = np.zeros_like(x)
        gradients = [condition.gradient(self.problem, x, p) for condition in self.conditions]
        border = Border(
            columns=np.stack([self.problem.derivative(x, p, still, unit) for unit in np.eye(len(p))[free]]),
            rows=np.stack([row for row, _ in gradients]),
            corner=np.stack([parameters[free] for _, parameters in gradients]),
        )
        residual, linearisation = self.problem.linearise(x, p, rate, border)
        extra = [condition.residual(self.problem, x, p) for condition in self.conditions]
        return np.append(residual, extra), linearisation

    def derivative(self, X: Array, p: Array, dX: Array) -> Array:
        """The Jacobian times dX (n + m,)."""
        x, p = self.split(X, p)
        dx, dp = self.split(dX, np.zeros_like(p))
        gradients = [condition.gradient(self.problem, x, p) for condition in self.conditions]
        extra = [row @ dx + parameters @ dp for row, parameters in gradients]
        return np.append(self.problem.derivative(x, p, dx, dp), extra)

    def stored(self, X: Array, p: Array) -> Array:
        return self.problem.stored(*self.split(X, p))

    def norm(self, dX: Array, X: Array) -> float:
        """The problem's, or the largest change of a free parameter relative to it (or one)."""
        m = len(self.free)
        parameters = [abs(dp) / max(abs(p), 1.0) for dp, p in zip(dX[-m:].tolist(), X[-m:].tolist(), strict=True)]
        return max(self.problem.norm(dX[:-m], X[:-m]), *parameters)

    def stored_norm(self, dq: Array, q: Array) -> float:
        return self.problem.stored_norm(dq, q)
