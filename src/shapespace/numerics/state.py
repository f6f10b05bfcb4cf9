"""A collocation solution as a value: mesh, coefficients, evaluation anywhere, transfer between meshes."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapespace.base.arrays import Array
from shapespace.numerics.gauss import GaussRule, gauss_rule
from shapespace.numerics.system import Symmetry

MESH_ROUND_OFF = 1e-15
"""Meshes on [0, 1] that differ by no more are the same."""


def _located(mesh: Array, u: Array) -> tuple[NDArray[np.intp], Array]:
    """The elements of u (m,), and its place in each from 0 to 1."""
    element = np.searchsorted(mesh[1:-1], u, side="right")
    return element, (u - mesh[element]) / (mesh[element + 1] - mesh[element])


class Places(NamedTuple):
    """Points u (m,) of a mesh made ready for many states: their elements (m,), and weights (m, k) of the slopes there."""

    u: Array
    element: NDArray[np.intp]
    weights: Array

    @classmethod
    def on(cls, mesh: Array, rule: GaussRule, u: Array) -> "Places":
        """Points u (m,) of a mesh (N + 1,)."""
        element, x = _located(mesh, u)
        return cls(u, element, rule.basis_integral(x) * (mesh[element + 1] - mesh[element])[:, None])


@dataclass(frozen=True)
class State:
    """Piecewise polynomials on `mesh` (N + 1,). nodes (N + 1, n), slopes (N, k, n), algebraic (N, k, n_a), scalars (n_s,)."""

    mesh: Array
    nodes: Array
    slopes: Array
    algebraic: Array
    scalars: Array

    @property
    def rule(self) -> GaussRule:
        """The Gauss rule of the elements."""
        return gauss_rule(self.slopes.shape[1])

    @cached_property
    def widths(self) -> Array:
        """Element widths (N,)."""
        return np.diff(self.mesh)

    @property
    def stage_points(self) -> Array:
        """u at the Gauss points, (N, k)."""
        return self.mesh[:-1, None] + self.widths[:, None] * self.rule.points

    def stage_values(self) -> Array:
        """Differential fields at the Gauss points, (N, k, n)."""
        increments = np.einsum("jl,eln->ejn", self.rule.matrix, self.slopes)
        return np.asarray(self.nodes[:-1, None] + self.widths[:, None, None] * increments)

    def _locate(self, u: Array) -> tuple[NDArray[np.intp], Array]:
        return _located(self.mesh, u)

    def place(self, u: float) -> tuple[int, float]:
        """The element of u, and u's place in it from 0 to 1."""
        element, share = self._locate(np.array([u]))
        return int(element[0]), float(share[0])

    def values(self, u: Array) -> Array:
        """Differential fields at u (m,), shape (m, n); error of order k + 1, 2k at element ends."""
        element, x = self._locate(u)
        weights = self.rule.basis_integral(x) * self.widths[element][:, None]
        return np.asarray(self.nodes[element] + np.einsum("ml,mln->mn", weights, self.slopes[element]))

    def field(self, column: int, u: "Array | Places") -> Array:
        """One differential field at u (m,), as `values` has it."""
        at = u if isinstance(u, Places) else Places.on(self.mesh, self.rule, u)
        return np.asarray(
            self.nodes[at.element, column] + (at.weights * self.slopes[at.element, :, column]).sum(axis=1)
        )

    def derivatives(self, u: Array) -> Array:
        """d/du of the differential fields at u (m,), shape (m, n); error of order k."""
        element, x = self._locate(u)
        return np.asarray(np.einsum("ml,mln->mn", self.rule.basis(x), self.slopes[element]))

    def algebraic_values(self, u: Array) -> Array:
        """Algebraic fields at u (m,), shape (m, n_a); error of order k."""
        element, x = self._locate(u)
        return np.asarray(np.einsum("ml,mln->mn", self.rule.basis(x), self.algebraic[element]))

    def on_mesh(self, mesh: Array) -> "State":
        """The same functions represented on another mesh: exact slopes of the old polynomials at the new Gauss points."""
        if mesh.shape == self.mesh.shape and np.array_equal(mesh, self.mesh):
            return self
        widths, k = np.diff(mesh), self.rule.degree
        element, x = self._locate((mesh[:-1, None] + widths[:, None] * self.rule.points).ravel())
        basis, nodes = self.rule.basis(x), self.values(mesh)
        slopes = np.einsum("ml,mln->mn", basis, self.slopes[element]).reshape(len(widths), k, -1)
        algebraic = np.einsum("ml,mln->mn", basis, self.algebraic[element]).reshape(len(widths), k, -1)
        # Slopes sampled from a kinked polynomial miss the increment a little; shift them so that elements stay continuous.
        missing = np.diff(nodes, axis=0) / widths[:, None] - np.einsum("l,eln->en", self.rule.weights, slopes)
        return State(mesh, nodes, slopes + missing[:, None], algebraic, self.scalars.copy())

    def reflected(self, symmetry: Symmetry, increment: bool = False) -> "State":
        """The image of a state (of an increment: without offsets) under a symmetry; on the mirrored mesh if it flips u."""
        factors = np.array(symmetry.factors)
        nodes = factors * self.nodes + (0.0 if increment else np.array(symmetry.offsets))
        slopes, algebraic = factors * self.slopes, np.array(symmetry.algebraic) * self.algebraic
        scalars = np.array(symmetry.scalars) * self.scalars
        if not symmetry.flips:
            return State(self.mesh, nodes, slopes, algebraic, scalars)
        mesh = 1.0 - self.mesh[::-1]
        if np.abs(mesh - self.mesh).max() <= MESH_ROUND_OFF:
            mesh = self.mesh
        return State(mesh, nodes[::-1], -slopes[::-1, ::-1], algebraic[::-1, ::-1], scalars)


def state_from_functions(
    mesh: Array, degree: int, values: Array, slopes: Array, algebraic: Array, scalars: Array
) -> State:
    """A state from nodal values (N + 1, n), slopes (N, k, n) and algebraic fields (N, k, n_a); continuity is restored."""
    rule, widths = gauss_rule(degree), np.diff(mesh)
    missing = np.diff(values, axis=0) / widths[:, None] - np.einsum("l,eln->en", rule.weights, slopes)
    return State(mesh, values, slopes + missing[:, None], algebraic, scalars)
