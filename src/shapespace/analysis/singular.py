"""Folds and branch points as roots of a defining system, which is itself a problem that continuation can follow.

With bordering rows c_i and a column b the kernel of F_z is read off

    [F_z  b] [v_i]   [ 0 ]
    [ c   0] [g_i] = [e_i],      i = 1..d,

whose matrix M is regular where F_z has d kernel directions; v_i spans the kernel exactly where all g_i = 0. Hence

    fold:          z = x,           d = 1,  b = F_p n:     F(x, lambda) = 0,              g_1 = 0        for (x, lambda)
    branch point:  z = (x, lambda), d = 2,  b arbitrary:   F(x, lambda) + sigma b = 0,    g_1 = g_2 = 0  for (x, lambda, sigma)

(Govaerts 2000, Ch. 4-6). Where a point is located, n is the direction of lambda and b any vector. Where its curve is followed,
M has to stay regular, hence psi b different from zero for the left null vector psi: n is a direction across the curve of
folds, and b = sum_ij a_ij F''(v_i, v_j) with the quadratic form a below. Newton needs no transposed solves: with M
the increment is a particular part plus a combination of kernel vectors, and along an increment a

    g_i' = last component of M^-1 [-F''(v_i, a); 0].

The branch point's unfolding sigma vanishes where branches really cross; g_i'(v_j) is the quadratic form of the bifurcation
equation, so the directions tau of the branches through the point solve sum_ij tau_i tau_j g_i'(v_j) = 0.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.problem import (
    REST,
    AbstractContinuableProblem,
    AbstractLinearisation,
    AbstractProblem,
    AbstractSmoothProblem,
    Border,
    Rate,
)


class Kernel(NamedTuple):
    """M factorised at one state, its kernel vectors v (d, n_z), the functions g (d,), the residual F + sigma b (n,), F_lambda."""

    linearisation: AbstractLinearisation
    vectors: Array
    g: Array
    residual: Array
    slope: Array

    def increment(self, right: Array) -> Array:
        """(dx, dlambda, dsigma) of M^-1 (right, 0), NaN where M is singular; of a fold dlambda is zero."""
        if self.linearisation.is_singular:
            return np.full(len(right) + 2, np.nan)
        found = self.linearisation.solve(np.append(right, np.zeros(len(self.g))))
        return np.insert(found, -1, 0.0) if len(self.g) == 1 else found

    def project(self, right: Array) -> float:
        """psi right/(psi b): what the left null vector psi sees of right (n,)."""
        return float(self.increment(right)[-1])


@dataclass(frozen=True)
class SingularProblem(AbstractContinuableProblem):
    """The defining system of a fold (kernel (1, n)) or of a branch point (kernel (2, n + 1)) in parameter `index`.

    X = (x, lambda) or (x, lambda, sigma); p[index] is not used. kernel: approximate kernel vectors, unit vectors in the
    weights of the base, from which borders are made; better ones come with `renewed`. across: what makes the column
    b, the direction n (n_p,) of a fold or the form a (2, 2) of a branch point; empty where a point is located.
    """

    base: AbstractSmoothProblem
    index: int
    kernel: Array
    across: Array = field(default_factory=lambda: np.zeros(0))
    _last: dict[bytes, Kernel] = field(default_factory=dict, init=False, compare=False, repr=False)

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

    def _kernel(self, big_x: Array, p: Array, rate: Rate = REST) -> Kernel:
        """M factorised at X. At rest the last one is kept: Newton asks for residual, Jacobian and derivatives at one place."""
        if rate is not REST:
            return self._factorised(big_x, p, rate)
        place = big_x.tobytes() + p.tobytes()
        if place not in self._last:
            self._last.clear()
            self._last[place] = self._factorised(big_x, p, REST)
        return self._last[place]

    def _factorised(self, big_x: Array, p: Array, rate: Rate) -> Kernel:
        x, d = self.state(big_x), len(self.kernel)
        p = self.parameters(big_x, p)
        still = np.zeros_like(x)
        slope = self.base.derivative(x, p, still, self._direction(1.0, p))
        weights = self.base.weights(x)
        rows = weights * self.kernel[:, : len(x)]
        if self.is_fold:
            unfolding = self.base.derivative(x, p, still, self.across) if self.across.size else slope
            border = Border(unfolding[None], rows, np.zeros((1, 1)))
        else:
            unfolding = self._unfolding(x, p)
            corner = np.stack([_parameter_weight(p[self.index]) * self.kernel[:, -1], np.zeros(2)], axis=1)
            border = Border(np.stack([slope, unfolding]), rows, corner)
        residual, linearisation = self.base.linearise(x, p, rate, border)
        if not self.is_fold:
            residual = residual + big_x[-1] * unfolding
        if linearisation.is_singular:
            return Kernel(linearisation, np.full((d, len(x) + d - 1), np.nan), np.full(d, np.nan), residual, slope)
        solutions = np.stack([linearisation.solve(_unit(len(x) + d, len(x) + i)) for i in range(d)])
        return Kernel(linearisation, solutions[:, :-1], solutions[:, -1], residual, slope)

    def _unfolding(self, x: Array, p: Array) -> Array:
        """The column b (n,) of a branch point."""
        if not self.across.size:
            return probe(len(x))
        amounts = -self.across * np.array([[1.0, 2.0], [0.0, 1.0]])
        terms = [
            amounts[i, j] * self._curvature(x, p, self.kernel[i], self.kernel[j]) for i, j in ((0, 0), (0, 1), (1, 1))
        ]
        return np.asarray(sum(terms))

    def _curvature(self, x: Array, p: Array, one: Array, other: Array) -> Array:
        """F''(one, other) (n,) of two vectors (dx, dlambda) of a branch point."""
        along = [self._direction(vector[-1], p) for vector in (one, other)]
        return self.base.second_derivative(x, p, one[:-1], along[0], other[:-1], along[1])

    def factors(self, big_x: Array, p: Array) -> Kernel:
        """M factorised at rest, with the kernel."""
        return self._kernel(big_x, p)

    def gradient(self, kernel: Kernel, big_x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """g_i' (d,) along (dx, dp), dp being complete."""
        x, p = self.state(big_x), self.parameters(big_x, p)
        out = np.empty(len(kernel.vectors))
        for i, vector in enumerate(kernel.vectors):
            along = self._direction(0.0 if self.is_fold else vector[-1], p)
            curvature = self.base.second_derivative(x, p, vector[: len(x)], along, dx, dp)
            out[i] = -kernel.project(curvature)
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
        kernel = self._kernel(x, p)
        change = self.base.derivative(state, full, inner, along)
        if not self.is_fold:
            change = change + dx[-1] * self._unfolding(state, full)
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
        return replace(self, kernel=self._basis(self.factors(x, p).vectors, x))

    def _basis(self, vectors: Array, x: Array) -> Array:
        """An orthonormal basis of the span of vectors, oriented as they are."""
        weights = self.weights(x)[: vectors.shape[1]]
        basis: list[Array] = []
        for vector in vectors[::-1]:
            rest = vector - sum(((weights @ (vector * known)) * known for known in basis), np.zeros_like(vector))
            basis.append(rest / np.sqrt(weights @ rest**2))
        return np.stack(basis[::-1])

    def renewed(self, x: Array, p: Array) -> "SingularProblem":
        """With the kernel and the column found at X.

        psi F_p is normal to the curve of folds; here with parameters relative to their values (or one).
        """
        kernel = self.factors(x, p)
        if kernel.linearisation.is_singular:
            return self
        basis = self._basis(kernel.vectors, x)
        state, full = self.state(x), self.parameters(x, p)
        if self.is_fold:
            still = np.zeros_like(state)
            normal = np.array(
                [kernel.project(self.base.derivative(state, full, still, unit)) for unit in np.eye(len(p))]
            )
            across = normal * np.maximum(np.abs(full), 1.0) ** 2
            return replace(self, kernel=basis, across=across / np.sqrt(across @ normal))
        form = np.array(
            [[-kernel.project(self._curvature(state, full, one, other)) for one in basis] for other in basis]
        )
        return replace(self, kernel=basis, across=form / np.linalg.norm(form))

    def form(self, x: Array, p: Array) -> Array:
        """The quadratic form g_i'(v_j) (d, d) of the bifurcation equation in the basis `kernel`."""
        return self.form_of(self.factors(x, p), x, p)

    def form_of(self, kernel: Kernel, x: Array, p: Array) -> Array:
        """The form (d, d) in the basis of a kernel."""
        n = len(self.state(x))
        rows = []
        for vector in kernel.vectors:
            dp = self._direction(0.0 if self.is_fold else vector[-1], p)
            rows.append(self.gradient(kernel, x, p, vector[:n], dp))
        return np.stack(rows, axis=1)

    def mass_form(self, x: Array, p: Array) -> float:
        """psi B v/(psi b) of a fold."""
        kernel = self.factors(x, p)
        return kernel.project(self.base.actions(self.state(x), self.parameters(x, p)).mass(kernel.vectors[0]))

    def adapted(self, x: Array) -> "SingularProblem":
        """On the discretisation that the base asks for at the state, with the kernel carried there."""
        better = self.base.adapted(self.state(x))
        assert isinstance(better, AbstractSmoothProblem)
        return self if better is self.base else self._on(better)

    def refined(self) -> "SingularProblem | None":
        """On a discretisation about twice as fine; None where there is none."""
        finer = self.base.refined()
        return None if finer is None else self._on(finer)

    def _on(self, base: AbstractSmoothProblem) -> "SingularProblem":
        """On another discretisation, with the kernel carried there."""
        n = self.kernel.shape[1] - (0 if self.is_fold else 1)
        return replace(
            self, base=base, kernel=np.stack([np.append(self.base.carried(v[:n], base), v[n:]) for v in self.kernel])
        )

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """The state carried, the scalars kept."""
        assert isinstance(other, SingularProblem)
        if other.base is self.base:
            return x
        n = len(self.state(x))
        return np.concatenate([self.base.carried(x[:n], other.base), x[n:]])


