"""Error estimate of a collocation solution, and the mesh that it asks for."""

import numpy as np

from shapespace.base.arrays import Array
from shapespace.numerics.mesh import SIZES, equidistribute, next_size, symmetrise
from shapespace.numerics.state import State

UNBALANCED = 3.0
"""A mesh that meets the tolerance is kept until its largest element load exceeds the mean by this factor."""
WORTHWHILE = 0.8
"""Moving a balanced mesh near the tolerance must lower the largest load at least this much: moves cost interpolations."""
WORTHWHILE_FAR = 0.95
"""The same far from the tolerance, where any gain counts but that of a mesh which has settled."""


def highest_derivative(state: State) -> Array:
    """Estimates (N,) of max over fields of |y^(k+1)| / max(max|y|, 1) on each element.

    On an element y has degree k, so y^(k) is constant there; its jumps to the neighbours over the distance of their
    centres estimate y^(k+1), as in COLSYS and AUTO.
    """
    widths, k = state.widths, state.rule.degree
    top = np.einsum("l,eln->en", state.rule.highest_derivative(), state.slopes) / widths[:, None] ** (k - 1)
    distance = 0.5 * (widths[1:] + widths[:-1])
    jumps = np.abs(np.diff(top, axis=0)) / distance[:, None]
    padded = np.concatenate([jumps[:1], jumps, jumps[-1:]])
    scale = np.maximum(np.abs(state.nodes).max(axis=0), 1.0)
    return np.asarray((np.maximum(padded[:-1], padded[1:]) / scale).max(axis=1))


def element_errors(state: State) -> Array:
    """Estimated largest error (N,) on each element, relative to each field's largest value (or one)."""
    k = state.rule.degree
    return state.rule.interpolation_constant() * state.widths ** (k + 1) * highest_derivative(state)


def discretisation_error(state: State) -> float:
    """Estimated largest relative error of any field; element ends are far more accurate (order 2k)."""
    return float(element_errors(state).max())


def adapted_mesh(state: State, tolerance: float) -> Array:
    """The mesh to go on with: the same object where it is good enough, else moved, else moved and refined."""
    k, mesh = state.rule.degree, state.mesh
    density = highest_derivative(state) ** (1.0 / (k + 1)) + 1e-30
    load = density * state.widths
    constant = state.rule.interpolation_constant()
    allowed = (tolerance / constant) ** (1.0 / (k + 1))
    if load.max() <= allowed and load.max() <= UNBALANCED * load.mean():
        return mesh
    elements = len(mesh) - 1
    moved = equidistribute(mesh, density, elements)
    while _largest_load(mesh, density, moved) > allowed and elements < SIZES[-1]:
        elements = next_size(elements)
        moved = equidistribute(mesh, density, elements)
    balanced = load.max() <= UNBALANCED * load.mean()
    worthwhile = WORTHWHILE if WORTHWHILE * load.max() <= allowed else WORTHWHILE_FAR
    if elements == len(mesh) - 1 and balanced and _largest_load(mesh, density, moved) > worthwhile * load.max():
        return mesh
    return symmetrise(moved) if np.allclose(moved, 1.0 - moved[::-1], atol=1e-6) else moved


def _largest_load(mesh: Array, density: Array, moved: Array) -> float:
    """Largest monitor value times width on the elements of `moved`, the monitor being constant on those of `mesh`."""
    first = np.searchsorted(mesh, moved[:-1], side="right") - 1
    last = np.maximum(np.searchsorted(mesh, moved[1:], side="left"), first + 1)
    # reduceat wants every index within the array, and returns the stretches from `last` to the next `first` as well.
    peaks = np.maximum.reduceat(np.append(density, 0.0), np.stack([first, last], axis=1).ravel())[::2]
    return float((peaks * np.diff(moved)).max())
