"""Local geometry of an axisymmetric surface X(u, phi) = (r cos phi, r sin phi, z).

Conventions (paper Sec. II C, App. A): r' = h cos(psi), z' = -h sin(psi), tangent e_u = (cos psi, -sin psi) and outward
normal n = (sin psi, cos psi) in the (r, z) plane; u = 0 is the upper pole or the apex. Both principal curvatures are
positive on a sphere. Primes are d/du; h is the length of the meridian, the same at all u.
"""

from typing import NamedTuple

import jax.numpy as jnp

from shapespace.base.arrays import Traced


class Geometry(NamedTuple):
    """Shape at one value of u. r, h [length]; psi, dpsi = psi' [1]; area = cumulative area per 2 pi [length^2]."""

    r: Traced
    psi: Traced
    dpsi: Traced
    h: Traced
    area: Traced


def meridional_curvature(g: Geometry) -> Traced:
    """C_u^u = psi'/h [1/length] (App. A)."""
    return g.dpsi / g.h


def azimuthal_curvature(g: Geometry) -> Traced:
    """C_phi^phi = sin(psi)/r [1/length]; tends to psi'/h at a pole, where collocation never evaluates it (App. A)."""
    return jnp.sin(g.psi) / g.r


def total_curvature(g: Geometry) -> Traced:
    """2H, the sum of the principal curvatures [1/length]; 2/R on a sphere."""
    return meridional_curvature(g) + azimuthal_curvature(g)


def area_element(g: Geometry) -> Traced:
    """Area per du and per 2 pi: r h [length^2]."""
    return g.r * g.h


def volume_element(g: Geometry) -> Traced:
    """Enclosed volume per du: pi r^2 h sin(psi) [length^3] (paper Sec. IV E)."""
    return jnp.pi * g.r**2 * g.h * jnp.sin(g.psi)


def tangent_slopes(g: Geometry) -> tuple[Traced, Traced]:
    """(r', z') = (h cos psi, -h sin psi) (Eqs. dur, duz; App. E has a sign slip)."""
    return g.h * jnp.cos(g.psi), -g.h * jnp.sin(g.psi)
