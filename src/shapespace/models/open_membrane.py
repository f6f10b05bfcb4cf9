"""The open fluid membrane of paper Sec. V A: incompressible Helfrich membrane with a coat and a pulled patch."""

from typing import Any

from jax.numpy import pi

from shapespace.base.arrays import Traced
from shapespace.models.recipe import Recipe
from shapespace.physics.bending import HelfrichBending
from shapespace.physics.force import AxialForce
from shapespace.physics.friction import TangentialFriction
from shapespace.physics.patch import SmoothPatch, patch_integral
from shapespace.physics.term import AbstractTerm
from shapespace.physics.viscosity import ShearViscosity
from shapespace.variational.ends import Ends, Free, Pinned, Traction

PARAMETERS = (
    "bending_rigidity",
    "spontaneous_curvature",
    "coat_area",
    "coat_sharpness",
    "shear_viscosity",
    "friction",
    "rotation_rate",
    "boundary_tension",
    "pulling_force",
    "pulled_area",
    "pulled_sharpness",
    "base_radius",
)

ENDS: Ends = {
    "r": (Pinned(), Pinned(lambda p: p.base_radius)),
    "z": (Free(), Pinned()),
    "psi": (Pinned(), Pinned()),
    "v": (Pinned(), Traction(lambda p: p.boundary_tension)),
}


def terms(p: Any) -> tuple[AbstractTerm, ...]:
    """The Rayleigh functional of the coated, pulled membrane (Eqs. dFdtmembr, scpara, pullforce)."""
    force_density = p.pulling_force / (2.0 * pi * patch_integral(p.pulled_area, p.pulled_sharpness))
    return (
        HelfrichBending(p.bending_rigidity, SmoothPatch(p.spontaneous_curvature, p.coat_area, p.coat_sharpness)),
        ShearViscosity(p.shear_viscosity),
        TangentialFriction(p.friction, p.rotation_rate),
        AxialForce(SmoothPatch(force_density, p.pulled_area, p.pulled_sharpness)),
    )


def local_spontaneous_curvature(p: Any, area: Traced) -> Traced:
    """C0(a), the coat's profile over cumulative area (Eq. scpara)."""
    return SmoothPatch(p.spontaneous_curvature, p.coat_area, p.coat_sharpness)(area)


RECIPE = Recipe(PARAMETERS, terms, ENDS, incompressible=True, material_area=True)
"""A surface from the apex to a clamped rim that draws area from a reservoir at the boundary tension."""
