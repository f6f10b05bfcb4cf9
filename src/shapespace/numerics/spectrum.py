"""Eigenpairs of (J + s B) dx = 0 around a real shift, by Arnoldi iteration on S = (J + shift B)^-1 B.

S dx = theta dx belongs to s = shift - 1/theta, so the eigenvalues next to the shift are the largest of S. B is singular and
not symmetric (constraints and multipliers do not evolve). In Weierstrass form J + s B = diag(s I - A, I + s N), with N
nilpotent, and S = diag((shift I - A)^-1, (I + shift N)^-1 N): infinite eigenvalues are the nilpotent part of S, and
S^index annihilates it. The index is 1 where unknowns without rate follow from those with, and 2 where they are the
multipliers of constraints on those with (a saddle point); rates come in from dissipation, which is definite on what the
constraints leave free, so that there is nothing deeper. A start in the range of S^2 thus keeps the Krylov space among the
finite modes. Round-off brings traces of the others back; each application removes them again, and so does the last one,
which every returned mode gets.

The inner product is the problem's (`weights`), so the work and the certainty do not depend on the mesh. Reference: Meerbergen
and Spence, SIAM J. Matrix Anal. Appl. 18 (1997) 667.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapespace.base.arrays import Array
from shapespace.base.problem import AbstractLinearisation, Actions

ComplexArray = NDArray[np.complex128]
CONVERGED = 1e-11
"""Ritz pairs with an estimated relative residual below this are eigenpairs to working accuracy."""
SETTLED = 1e-4
"""Ritz pairs with an estimated relative residual below this are on their way to an eigenvalue nearby."""
BREAKDOWN = 1e-13
"""A new direction that is a smaller part of its image than this is round-off: the space is invariant."""
NOTABLE = 0.1
"""A new direction that is a larger part of its image needs no second orthogonalisation, which is always enough."""
INFINITE = 1e-8
"""Eigenvalues of S smaller than this part of the largest are zero but for round-off: their rates are infinite."""
NOTHING = 1e-9
"""A vector that S shrinks to a smaller part of itself, in units of 1/shift, has no finite mode: what is left is round-off."""
UNSEEN = 1e-4
"""Mean square weight of entries that the problem's inner product leaves out: slopes and fields known at points only."""


class Ritz(NamedTuple):
    """Approximate eigenpairs, nearest to the shift first: rates s (m,), estimated residuals (m,), coefficients (j, m)."""

    rates: ComplexArray
    residuals: Array
    coefficients: ComplexArray

    @property
    def settled(self) -> int:
        """How many rates, counted from the shift outwards, stand for eigenvalues: none lies nearer than the last of them."""
        return int(np.argmin(np.append(self.residuals <= SETTLED, False)))


@dataclass(frozen=True)
class Pencil:
    """J + s B at a stationary state, factorised at s = shift. seen (n,): weights of the problem's inner product there."""

    actions: Actions
    shift: float
    seen: Array

    @cached_property
    def linearisation(self) -> AbstractLinearisation:
        """Factors of J + shift B."""
        return self.actions.factors(self.shift)

    @cached_property
    def weights(self) -> Array:
        """Of the inner product: the problem's, and a little of what that does not see, so that only zero has no size."""
        unseen = self.seen == 0.0
        return np.where(unseen, UNSEEN / max(int(np.count_nonzero(unseen)), 1), self.seen)

    def size(self, mode: Array | ComplexArray) -> float:
        """Norm of an increment."""
        squares = mode.real**2 + mode.imag**2 if np.iscomplexobj(mode) else mode * mode
        return float(np.sqrt(self.weights @ squares))

    def apply(self, dx: Array) -> Array:
        """S dx = (J + shift B)^-1 B dx."""
        return self.linearisation.solve(self.actions.mass(dx))

    def defect(self, rate: complex, mode: ComplexArray) -> ComplexArray:
        """(J + shift B)^-1 (J + rate B) mode: zero for an eigenpair; mode - defect is one inverse iteration further."""
        real, imaginary = np.ascontiguousarray(mode.real), np.ascontiguousarray(mode.imag)

        def parts(dx: Array) -> tuple[Array, Array]:
            if not dx.any():
                return dx, dx
            return self.actions.jacobian(dx), self.actions.mass(dx)

        (j_re, b_re), (j_im, b_im) = parts(real), parts(imaginary)
        first = self.linearisation.solve(j_re + rate.real * b_re - rate.imag * b_im)
        if rate.imag == 0.0 and not imaginary.any():
            return first.astype(np.complex128)
        return first + 1j * self.linearisation.solve(j_im + rate.real * b_im + rate.imag * b_re)


