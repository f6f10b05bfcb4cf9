"""What analysis may know of a problem: F(x, dq/dt; p) = 0 with stored quantities q(x).

Time enters only through q: dynamics replaces dq/dt by a backward difference, stationary states set it to zero, spectra
linearise it: a perturbation growing as e^(s t) obeys (J + s B) dx = 0 with the mass action B = dF/d(dq/dt) dq/dx. Ordinary
M dx/dt = G(x, p) is the case q = x, F = M dq/dt - G.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array, Flags


@dataclass(frozen=True)
class Rate:
    """dq/dt = coefficient q(x) + history. Shapes: history (n_q,) or (1,). coefficient [1/time]."""

    coefficient: float
    history: Array

    @classmethod
    def of_growth(cls, stored: Array, growth: float) -> "Rate":
        """dq/dt = growth (q(x) - stored): rest at a state with these stored quantities, where the Jacobian is J + growth B."""
        return cls(growth, -growth * stored)


REST = Rate(0.0, np.zeros(1))
"""dq/dt = 0, whatever q, which the history of one number fits by broadcasting."""


@dataclass(frozen=True)
class Border:
    """Extra columns (m, n), rows (m, n) and corner (m, m) of the matrix [[J, columns^T], [rows, corner]]."""

    columns: Array
    rows: Array
    corner: Array


class AbstractLinearisation(ABC):
    """A factorised Jacobian of F over x, perhaps bordered, at one state, for a fixed coefficient of the rate."""

    @property
    @abstractmethod
    def is_singular(self) -> bool:
        """True where no unique solution exists to working accuracy."""

    @property
    @abstractmethod
    def sign(self) -> float:
        """Sign of the determinant, up to a factor that the discretisation's size determines; 0 or NaN where singular."""

    @abstractmethod
    def solve(self, residual: Array) -> Array:
        """The increment dx (n + m,) with J dx = residual (n + m,), m being the width of the border."""


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
        """The state or increment x of this problem, represented on another discretisation of it."""
        return x


class AbstractContinuableProblem(AbstractProblem):
    """A problem whose solutions can be followed in parameters."""

    @abstractmethod
    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, AbstractLinearisation]:
        """F (n,) and its factorised Jacobian at x, with the border where one is given."""

    @abstractmethod
    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """F_x dx + F_p dp (n,) at rest."""

    def renewed(self, x: Array, p: Array) -> "AbstractContinuableProblem":
        """The same problem on the same discretisation, made ready to go on from the solution x; mostly itself."""
        return self

    @abstractmethod
    def weights(self, x: Array) -> Array:
        """w (n,), not negative: sum_i w_i a_i b_i is an inner product of increments near x that no discretisation changes."""


class Actions(NamedTuple):
    """The pencil J + s B at one state: products dx (n,) -> (n,) with the Jacobian J and the mass B, and factors at a real s.

    moving (n,): unknowns that B acts on; its other columns are zero.
    """

    jacobian: Callable[[Array], Array]
    mass: Callable[[Array], Array]
    factors: Callable[[float], AbstractLinearisation]
    moving: Flags


class AbstractSmoothProblem(AbstractContinuableProblem):
    """A problem whose singular points can be located and whose solutions can be judged."""

    @abstractmethod
    def second_derivative(self, x: Array, p: Array, one: Array, dp: Array, other: Array, ep: Array) -> Array:
        """The second derivative of F at rest along (one, dp) and (other, ep), (n,)."""

    @abstractmethod
    def actions(self, x: Array, p: Array) -> Actions:
        """Of J = F_x and B = dF/d(dq/dt) dq/dx at rest."""

    def refined(self) -> "AbstractSmoothProblem | None":
        """The same problem on a discretisation about twice as fine, to estimate errors; None where there is none."""
        return None

    def reflected(self, x: Array, increment: bool = False) -> Array | None:
        """The mirror image of a state, or of an increment, under the problem's symmetry; None without one."""
        return None
