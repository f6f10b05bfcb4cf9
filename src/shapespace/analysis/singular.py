"""Folds and branch points as roots of a defining system, which is itself a problem that continuation can follow.

With bordering rows c_i and a column b the kernel of F_z is read off

    [F_z  b] [v_i]   [ 0 ]
    [ c   0] [g_i] = [e_i],      i = 1..d,

whose matrix M is regular where F_z has d kernel directions; v_i spans the kernel exactly where all g_i = 0. Hence

    fold:          z = x,           d = 1,  b = F_lambda:  F(x, lambda) = 0,              g_1 = 0        for (x, lambda)
    branch point:  z = (x, lambda), d = 2,  b arbitrary:   F(x, lambda) + sigma b = 0,    g_1 = g_2 = 0  for (x, lambda, sigma)

(Govaerts 2000, Ch. 4-6). Newton needs no transposed solves: with M the increment is a particular part plus a combination of
kernel vectors, and along an increment a

    g_i' = last component of M^-1 [-F''(v_i, a); 0].

The branch point's unfolding sigma vanishes where branches really cross; g_i'(v_j) is the quadratic form of the bifurcation
equation, so the directions tau of the branches through the point solve sum_ij tau_i tau_j g_i'(v_j) = 0.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.problem import (
    AbstractContinuableProblem,
    AbstractLinearisation,
    AbstractProblem,
    AbstractSmoothProblem,
    Border,
    Rate,
)


class _Kernel(NamedTuple):
    """M factorised at one state, its kernel vectors v (d, n_z), the functions g (d,), and the residual F + sigma b (n,)."""

    linearisation: AbstractLinearisation
    vectors: Array
    g: Array
    residual: Array


@dataclass(frozen=True)
class SingularProblem(AbstractContinuableProblem):
    """The defining system of a fold (kernel (1, n)) or of a branch point (kernel (2, n + 1)) in parameter `index`.

    X = (x, lambda) or (x, lambda, sigma); p[index] is not used. kernel: approximate kernel vectors, unit vectors in the
    weights of the base, from which borders are made; better ones come with `adapted`.
    """

    base: AbstractSmoothProblem
    index: int
    kernel: Array

    @property
    def is_fold(self) -> bool:
        """True for a fold, False for a branch point."""
        return len(self.kernel) == 1

    def parameters(self, big_x: Array, p: Array) -> Array:
        """p with the unknown parameter in its place."""
        out = p.copy()
        out[self.index] = big_x[self.kernel.shape[1] - (0 if self.is_fold else 1)]
        return out

    def state(self, big_x: Array) -> Array:
        """x of X."""
        return big_x[: -1 if self.is_fold else -2]

    def _direction(self, value: float, p: Array) -> Array:
        out = np.zeros_like(p)
        out[self.index] = value
        return out

    def _kernel(self, big_x: Array, p: Array, rate: Rate) -> _Kernel:
        """Factorise M and find the kernel."""
        x, d = self.state(big_x), len(self.kernel)
        p = self.parameters(big_x, p)
        slope = self.base.derivative(x, p, np.zeros_like(x), self._direction(1.0, p))
        weights = self.base.weights(x)
        rows = weights * self.kernel[:, : len(x)]
        if self.is_fold:
            border = Border(slope[None], rows, np.zeros((1, 1)))
        else:
            unfolding = probe(len(x))
            corner = np.stack([_parameter_weight(p[self.index]) * self.kernel[:, -1], np.zeros(2)], axis=1)
            border = Border(np.stack([slope, unfolding]), rows, corner)
        residual, linearisation = self.base.linearise(x, p, rate, border)
        if not self.is_fold:
            residual = residual + big_x[-1] * unfolding
        solutions = np.stack([linearisation.solve(_unit(len(x) + d, len(x) + i)) for i in range(d)])
        return _Kernel(linearisation, solutions[:, :-1], solutions[:, -1], residual)

    def gradient(self, kernel: _Kernel, big_x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """g_i' (d,) along (dx, dp), dp being complete."""
        x, p = self.state(big_x), self.parameters(big_x, p)
        out = np.empty(len(kernel.vectors))
        for i, vector in enumerate(kernel.vectors):
            along = self._direction(0.0 if self.is_fold else vector[-1], p)
            curvature = self.base.second_derivative(x, p, vector[: len(x)], along, dx, dp)
            out[i] = kernel.linearisation.solve(np.append(-curvature, np.zeros(len(kernel.vectors))))[-1]
        return out

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """(F + sigma b, g)."""
        kernel = self._kernel(x, p, rate)
        return np.concatenate([kernel.residual, kernel.g])

    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, "SingularLinearisation"]:
        """Residual and a solver for its Jacobian."""
        kernel = self._kernel(x, p, rate)
        linearisation = make_singular_linearisation(self, kernel, x, p, border)
        return np.concatenate([kernel.residual, kernel.g]), linearisation

    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """Along dX = (dx, dlambda[, dsigma]) and the other parameters dp."""
        state, full = self.state(x), self.parameters(x, p)
        inner, along = self.state(dx), self.parameters(dx, dp)
        kernel = self._kernel(x, p, Rate.of_growth(self.base.stored(state, full)))
        change = self.base.derivative(state, full, inner, along)
        if not self.is_fold:
            change = change + dx[-1] * probe(len(state))
        return np.concatenate([change, self.gradient(kernel, x, p, inner, along)])

    def weights(self, x: Array) -> Array:
        """Of the base, and of the parameter; the unfolding does not count."""
        state = self.state(x)
        weight = _parameter_weight(x[len(state)])
        return np.concatenate([self.base.weights(state), [weight] if self.is_fold else [weight, 0.0]])

    def norm(self, dx: Array, x: Array) -> float:
        """Of the state, of the parameter relative to it (or one) and of the unfolding."""
        scalars = np.abs(dx[len(self.state(dx)) :])
        scalars[0] /= max(abs(float(x[len(self.state(x))])), 1.0)
        return float(max(self.base.norm(self.state(dx), self.state(x)), scalars.max()))

    def stored(self, x: Array, p: Array) -> Array:
        """Of the base."""
        return self.base.stored(self.state(x), self.parameters(x, p))

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Of the base."""
        return self.base.stored_norm(dq, q)

    def with_kernel(self, x: Array, p: Array) -> "SingularProblem":
        """The same problem with the kernel found at X as an orthonormal basis."""
        vectors = self._kernel(x, p, Rate.of_growth(self.stored(x, p))).vectors
        weights = self.weights(x)[: vectors.shape[1]]
        basis: list[Array] = []
        for vector in vectors[::-1]:
            rest = vector - sum(((weights @ (vector * known)) * known for known in basis), np.zeros_like(vector))
            basis.append(rest / np.sqrt(weights @ rest**2))
        return replace(self, kernel=np.stack(basis[::-1]))

    def form(self, x: Array, p: Array) -> Array:
        """The quadratic form g_i'(v_j) (d, d) of the bifurcation equation in the basis `kernel`."""
        kernel = self._kernel(x, p, Rate.of_growth(self.stored(x, p)))
        n = len(self.state(x))
        rows = []
        for vector in kernel.vectors:
            dp = self._direction(0.0 if self.is_fold else vector[-1], p)
            rows.append(self.gradient(kernel, x, p, vector[:n], dp))
        return np.stack(rows, axis=1)

    def adapted(self, x: Array) -> "SingularProblem":
        """On the discretisation that the base asks for at the state, with the kernel carried there."""
        better = self.base.adapted(self.state(x))
        if better is self.base:
            return self
        assert isinstance(better, AbstractSmoothProblem)
        n = len(self.state(x))
        kernel = [np.append(self.base.carried(v[:n], better), v[n:]) for v in self.kernel]
        return replace(self, base=better, kernel=np.stack(kernel))

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """The state carried, the scalars kept."""
        assert isinstance(other, SingularProblem)
        n = len(self.state(x))
        return np.concatenate([self.base.carried(x[:n], other.base), x[n:]])


