"""What a surface is made of, before its unknowns are chosen: parameters, terms, species, ends and what is held."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from shapespace.physics.laws import Law
from shapespace.physics.storage import AbstractStorage
from shapespace.physics.term import AbstractTerm
from shapespace.variational.ends import Ends, Pinned
from shapespace.variational.surface import SpeciesFactory, SurfaceSystem, TermFactory, make_surface_system


@dataclass(frozen=True, eq=False)
class Recipe:
    """The choices of a model. `ends`: without those of v_phi, which is pinned at both where nothing else is said.

    species_count: 2 where `species` gives two laws. storages: laws of what is held elastically, of p or sigma. turning: for
    terms that resist bending, whose viscosity must be > 0. laws: those of users among the terms, which every
    scenario's values must admit.
    """

    parameters: tuple[str, ...]
    terms: TermFactory
    ends: Ends
    species: SpeciesFactory | None = None
    species_count: int = 1
    storages: Mapping[str, Callable[[Any], AbstractStorage]] | None = None
    turning: bool = False
    incompressible: bool = False
    fixed_volume: bool = False
    fixed_area: bool = False
    comoving: bool = False
    material_area: bool = False
    laws: tuple[Law, ...] = ()

    def system(self, azimuthal: bool = False, parameterization: str = "sle") -> SurfaceSystem:
        """The surface, with or without azimuthal flow as an unknown."""
        swirl = {"v_phi": self.ends.get("v_phi", (Pinned(), Pinned()))} if azimuthal else {}
        ends = {name: pair for name, pair in self.ends.items() if name != "v_phi"}
        return make_surface_system(
            self.parameters,
            self.terms,
            {**ends, **swirl},
            species=self.species,
            species_count=self.species_count,
            storages=self.storages,
            turning=self.turning,
            parameterization=parameterization,
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
        species: SpeciesFactory | None = None,
        laws: tuple[Law, ...] = (),
        **choices: Any,
    ) -> "Recipe":
        """With more parameters and terms, without the terms of some classes, with other ends or another species law.

        choices: other values of incompressible, fixed_volume, storages, ...
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
            **choices,
        )
