"""Gauss-Legendre collocation on the unit interval: nodes, weights and the integration matrix of one element."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GaussRule:
    """The k-point Gauss rule on [0, 1] and the polynomial that collocation defines with it.

    On an element of width w starting at u0 the slope is interpolated by degree k-1 through the Gauss points, so

        y(u0 + w x) = y(u0) + w sum_l basis_integral(x)_l slope_l,     y_j = y(u0) + w sum_l matrix_jl slope_l.

    Shapes: points, weights (k,); matrix (k, k). Order 2k at the element ends, k + 1 in between.
    """

    degree: int
    points: Array
    weights: Array
    matrix: Array

    def basis(self, x: Array) -> Array:
        """Values at x (m,) of the k Lagrange polynomials through the Gauss points; shape (m, k)."""
        x = np.atleast_1d(x)[:, None, None]
        difference = self.points[:, None] - self.points[None, :] + np.eye(self.degree)
        factors = np.where(np.eye(self.degree, dtype=bool), 1.0, (x - self.points) / difference)
        return np.asarray(factors.prod(axis=2))

    def basis_integral(self, x: Array) -> Array:
        """Integrals from 0 to x (m,) of the Lagrange polynomials, exact by the same Gauss rule; shape (m, k)."""
        x = np.atleast_1d(np.asarray(x, dtype=float))
        inner = self.basis((x[:, None] * self.points).ravel()).reshape(len(x), self.degree, self.degree)
        return np.asarray(x[:, None] * np.einsum("q,mql->ml", self.weights, inner))

    def interpolation_constant(self) -> float:
        """max over x of |prod_l (x - x_l) integrated|: the factor of w^(k+1) y^(k+1) in the interpolation error."""
        return _interpolation_constant(self.degree)


@cache
def _interpolation_constant(degree: int) -> float:
    x = np.linspace(0.0, 1.0, 201)
    nodal = np.prod(x[:, None] - gauss_rule(degree).points, axis=1)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (nodal[1:] + nodal[:-1])) * (x[1] - x[0])])
    return float(np.abs(integral).max() / np.prod(np.arange(1.0, degree + 1)))


@cache
def gauss_rule(degree: int) -> GaussRule:
    """The rule with `degree` points (2 to 8)."""
    if not 2 <= degree <= 8:
        raise ValueError(f"degree must lie in 2..8; got {degree}.")
    nodes, weights = legendre.leggauss(degree)
    rule = GaussRule(degree, 0.5 * (nodes + 1.0), 0.5 * weights, np.zeros((degree, degree)))
    return GaussRule(degree, rule.points, rule.weights, rule.basis_integral(rule.points))
