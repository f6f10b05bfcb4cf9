"""A scenario's problem with some of its keys as the parameters: what branches, curves and diagrams vary.

Every dimensionless parameter is a product of powers of the keys (the scales are, and so are the twins):

    p_i(q) = a_i prod_k q_k^e_ik

so that derivatives along a key are exact, also where one key moves many parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shapespace.analysis.controlled import ControlledProblem
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, AbstractSmoothProblem, Actions, Border, Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.engine import Engine
from shapespace.study.scenario import Scenario


@dataclass(frozen=True)
class Powers:
    """p_i = amplitudes_i prod_k q_k^exponents_ik. Shapes: amplitudes (n_p,), exponents (n_p, m)."""

    amplitudes: Array
    exponents: Array

    def value(self, q: Array) -> Array:
        """p (n_p,)."""
        return np.asarray(self.amplitudes * _power(q, self.exponents).prod(axis=1))

    def slope(self, q: Array, dq: Array) -> Array:
        """dp (n_p,) along dq (m,)."""
        moved = [(partial, d) for partial, d in zip(self._partials, dq, strict=True) if d]
        return sum((partial.value(q) * d for partial, d in moved), np.zeros_like(self.amplitudes))

    def bend(self, q: Array, dq: Array, eq: Array) -> Array:
        """The second derivative (n_p,) along dq and eq (m,)."""
        terms = (partial.slope(q, eq) * d for partial, d in zip(self._partials, dq, strict=True) if d)
        return sum(terms, np.zeros_like(self.amplitudes))

    @cached_property
    def _partials(self) -> list["Powers"]:
        """The derivative by each key, products of powers too."""
        return [self._partial(k) for k in range(self.exponents.shape[1])]

    def _partial(self, k: int) -> "Powers":
        amplitudes, exponents = self.amplitudes * self.exponents[:, k], self.exponents.copy()
        exponents[:, k] -= 1.0
        # A vanished amplitude stands for a constant, whose lowered powers need not be finite.
        return Powers(amplitudes, np.where(amplitudes[:, None] == 0.0, 0.0, exponents))


def _power(q: Array, exponents: Array) -> Array:
    """q_k^e_ik with 0^0 = 1; integer powers of negative numbers are real."""
    return np.asarray(np.power(q[None, :], exponents))


def make_powers(scenario: Scenario, keys: tuple[str, ...]) -> Powers:
    """How the dimensionless parameters depend on the keys. InputError for a key that is no real physical parameter."""
    return powers_of(scenario, keys, lambda one: Engine.of(one).p)


def powers_of(scenario: Scenario, keys: tuple[str, ...], of: Callable[[Scenario], Array]) -> Powers:
    """How numbers of a scenario (n,) that are products of powers of the keys depend on these; InputError as above."""
    known = {**scenario.parameters.model_dump(), **scenario.twins()}
    for key in keys:
        if key not in known:
            raise InputError(f"{key}: is not a parameter of this model; choose one of {', '.join(known)}.")

    def at(values: Array) -> Array:
        return of(scenario.with_overrides(dict(zip(keys, values.tolist(), strict=True))))

    # At values that every key may have: a reduced volume is less than one.
    base = at(np.full(len(keys), 0.5))
    halved = [at(0.5 - 0.25 * np.eye(len(keys))[k]) for k in range(len(keys))]
    ratios = np.stack([np.where(base == 0.0, 1.0, base / np.where(base == 0.0, 1.0, p)) for p in halved], axis=1)
    # Exponents are multiples of 1/6: of areas, volumes and their roots.
    exponents = np.round(6.0 * np.log2(ratios)) / 6.0
    return Powers(base * 2.0 ** exponents.sum(axis=1), exponents)


@dataclass(frozen=True)
class KeyedProblem(AbstractSmoothProblem):
    """A collocation problem whose parameters q (m,) are the values of `keys`."""

    base: CollocationProblem
    keys: tuple[str, ...]
    powers: Powers

    @classmethod
    def of(cls, scenario: Scenario, keys: tuple[str, ...]) -> "KeyedProblem":
        """On the scenario's initial mesh. InputError where the mesh moves with the surface, so that it has no state at rest."""
        if (mesh := scenario.numerics.parameterization) != "sle":
            raise InputError(
                f"parameterization = {mesh!r}: a stationary state has no such mesh; give parameterization=sle."
            )
        return cls(Engine.of(scenario).problem, keys, make_powers(scenario, keys))

    def surface(self, x: Array) -> Array:
        """The part of x that is the state of the surface: all of it."""
        return x

    def key_value(self, x: Array, p: Array) -> float:
        """The value of the first key."""
        return float(p[0])

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """Of the base."""
        return self.base.residual(x, self.powers.value(p), rate)

    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, AbstractLinearisation]:
        """Of the base."""
        return self.base.linearise(x, self.powers.value(p), rate, border)

    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """F_x dx + F_p p'(q) dq."""
        return self.base.derivative(x, self.powers.value(p), dx, self.powers.slope(p, dp))

    def second_derivative(self, x: Array, p: Array, one: Array, dp: Array, other: Array, ep: Array) -> Array:
        """F'' along (dx, p'(q) dq) twice, and F_p p''(q)."""
        at, powers = self.powers.value(p), self.powers
        direct = self.base.second_derivative(x, at, one, powers.slope(p, dp), other, powers.slope(p, ep))
        bend = powers.bend(p, dp, ep)
        return direct + self.base.derivative(x, at, np.zeros_like(x), bend) if bend.any() else direct

    def actions(self, x: Array, p: Array) -> Actions:
        """Of the base."""
        return self.base.actions(x, self.powers.value(p))

    def stored(self, x: Array, p: Array) -> Array:
        """Of the base."""
        return self.base.stored(x, self.powers.value(p))

    def weights(self, x: Array) -> Array:
        """Of the base."""
        return self.base.weights(x)

    def norm(self, dx: Array, x: Array) -> float:
        """Of the base."""
        return self.base.norm(dx, x)

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Of the base."""
        return self.base.stored_norm(dq, q)

    def adapted(self, x: Array) -> "KeyedProblem":
        """On the mesh that the base chooses."""
        better = self.base.adapted(x)
        return self if better is self.base else replace(self, base=better)

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """On the mesh of the other."""
        assert isinstance(other, KeyedProblem)
        return self.base.carried(x, other.base)

    def refined(self) -> "KeyedProblem":
        """With every element halved."""
        return replace(self, base=self.base.refined())

    def reflected(self, x: Array, increment: bool = False) -> Array | None:
        """Of the base."""
        return self.base.reflected(x, increment)


@dataclass(frozen=True)
class HeldProblem(ControlledProblem):
    """A KeyedProblem with an observable prescribed: its first key becomes an unknown, the last of x."""

    inner: KeyedProblem

    @property
    def base(self) -> CollocationProblem:
        """The collocation problem."""
        return self.inner.base

    def surface(self, x: Array) -> Array:
        """The part of x that is the state of the surface."""
        return x[:-1]

    def key_value(self, x: Array, p: Array) -> float:
        """The value of the key that answers."""
        return float(x[-1])
