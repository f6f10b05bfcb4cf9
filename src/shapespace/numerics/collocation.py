"""Gauss collocation of an AbstractSystem: residual, structured Jacobian and stored quantities on a given mesh."""

from dataclasses import dataclass, replace
from functools import cached_property

import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.base.problem import AbstractLinearisation, AbstractProblem, AbstractSmoothProblem, Border, Rate
from shapespace.numerics import condensation
from shapespace.numerics.adaptation import adapted_mesh
from shapespace.numerics.border import with_border
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.pointwise import Density, Functions, compiled_functions
from shapespace.numerics.small_lu import compiled
from shapespace.numerics.state import State
from shapespace.numerics.system import AbstractSystem

RELATIVE_FLOOR = 1.0
"""Fields and scalars smaller than this are measured absolutely in norms; problems are dimensionless and of order one."""


@compiled
def _largest_relative(change, values, columns, weights):  # type: ignore[no-untyped-def]
    """max over columns of max_i |weights_i change_ic| / max(max_i |values_ic|, floor), both flat and columns wide."""
    largest = 0.0
    for c in range(columns):
        top, scale = 0.0, RELATIVE_FLOOR
        for i in range(change.shape[0] // columns):
            difference = abs(weights[i] * change[i * columns + c])
            if not difference <= top:
                top = difference
        for i in range(values.shape[0] // columns):
            scale = max(scale, abs(values[i * columns + c]))
        if not top < np.inf:
            return np.inf
        largest = max(largest, top / scale)
    return largest


@dataclass(frozen=True)
class CollocationLinearisation(AbstractLinearisation):
    """The factorised Jacobian of a CollocationProblem."""

    problem: "CollocationProblem"
    factors: condensation.Factors

    @property
    def is_singular(self) -> bool:
        """A pivot vanished or is not finite."""
        return self.factors.singular

    @property
    def sign(self) -> float:
        """Of the determinant, up to a factor that N and k determine."""
        return condensation.determinant_sign(self.factors)

    def solve(self, residual: Array) -> Array:
        """J dx = residual."""
        return condensation.solve(self.factors, residual)


@dataclass(frozen=True)
class CollocationProblem(AbstractSmoothProblem):
    """An AbstractSystem on a mesh with k Gauss points per element; x packs nodes, slopes, algebraic fields and scalars."""

    system: AbstractSystem
    mesh: Array
    degree: int
    n_integrals: int
    tolerance: float = 1e-6

    @property
    def elements(self) -> int:
        """Number of elements N."""
        return len(self.mesh) - 1

    @property
    def n(self) -> int:
        """Number of differential fields."""
        return len(self.system.fields)

    @property
    def n_rows(self) -> int:
        """Equations per point, n + n_a."""
        return self.n + len(self.system.algebraic)

    @cached_property
    def _widths(self) -> Array:
        return np.diff(self.mesh)

    def pack(self, state: State) -> Array:
        """x (size,) of a state on this mesh."""
        return np.concatenate([state.nodes.ravel(), state.slopes.ravel(), state.algebraic.ravel(), state.scalars])

    def unpack(self, x: Array) -> State:
        """The state of x (size,)."""
        elements, k, n, n_a = self.elements, self.degree, self.n, len(self.system.algebraic)
        a = (elements + 1) * n
        b = a + elements * k * n
        c = b + elements * k * n_a
        nodes, slopes = x[:a].reshape(-1, n), x[a:b].reshape(elements, k, n)
        return State(self.mesh, nodes, slopes, x[b:c].reshape(elements, k, n_a), x[c:])

    @cached_property
    def _point_weights(self) -> tuple[Array, Array]:
        """Ones for as many rows as there are anywhere, and each Gauss point's element width."""
        return np.ones(self.elements * self.degree + 2), np.repeat(self._widths, self.degree)

    @cached_property
    def functions(self) -> Functions:
        """Compiled evaluations; arguments (mesh, x, history, coefficient, p)."""
        return compiled_functions(self.system, self.degree)

    @cached_property
    def _device_mesh(self) -> Traced:
        return jnp.asarray(self.mesh)

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """Equations at the Gauss points, continuity, end conditions, integral conditions."""
        return np.asarray(self.functions.residual(self._device_mesh, x, rate.history, rate.coefficient, p))

    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, CollocationLinearisation]:
        """Residual and factorised Jacobian. A border's columns become scalars, its rows integral conditions."""
        out = self.functions.linearised(self._device_mesh, x, rate.history, rate.coefficient, p)
        residual, *blocks = (np.asarray(part) for part in out)
        rule = gauss_rule(self.degree)
        points, ends, targets = blocks
        extra: list[Array] = []
        if border is not None:
            points, ends, targets, *extra = with_border(
                border, self._widths, rule.weights, self.n, points, ends, targets
            )
        factors = condensation.factorise(self._widths, rule.matrix, rule.weights, points, ends, targets, self.n, *extra)
        return residual, CollocationLinearisation(self, factors)

    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """F_x dx + F_p dp at rest, flat as the residual."""
        return np.asarray(self.functions.derivative(self._device_mesh, x, p, dx, dp))

    def second_derivative(self, x: Array, p: Array, one: Array, dp: Array, other: Array, ep: Array) -> Array:
        """F'' along (one, dp) and (other, ep) at rest, flat as the residual."""
        return np.asarray(self.functions.second_derivative(self._device_mesh, x, p, one, dp, other, ep))

    def mass(self, x: Array, p: Array, dx: Array) -> Array:
        """dF/d(dq/dt) dq/dx dx at rest, flat as the residual."""
        return np.asarray(self.functions.mass(self._device_mesh, x, p, dx))

    def stored(self, x: Array, p: Array) -> Array:
        """q at the Gauss points and at both ends, flattened."""
        return np.asarray(self.functions.stored(self._device_mesh, x))

    def integrals(self, density: Density, x: Array, p: Array, rate: Rate) -> tuple[dict[str, float], dict[str, float]]:
        """Gauss quadrature of density(system, dy, y, a, s, dq, p) over u, by name, and the largest point values."""
        out = self.functions.integrals(density, self._device_mesh, x, rate.history, rate.coefficient, p)
        sums, peaks = ({name: float(value) for name, value in part.items()} for part in out)
        return sums, peaks

    def rates(self, x: Array, p: Array, rate: Rate) -> Array:
        """dq/dt at the Gauss points, (N, k, n_q)."""
        dq = rate.coefficient * self.stored(x, p) + rate.history
        n_q = len(dq) // (self.elements * self.degree + 2)
        return np.asarray(dq.reshape(-1, n_q)[:-2].reshape(self.elements, self.degree, n_q))

    def norm(self, dx: Array, x: Array) -> float:
        """Largest change of any field, algebraic field or scalar relative to that field's largest value (or one).

        A change of a slope counts as what it adds over its element.
        """
        n, n_a, points = self.n, len(self.system.algebraic), self.elements * self.degree
        a = (self.elements + 1) * n
        b = a + points * n
        c = b + points * n_a
        ones, widths = self._point_weights
        nodes = _largest_relative(dx[:a], x[:a], n, ones)
        slopes = _largest_relative(dx[a:b], x[:a], n, widths)
        algebraic = _largest_relative(dx[b:c], x[b:c], n_a, ones)
        scalars = _largest_relative(dx[c:], x[c:], len(x) - c, ones)
        return float(max(nodes, slopes, algebraic, scalars))

    def weights(self, x: Array) -> Array:
        """Of node values by the trapezoidal rule over u and of scalars, each relative to its largest value (or one)."""
        nodes = x[: (self.elements + 1) * self.n].reshape(-1, self.n)
        scale = np.maximum(np.abs(nodes).max(axis=0), RELATIVE_FLOOR)
        shares = 0.5 * (np.append(self._widths, 0.0) + np.append(0.0, self._widths))
        weights = np.zeros_like(x)
        weights[: nodes.size] = (shares[:, None] / scale**2).ravel()
        scalars = len(self.system.scalars)
        if scalars:
            weights[-scalars:] = 1.0 / np.maximum(np.abs(x[-scalars:]), RELATIVE_FLOOR) ** 2
        return weights

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Largest change of any stored quantity relative to its largest value (or one)."""
        ones, _ = self._point_weights
        return float(_largest_relative(dq, q, len(q) // (self.elements * self.degree + 2), ones))

    def adapted(self, x: Array) -> "CollocationProblem":
        """On a mesh that follows x, refined to the next size where the estimated error exceeds the tolerance."""
        mesh = adapted_mesh(self.unpack(x), self.tolerance)
        return self if mesh is self.mesh else self.on_mesh(mesh)

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """x on the mesh of another problem with the same system."""
        assert isinstance(other, CollocationProblem)
        return other.pack(self.unpack(x).on_mesh(other.mesh))

    def on_mesh(self, mesh: Array) -> "CollocationProblem":
        """The same problem on another mesh."""
        return replace(self, mesh=mesh)

    def refined(self) -> "CollocationProblem":
        """On a mesh with every element halved."""
        return self.on_mesh(np.sort(np.concatenate([self.mesh, 0.5 * (self.mesh[1:] + self.mesh[:-1])])))

    def reflected(self, x: Array, increment: bool = False) -> Array | None:
        """The mirror image of a state, or of an increment, under the system's symmetry."""
        symmetry = self.system.symmetry
        if symmetry is None:
            return None
        return self.pack(self.unpack(x).reflected(symmetry, increment).on_mesh(self.mesh))