@dataclass(frozen=True)
class SingularLinearisation(AbstractLinearisation):
    """The Jacobian of a SingularProblem: every solution is a particular part plus kernel vectors and border columns.

    columns (d + m, n_z + 1): for kernel vectors and border columns the increments (dz, last scalar) that they add;
    matrix (d + m, d + m): how these change g and meet the border's rows.
    """

    problem: SingularProblem
    kernel: _Kernel
    x: Array
    p: Array
    border: Border
    columns: Array
    matrix: Array

    @property
    def is_singular(self) -> bool:
        """M or the small matrix is singular."""
        return self.kernel.linearisation.is_singular or not np.linalg.cond(self.matrix) < 1e14

    @property
    def sign(self) -> float:
        """Of the determinant, up to a factor of the size."""
        return self.kernel.linearisation.sign * float(np.linalg.slogdet(self.matrix).sign)

    def solve(self, residual: Array) -> Array:
        """dX, then the border's unknowns."""
        d, m = len(self.kernel.vectors), len(self.border.corner)
        n = len(residual) - d - m
        particular = self.kernel.linearisation.solve(np.append(residual[:n], np.zeros(d)))
        known = _conditions(self.problem, self.kernel, self.x, self.p, self.border, particular)
        amounts = np.linalg.solve(self.matrix, residual[n:] - known)
        return np.concatenate([particular + amounts @ self.columns, amounts[d:]])


def make_singular_linearisation(
    problem: SingularProblem, kernel: _Kernel, x: Array, p: Array, border: Border | None
) -> SingularLinearisation:
    """Prepare the small matrix of a SingularLinearisation."""
    size, d = len(x), len(kernel.vectors)
    if border is None:
        border = Border(np.zeros((0, size)), np.zeros((0, size)), np.zeros((0, 0)))
    n = size - d
    columns = [np.append(v, g) for v, g in zip(kernel.vectors, kernel.g, strict=True)]
    columns += [kernel.linearisation.solve(np.append(-column[:n], np.zeros(d))) for column in border.columns]
    matrix = np.stack([_conditions(problem, kernel, x, p, border, column) for column in columns], axis=1)
    matrix[:d, d:] += border.columns[:, n:].T
    matrix[d:, d:] += border.corner
    return SingularLinearisation(problem, kernel, x, p, border, np.stack(columns), matrix)


def _conditions(
    problem: SingularProblem, kernel: _Kernel, x: Array, p: Array, border: Border, increment: Array
) -> Array:
    """(g', border rows) along dX = (dz, last scalar)."""
    dp = np.zeros_like(p)
    dp[problem.index] = increment[len(problem.state(x))]
    g = problem.gradient(kernel, x, p, problem.state(increment), dp)
    return np.concatenate([g, border.rows @ increment])


def probe(size: int, number: int = 0) -> Array:
    """A fixed vector (size,) that no left null vector is likely to be orthogonal to."""
    return np.random.default_rng([size, number]).standard_normal(size)


def _parameter_weight(value: float) -> float:
    return float(1.0 / max(abs(value), 1.0) ** 2)


def _unit(size: int, at: int) -> Array:
    out = np.zeros(size)
    out[at] = 1.0
    return out
