"""A boundary value problem on u in [0, 1], stated point by point: what collocation discretises."""

from abc import abstractmethod
from dataclasses import dataclass

import equinox as eqx

from shapespace.base.arrays import Traced


@dataclass(frozen=True)
class Symmetry:
    """A map of states that turns solutions into solutions, and is its own inverse.

    y(u) -> factors y(u or 1 - u) + offsets, a -> algebraic a, s -> scalars s. flips: whether u -> 1 - u.
    """

    flips: bool
    factors: tuple[float, ...]
    offsets: tuple[float, ...]
    algebraic: tuple[float, ...] = ()
    scalars: tuple[float, ...] = ()


class AbstractSystem(eqx.Module):
    """First-order system F(y', y, a, s, dq/dt; u, p) = 0 with end and integral conditions.

    y: differential fields (n,), continuous in u; a: algebraic fields (n_a,), known between the ends only; s: scalars
    (n_s,); q(y, a, s): stored quantities (n_q,). Conditions: n_b at the ends and n_i integrals with n_b + n_i = n + n_s.
    """

    fields: eqx.AbstractVar[tuple[str, ...]]
    algebraic: eqx.AbstractVar[tuple[str, ...]]
    scalars: eqx.AbstractVar[tuple[str, ...]]
    parameters: eqx.AbstractVar[tuple[str, ...]]

    @property
    def symmetry(self) -> Symmetry | None:
        """The reflection that the system has, if any."""
        return None

    @abstractmethod
    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        """n + n_a residuals at one interior point."""

    @abstractmethod
    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        """q (n_q,) at one point; at the ends, where a is not known, it comes as zeros."""

    @abstractmethod
    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        """n_b residuals from the values at u = 0 and u = 1."""

    @abstractmethod
    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        """n_i integrands at one point; their integrals over u must equal `targets`."""

    @abstractmethod
    def targets(self, s: Traced, p: Traced) -> Traced:
        """n_i values."""