class Krylov:
    """The space spanned by powers of S on a random start, reduced to the unknowns that B acts on: the others follow from them.

    An orthonormal basis (j, r) of vectors scaled to the Euclidean norm, S in it (j + 1, j), and the images (j, n) of S.
    """

    def __init__(self, pencil: Pencil, capacity: int, seed: int) -> None:
        n = len(pencil.seen)
        self.pencil = pencil
        self.dimension = 0
        self.applications = 2
        self._moving = np.flatnonzero(pencil.actions.moving)
        self._roots = np.sqrt(pencil.weights[self._moving])
        self._basis = np.empty((capacity + 1, len(self._moving)))
        self._images = np.empty((capacity, n))
        self._matrix = np.zeros((capacity + 1, capacity))
        # Random, so that no mode is left out: from a start of one parity the others would never appear.
        once = pencil.apply(np.random.default_rng(seed).standard_normal(n))
        reduced = self._roots * pencil.apply(once)[self._moving]
        size, before = np.linalg.norm(reduced), np.linalg.norm(self._roots * once[self._moving])
        self.is_invariant = not abs(pencil.shift) * size > NOTHING * before
        if not self.is_invariant:
            self._basis[0] = reduced / size

    def extend(self, dimension: int) -> None:
        """Apply S until the space has this dimension, or is invariant."""
        whole = np.zeros(self._images.shape[1])
        while self.dimension < min(dimension, self._matrix.shape[1]) and not self.is_invariant:
            j = self.dimension
            whole[self._moving] = self._basis[j] / self._roots
            self._images[j] = image = self.pencil.apply(whole)
            self.applications += 1
            new, basis = self._roots * image[self._moving], self._basis[: j + 1]
            parts = basis @ new
            new -= parts @ basis
            rest = np.sqrt(new @ new)
            size = np.hypot(np.linalg.norm(parts), rest)
            if rest <= NOTABLE * size:
                more = basis @ new
                new -= more @ basis
                parts += more
                rest = np.sqrt(new @ new)
            self._matrix[: j + 1, j] = parts
            self.dimension = j + 1
            if not rest > BREAKDOWN * size:
                self.is_invariant = True
            else:
                self._matrix[j + 1, j] = rest
                np.divide(new, rest, out=self._basis[j + 1])

    def ritz(self) -> Ritz:
        """The approximate eigenpairs that the space holds."""
        j = self.dimension
        theta, coefficients = np.linalg.eig(self._matrix[:j, :j])
        order = np.lexsort((-theta.imag, -np.abs(theta)))
        order = order[np.abs(theta[order]) > INFINITE * np.abs(theta).max(initial=0.0)]
        theta, coefficients = theta[order].astype(complex), coefficients[:, order].astype(complex)
        residuals = self._matrix[j, j - 1] * np.abs(coefficients[-1]) / np.abs(theta)
        return Ritz(self.pencil.shift - 1.0 / theta, residuals, coefficients)

    def conditions(self, ritz: Ritz) -> Array:
        """Condition numbers (j,) of the eigenvalues of S in the space: 1 for orthogonal modes, large near a double rate."""
        right = ritz.coefficients if ritz.coefficients.imag.any() else ritz.coefficients.real
        left = np.linalg.pinv(right, rcond=1e-15)
        return np.linalg.norm(left, axis=1) * np.linalg.norm(right, axis=0)

    def modes(self, coefficients: ComplexArray) -> ComplexArray:
        """Increments (m, n) of coefficients (j, m) in the basis, after one more application of S."""
        images = self._images[: self.dimension]
        modes = (coefficients.real.T @ images).astype(np.complex128)
        if coefficients.imag.any():
            modes.imag = coefficients.imag.T @ images
        return modes
