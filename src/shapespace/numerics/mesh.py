"""Meshes of [0, 1] that follow the solution: equidistribution of a monitor with floors (de Boor's algorithm)."""

import numpy as np

from shapespace.base.arrays import Array

SIZES = (20, 40, 60, 80, 120, 160, 240, 320)
"""The element counts in use: few and fixed, so that compiled functions are met again."""


def uniform_mesh(elements: int) -> Array:
    """Nodes (N + 1,) of N equal elements."""
    return np.linspace(0.0, 1.0, elements + 1)


def next_size(elements: int) -> int:
    """At least twice as many elements, as each size met on the way costs a compilation; the largest stays."""
    return next((size for size in SIZES if size >= 2 * elements), SIZES[-1])


def equidistribute(mesh: Array, density: Array, elements: int, floor: float = 0.2, smoothing: int = 2) -> Array:
    """A mesh of `elements` elements on each of which the integral of the monitor is the same.

    density (N,): the monitor's value on each element of `mesh` (N + 1,), any positive scale. floor: the share of
    elements spread evenly over u, which bounds the largest element by 1/(floor N) and keeps the poles resolved.
    smoothing: passes of local averaging, so that neighbouring elements differ by a bounded factor.
    """
    widths = np.diff(mesh)
    total = float(density @ widths)
    relative = density / total if total > 0.0 else np.ones_like(density)
    for _ in range(smoothing):
        padded = np.concatenate([relative[:1], relative, relative[-1:]])
        relative = np.maximum(relative, 0.25 * (padded[:-2] + 2.0 * padded[1:-1] + padded[2:]))
    relative = (1.0 - floor) * relative / float(relative @ widths) + floor
    cumulative = np.concatenate([[0.0], np.cumsum(relative * widths)])
    nodes = np.interp(np.linspace(0.0, cumulative[-1], elements + 1), cumulative, mesh)
    nodes[0], nodes[-1] = 0.0, 1.0
    return nodes


def symmetrise(mesh: Array) -> Array:
    """The mean of a mesh and its reflection u -> 1 - u, exactly symmetric."""
    mean = 0.5 * (mesh - mesh[::-1])
    half = 0.5 + mean
    half[0], half[-1] = 0.0, 1.0
    return half
