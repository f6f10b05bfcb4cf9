"""The closed active fluid surface of paper Sec. V B: a regulator species drives an isotropic active tension."""

from typing import Any

from jax.numpy import pi

from shapespace.models.recipe import Recipe
from shapespace.physics.activity import ActiveTension
from shapespace.physics.bending import HelfrichBending
from shapespace.physics.friction import TangentialFriction
from shapespace.physics.patch import Uniform
from shapespace.physics.species import Ring, Species
from shapespace.physics.tension import IsotropicTension
from shapespace.physics.term import AbstractTerm
from shapespace.physics.viscosity import BulkViscosity, ShearViscosity
from shapespace.variational.ends import Ends, Free, Pinned

PARAMETERS = (
    "bending_rigidity",
    "spontaneous_curvature",
    "shear_viscosity",
    "bulk_viscosity",
    "friction",
    "rotation_rate",
    "tension",
    "active_tension",
    "saturation_concentration",
    "diffusivity",
    "turnover_rate",
    "reference_concentration",
    "ring_amplitude",
    "ring_width",
    "enclosed_volume",
)

ENDS: Ends = {
    "r": (Pinned(), Pinned()),
    "z": (Free(), Free()),
    "psi": (Pinned(), Pinned(lambda p: pi)),
    "v": (Pinned(), Pinned()),
    "species": (Free(), Free()),
}


def terms(p: Any) -> tuple[AbstractTerm, ...]:
    """The Rayleigh functional of the closed active surface (Eqs. stressd, fkappa, fext, stresssc)."""
    return (
        HelfrichBending(p.bending_rigidity, Uniform(p.spontaneous_curvature)),
        IsotropicTension(p.tension),
        ActiveTension(p.active_tension, p.saturation_concentration),
        ShearViscosity(p.shear_viscosity),
        BulkViscosity(p.bulk_viscosity),
        TangentialFriction(p.friction, p.rotation_rate),
    )


def species(p: Any) -> Species:
    """The stress regulator (Eqs. cdt, c0dyn)."""
    return Species(p.diffusivity, p.turnover_rate, Ring(p.reference_concentration, p.ring_amplitude, p.ring_width))


RECIPE = Recipe(PARAMETERS, terms, ENDS, species=species, fixed_volume=True, comoving=True)
"""A surface from pole to pole with enclosed volume, in the frame that swims along."""
