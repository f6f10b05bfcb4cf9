"""Linear laws between fluxes and forces: reciprocity, the second law, and the flip that makes every coupling dissipative.

Pairs of a flux J_i and a force X_i make the entropy production sum_i J_i X_i; near equilibrium J = L X. Of a pair one is even
under time reversal, the other odd. With e_i the signature of X_i, reciprocity demands L_ij = e_i e_j L_ji: forces of one
signature couple dissipatively, forces of opposite signature reactively. A reactive coupling drops out of the entropy
production, which therefore cannot be varied to recover the laws (paper Sec. IV D). Solved for the even forces the same laws
have odd forces only,

    J_1 = A X_1 + B X_2,  J_2 = -B^T X_1 + D X_2   becomes   J_1 = (A + B D^-1 B^T) X_1 + B D^-1 J_2,  X_2 = D^-1 (B^T X_1 + J_2),

whose matrix is symmetric: half the entropy production is a Rayleigh function, its gradient gives the laws back.
"""

from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced

TOLERANCE = 1e-12
"""Of coefficients, relative to the largest possible: what round-off makes of equal ones."""


class Pair(NamedTuple):
    """A flux and its force; signature: +1 where the force is even under time reversal, -1 where it is odd (a rate)."""

    flux: str
    force: str
    signature: int


@dataclass(frozen=True, eq=False)
class LinearLaws:
    """J = L X. coefficients: L (n, n), [flux unit/force unit]; numbers, or traced inside a differentiated function."""

    pairs: tuple[Pair, ...]
    coefficients: Traced | Array

    def check(self) -> None:
        """ValueError unless the numbers obey reciprocity and the second law, naming coefficient, partner and what is allowed."""
        n, e = len(self.pairs), [pair.signature for pair in self.pairs]
        if np.shape(self.coefficients) != (n, n):
            raise ValueError(f"coefficients: must be {n} by {n} for {n} pairs, came as {np.shape(self.coefficients)}.")
        for pair in self.pairs:
            if pair.signature not in (1, -1):
                raise ValueError(f"signature of {pair.force}: must be 1 (even) or -1 (odd), came as {pair.signature}.")
        matrix = np.asarray(self.coefficients, dtype=float)
        if not np.isfinite(matrix).all():
            raise ValueError(f"coefficients: must be finite, came as {matrix.tolist()}.")
        for i in range(n):
            for j in range(i):
                self._check_reciprocity(matrix, i, j, e[i] * e[j])
        self._check_second_law(0.5 * (matrix + matrix.T))

    def _name(self, i: int, j: int) -> str:
        return f"the coefficient of {self.pairs[j].force} in {self.pairs[i].flux}"

    def _check_reciprocity(self, matrix: Array, i: int, j: int, sign: int) -> None:
        wanted = sign * matrix[j, i]
        if abs(matrix[i, j] - wanted) <= TOLERANCE * (abs(matrix[i, j]) + abs(wanted)):
            return
        kind = (
            "one signature, dissipative and symmetric"
            if sign > 0
            else "opposite signatures, reactive and antisymmetric"
        )
        raise ValueError(
            f"{self._name(i, j)} is {matrix[i, j]:g}: its partner, {self._name(j, i)}, is {matrix[j, i]:g}. The "
            f"coupling is of forces of {kind} under time reversal (Onsager), so that it must be {wanted:g}."
        )

    def _check_second_law(self, symmetric: Array) -> None:
        """The symmetric part is positive semi-definite: of one force, of every two, of all together."""
        n = len(self.pairs)
        for i in range(n):
            if symmetric[i, i] < 0.0:
                raise ValueError(f"{self._name(i, i)} is {symmetric[i, i]:g}: it destroys entropy; it must be >= 0.")
        for i in range(n):
            for j in range(i):
                largest = float(np.sqrt(symmetric[i, i] * symmetric[j, j]))
                if abs(symmetric[i, j]) > largest * (1.0 + TOLERANCE):
                    raise ValueError(
                        f"{self._name(i, j)} and its partner, {self._name(j, i)}, are {symmetric[i, j]:g}: together with "
                        f"{symmetric[i, i]:g} and {symmetric[j, j]:g} on the diagonal they destroy entropy; they must lie "
                        f"within -{largest:g} and {largest:g}."
                    )
        # In units in which the diagonal is one the sizes of coefficients of different units can be compared.
        size = np.sqrt(np.where(np.diag(symmetric) > 0.0, np.diag(symmetric), 1.0))
        values, vectors = np.linalg.eigh(symmetric / np.outer(size, size))
        if values[0] < -n * TOLERANCE:
            i, j = np.argsort(-np.abs(vectors[:, 0]))[:2]
            raise ValueError(
                f"{self._name(i, j)} and its partner, {self._name(j, i)}, are {symmetric[i, j]:g}: every two forces are "
                "allowed, but all together destroy entropy; they must be nearer to 0."
            )

    def fluxes(self, forces: Traced | Array) -> Traced:
        """J (n,)."""
        return jnp.asarray(self.coefficients) @ jnp.asarray(forces)

    def entropy_production(self, forces: Traced | Array) -> Traced:
        """J . X, temperature times the entropy that is produced; reactive coefficients drop out."""
        return self.fluxes(forces) @ jnp.asarray(forces)

    def flipped(self, *forces: str) -> "LinearLaws":
        """The same laws with flux and force of some pairs exchanged, by the names of their forces; its own inverse.

        ValueError for an unknown force. The coefficients of the flipped forces among their own fluxes must be invertible.
        """
        names = [pair.force for pair in self.pairs]
        for name in forces:
            if name not in names:
                raise ValueError(f"{name}: is no force of these laws; it is one of {', '.join(names)}.")
        is_flipped = np.array([name in forces for name in names])
        matrix, one = jnp.asarray(self.coefficients), jnp.eye(len(names))
        # With X in terms of the new forces, X = S Y, the new fluxes are T Y: rows of S or of L S.
        old = jnp.where(is_flipped[:, None], matrix, one)
        back = jnp.linalg.inv(old)
        kept = jnp.where(is_flipped[:, None], one, matrix)
        pairs = (
            Pair(pair.force, pair.flux, -pair.signature) if flip else pair
            for pair, flip in zip(self.pairs, is_flipped, strict=True)
        )
        return LinearLaws(tuple(pairs), kept @ back)

    def dissipative(self) -> "LinearLaws":
        """The same laws with odd forces only, whose couplings are all dissipative (Eqs. CR1, CR2)."""
        return self.flipped(*(pair.force for pair in self.pairs if pair.signature > 0))

    def rayleigh(self, forces: Traced | Array) -> Traced:
        """Half the entropy production as a function of odd forces: its gradient is the fluxes (Eq. disspart)."""
        if any(pair.signature > 0 for pair in self.pairs):
            raise ValueError("a Rayleigh function has odd forces only; take that of dissipative().")
        return 0.5 * self.entropy_production(forces)


def reaction_laws(coupling: Traced | float, mobility: Traced | float, viscosity: Traced | float = 0.0) -> LinearLaws:
    """tension = eta_b div v + xi Delta mu, r_p = -xi div v + Lambda Delta mu (Eqs. stressd, constrp)."""
    rows = [[viscosity, coupling], [-coupling, mobility]]
    return LinearLaws(REACTION, jnp.stack([jnp.stack([jnp.asarray(one, dtype=float) for one in row]) for row in rows]))


REACTION = (Pair("tension", "dilation", -1), Pair("reaction_rate", "potential", 1))
"""The flux-force pairs of an isotropic active surface."""
