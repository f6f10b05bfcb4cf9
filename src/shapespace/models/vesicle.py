"""The vesicle: a closed membrane of fixed total area around a fixed volume, at rest by bending alone (Helfrich 1973)."""

from typing import Any

from shapespace.models.closed_surface import ENDS
from shapespace.models.recipe import Recipe
from shapespace.physics.bending import HelfrichBending
from shapespace.physics.friction import NormalFriction, TangentialFriction
from shapespace.physics.patch import Uniform
from shapespace.physics.term import AbstractTerm
from shapespace.physics.viscosity import BulkViscosity, ShearViscosity

PARAMETERS = (
    "bending_rigidity",
    "spontaneous_curvature",
    "shear_viscosity",
    "bulk_viscosity",
    "friction",
    "normal_friction",
    "rotation_rate",
    "surface_area",
    "enclosed_volume",
)


def terms(p: Any) -> tuple[AbstractTerm, ...]:
    """Bending, and what dissipates on the way to rest."""
    return (
        HelfrichBending(p.bending_rigidity, Uniform(p.spontaneous_curvature)),
        ShearViscosity(p.shear_viscosity),
        BulkViscosity(p.bulk_viscosity),
        TangentialFriction(p.friction, p.rotation_rate),
        NormalFriction(p.normal_friction),
    )


RECIPE = Recipe(
    PARAMETERS,
    terms,
    {name: pair for name, pair in ENDS.items() if name != "species"},
    fixed_volume=True,
    fixed_area=True,
    comoving=True,
)
"""A surface from pole to pole with enclosed volume and total area, in a frame that moves along."""
