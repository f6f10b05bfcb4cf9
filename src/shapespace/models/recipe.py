"""What a surface is made of, before its unknowns are chosen: parameters, terms, species, ends and what is held."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from shapespace.physics.laws import Law
from shapespace.physics.species import Species
from shapespace.physics.term import AbstractTerm
from shapespace.variational.ends import Ends, Pinned
from shapespace.variational.surface import SurfaceSystem, TermFactory, make_surface_system


@dataclass(frozen=True, eq=False)
class Recipe:
    """The choices of a model. `ends`: without those of v_phi, which is pinned at both where nothing else is said.

    laws: those of users among the terms, which every scenario's values must admit.
    """

    parameters: tuple[str, ...]
    terms: TermFactory
    ends: Ends
    species: Callable[[Any], Species] | None = None
    incompressible: bool = False
    fixed_volume: bool = False
    fixed_area: bool = False
    comoving: bool = False
    material_area: bool = False
    laws: tuple[Law, ...] = ()

    def system(self, azimuthal: bool = False) -> SurfaceSystem:
        """The surface, with or without azimuthal flow as an unknown."""
        swirl = {"v_phi": self.ends.get("v_phi", (Pinned(), Pinned()))} if azimuthal else {}
        ends = {name: pair for name, pair in self.ends.items() if name != "v_phi"}
        return make_surface_system(
            self.parameters,
            self.terms,
            {**ends, **swirl},
            species=self.species,
            incompressible=self.incompressible,
            fixed_volume=self.fixed_volume,
            fixed_area=self.fixed_area,
            comoving=self.comoving,
            azimuthal=azimuthal,
            material_area=self.material_area,
        )

    def extended(
        self,
        parameters: tuple[str, ...],
        terms: Callable[[Any], tuple[AbstractTerm, ...]],
        without: tuple[str, ...] = (),
        ends: Ends | None = None,
        species: Callable[[Any], Species] | None = None,
        laws: tuple[Law, ...] = (),
        **held: bool,
    ) -> "Recipe":
        """With more parameters and terms, without the terms of some classes, with other ends or another species law.

        held: other values of incompressible, fixed_volume, fixed_area, ...
        """
        base = self.terms

        def all_terms(p: Any) -> tuple[AbstractTerm, ...]:
            return (*(term for term in base(p) if type(term).__name__ not in without), *terms(p))

        return replace(
            self,
            parameters=(*self.parameters, *parameters),
            terms=all_terms,
            ends={**self.ends, **(ends or {})},
            species=species or self.species,
            laws=laws,
            **held,
        )