@dataclass(frozen=True)
class SingularLinearisation(AbstractLinearisation):
    """The Jacobian of a SingularProblem: every solution is a particular part plus kernel vectors and border columns.

    columns (2 + m, n + 2): increments (dx, dlambda, dsigma) by kernel vectors (of a fold also by the parameter) and by border
    columns; matrix (2 + m, 2 + m): how these change g (of a fold also sigma, which stays 0) and meet the border's rows.
    """

    problem: SingularProblem
    kernel: Kernel
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
        size, d = len(self.x), len(self.kernel.vectors)
        n = size - d
        particular = self.kernel.increment(residual[:n])
        known = _conditions(self.problem, self.kernel, self.x, self.p, self.border, particular)
        wanted = np.concatenate([residual[n:size], np.zeros(2 - d), residual[size:]])
        amounts = np.linalg.solve(self.matrix, wanted - known)
        return np.concatenate([(particular + amounts @ self.columns)[:size], amounts[2:]])


def make_singular_linearisation(
    problem: SingularProblem, kernel: Kernel, x: Array, p: Array, border: Border | None
) -> SingularLinearisation:
    """Prepare the small matrix of a SingularLinearisation."""
    size, d = len(x), len(kernel.vectors)
    if border is None:
        border = Border(np.zeros((0, size)), np.zeros((0, size)), np.zeros((0, 0)))
    n = size - d
    if problem.is_fold:
        by_parameter = kernel.increment(-kernel.slope)
        by_parameter[n] = 1.0
        columns = [np.concatenate([kernel.vectors[0], [0.0], kernel.g]), by_parameter]
    else:
        columns = [np.append(v, g) for v, g in zip(kernel.vectors, kernel.g, strict=True)]
    columns += [kernel.increment(-column[:n]) for column in border.columns]
    matrix = np.stack([_conditions(problem, kernel, x, p, border, column) for column in columns], axis=1)
    matrix[:d, 2:] += border.columns[:, n:].T
    matrix[2:, 2:] += border.corner
    return SingularLinearisation(problem, kernel, x, p, border, np.stack(columns), matrix)


def _conditions(
    problem: SingularProblem, kernel: Kernel, x: Array, p: Array, border: Border, increment: Array
) -> Array:
    """(g', of a fold sigma, border rows) along (dx, dlambda, dsigma)."""
    dp = np.zeros_like(p)
    dp[problem.index] = increment[-2]
    g = problem.gradient(kernel, x, p, increment[:-2], dp)
    return np.concatenate([g, increment[-1:] if problem.is_fold else [], border.rows @ increment[: len(x)]])


def probe(size: int, number: int = 0) -> Array:
    """A fixed vector (size,) that no left null vector is likely to be orthogonal to."""
    return np.random.default_rng([size, number]).standard_normal(size)


def _parameter_weight(value: float) -> float:
    return float(1.0 / max(abs(value), 1.0) ** 2)


def _unit(size: int, at: int) -> Array:
    out = np.zeros(size)
    out[at] = 1.0
    return out
