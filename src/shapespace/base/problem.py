"""What analysis may know of a problem: F(x, dq/dt; p) = 0 with stored quantities q(x).

Time enters only through q: dynamics replaces dq/dt by a backward difference, stationary states set it to zero, spectra
linearise it (mass action dF/d(dq/dt) dq/dx). Ordinary F(x, p) = M dx/dt is the case q = x.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from shapespace.base.arrays import Array


@dataclass(frozen=True)
class Rate:
    """dq/dt = coefficient q(x) + history. Shapes: history (n_q,). coefficient [1/time]."""

    coefficient: float
    history: Array


class AbstractLinearisation(ABC):
    """A factorised Jacobian of F over x at one state, for a fixed coefficient of the rate."""

    @property
    @abstractmethod
    def is_singular(self) -> bool:
        """True where no unique solution exists to working accuracy."""

    @abstractmethod
    def solve(self, residual: Array) -> Array:
        """The x-increment dx (n,) with J dx = residual (n,)."""


class AbstractProblem(ABC):
    """A square system for x (n,), on whatever discretisation the problem holds."""

    @abstractmethod
    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """F (n,)."""

    @abstractmethod
    def linearise(self, x: Array, p: Array, rate: Rate) -> tuple[Array, AbstractLinearisation]:
        """F (n,) and its factorised Jacobian at x."""

    @abstractmethod
    def stored(self, x: Array, p: Array) -> Array:
        """The stored quantities q (n_q,) whose time derivative enters F."""

    @abstractmethod
    def norm(self, dx: Array, x: Array) -> float:
        """Size of an increment relative to the state, independent of the discretisation."""

    @abstractmethod
    def stored_norm(self, dq: Array, q: Array) -> float:
        """Size of a change of the stored quantities relative to them, independent of the discretisation."""

    def adapted(self, x: Array) -> "AbstractProblem":
        """The same problem on a discretisation better suited to x; itself where this one is good enough."""
        return self

    def carried(self, x: Array, other: "AbstractProblem") -> Array:
        """The state x of this problem, represented on another discretisation of it."""
        return x
