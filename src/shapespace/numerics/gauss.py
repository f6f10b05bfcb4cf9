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
        return np.asarray(_legendre(2.0 * np.atleast_1d(x) - 1.0, self.degree - 1) @ _series(self.degree))

    def basis_integral(self, x: Array) -> Array:
        """Integrals from 0 to x (m,) of the Lagrange polynomials; shape (m, k)."""
        return np.asarray(_legendre(2.0 * np.atleast_1d(x) - 1.0, self.degree) @ _integral_series(self.degree))

    def interpolation_constant(self) -> float:
        """max over x of |prod_l (x - x_l) integrated|: the factor of w^(k+1) y^(k+1) in the interpolation error."""
        return _interpolation_constant(self.degree)

    def highest_derivative(self) -> Array:
        """Weights (k,) of values at the points in the (k-1)-th derivative of their interpolant."""
        return _highest_derivative(self.degree)


def _legendre(x: Array, degree: int) -> Array:
    """P_0 .. P_degree at x (m,), (m, degree + 1): for few points ten times as fast as numpy's legvander."""
    values = np.ones((degree + 1, len(x)))
    values[1] = x
    for j in range(2, degree + 1):
        values[j] = ((2 * j - 1) * x * values[j - 1] - (j - 1) * values[j - 2]) / j
    return values.T


@cache
def _series(degree: int) -> Array:
    """Legendre coefficients (k, k) of the Lagrange polynomials, one in a column, by their discrete orthogonality:

    l_m(x) = sum_j (2 j + 1)/2 w_m P_j(x_m) P_j(x) on [-1, 1].
    """
    nodes, weights = legendre.leggauss(degree)
    norms = np.arange(degree) + 0.5
    return np.asarray(norms[:, None] * (_legendre(nodes, degree - 1) * weights[:, None]).T)


@cache
def _integral_series(degree: int) -> Array:
    """Legendre coefficients (k + 1, k) of their integrals over [0, x], half those over [-1, 2 x - 1]."""
    return np.asarray(legendre.legint(_series(degree), lbnd=-1.0, scl=0.5, axis=0))


@cache
def _interpolation_constant(degree: int) -> float:
    x = np.linspace(0.0, 1.0, 201)
    nodal = np.prod(x[:, None] - gauss_rule(degree).points, axis=1)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (nodal[1:] + nodal[:-1])) * (x[1] - x[0])])
    return float(np.abs(integral).max() / np.prod(np.arange(1.0, degree + 1)))


@cache
def _highest_derivative(degree: int) -> Array:
    """(k-1)! / prod_(m != l) (x_l - x_m)."""
    points = gauss_rule(degree).points
    difference = points[:, None] - points[None, :] + np.eye(degree)
    return np.asarray(np.prod(np.arange(1.0, degree)) / difference.prod(axis=1))


@cache
def gauss_rule(degree: int) -> GaussRule:
    """The rule with `degree` points (2 to 8)."""
    if not 2 <= degree <= 8:
        raise ValueError(f"degree must lie in 2..8; got {degree}.")
    nodes, weights = legendre.leggauss(degree)
    points = 0.5 * (nodes + 1.0)
    matrix = _legendre(nodes, degree) @ _integral_series(degree)
    return GaussRule(degree, points, 0.5 * weights, np.asarray(matrix))
