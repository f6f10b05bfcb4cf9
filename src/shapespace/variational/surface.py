"""The first-order system of an axisymmetric fluid surface, assembled from terms, species, ends and constraints."""

import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, area_element, tangent_slopes, volume_element
from shapespace.geometry.motion import Rates, divergence, normal_velocity, turning_rate
from shapespace.numerics.system import AbstractSystem, Symmetry
from shapespace.physics.force import Pressure
from shapespace.physics.species import Species
from shapespace.physics.storage import AbstractStorage
from shapespace.physics.tension import FixedArea, Incompressibility
from shapespace.physics.term import AbstractTerm, Site
from shapespace.variational.ends import Ends, Free, Pinned, Traction, check_count, check_ends
from shapespace.variational.rayleighian import Multipliers, Variation, variation

TermFactory = Callable[[Any], tuple[AbstractTerm, ...]]
SpeciesFactory = Callable[[Any], Species | tuple[Species, ...]]
SPECIES = ("species", "second_species")

STATE_AND_FLUX = {
    "r": ("r", "alpha"),
    "z": ("z", "beta"),
    "psi": ("psi", "moment"),
    "v": ("v", "meridional_force"),
    "v_phi": ("v_phi", "azimuthal_force"),
    "species": ("c", "species_flux"),
    "second_species": ("c_2", "second_species_flux"),
    "turning": ("turning", "turning_moment"),
}
"""For each rate the field it changes and the flux conjugate to it."""


class Held(NamedTuple):
    """A quantity of the whole surface that is held: the parameter with its value, its element per du, its multiplier's term.

    Where it stores energy (`physics.storage`) the multiplier sets its value instead.
    """

    parameter: str
    element: Callable[[Geometry], Traced]
    term: Callable[[Traced], AbstractTerm] | None


HELD = {
    "p": Held("enclosed_volume", volume_element, Pressure),
    "sigma": Held("surface_area", lambda g: 2.0 * jnp.pi * area_element(g), FixedArea),
    "dilation": Held("surface_area", lambda g: 2.0 * jnp.pi * area_element(g), None),
}
"""By the scalar that is its multiplier. An incompressible surface whose total area is held dilates evenly, at a rate that is
zero but for the error of time steps: without it nothing would say what the area of a surface at rest is."""
ODD = frozenset({"z", "psi", "alpha", "v", "v_phi", "species_flux", "second_species_flux", "turning", "v0"})
"""Fields and scalars that change sign when the surface is turned upside down by half a turn about a horizontal axis: z -> -z and
u -> 1 - u; psi goes to pi - psi. Unlike a mirror that keeps a torque about the normal, which chiral matter has."""


class SurfaceSystem(AbstractSystem):
    """Shape, flow and species of one surface: F = 0 at a point, derived from the Rayleigh density by differentiation.

    Fields y: r, z, psi, moment = P_psi, alpha, beta, v = v_u, meridional_force = P_v = r T_uu, then as chosen v_phi and
    P_phi, c and its flux N, also of a second species, the cumulative area a, and where a term resists bending the rate
    turning and its flux. Algebraic: gamma_H if incompressible. Scalars: h, then p if the volume is fixed, sigma (or dilation) if
    the total area is, and v0 if the frame moves along. z is measured in that frame. Stored: r, z, psi, h and the amounts c r h.
    storages: of what is held elastically, the energy law by its multiplier.

    parameterization (Table 1): "sle", h a scalar; "eulerian" or "lagrangian", h algebraic with dh/dt = psi' v_n, or (v_u)' +
    psi' v_n, plus slip h, where the scalar slip, zero but for errors, keeps r(1) = 0, which both would have on their own.
    """

    fields: tuple[str, ...] = eqx.field(static=True)
    algebraic: tuple[str, ...] = eqx.field(static=True)
    scalars: tuple[str, ...] = eqx.field(static=True)
    parameters: tuple[str, ...] = eqx.field(static=True)
    terms: TermFactory = eqx.field(static=True)
    species: SpeciesFactory | None = eqx.field(static=True)
    storages: tuple[tuple[str, Callable[[Any], AbstractStorage]], ...] = eqx.field(static=True)
    ends: tuple[tuple[str, Any, Any], ...] = eqx.field(static=True)
    parameterization: str = eqx.field(static=True, default="sle")

    @property
    def symmetry(self) -> Symmetry | None:
        """Closed surfaces: half a turn, z -> -z, which exchanges the poles, where both have conditions of the same kind.

        The density R is even. So of a field with sign s, its rate has s, its slope -s, and the flux P_w = dR/dw' conjugate to
        it again -s, as the species flux has. The gauge alpha(0) = alpha(1) is its own image.
        """
        is_mirrored = all(type(start) is type(stop) for _, start, stop in self.ends)
        if "v0" not in self.scalars or "area" in self.fields or not is_mirrored:
            return None
        return Symmetry(
            flips=True,
            factors=tuple(-1.0 if name in ODD else 1.0 for name in self.fields),
            offsets=tuple(math.pi if name == "psi" else 0.0 for name in self.fields),
            algebraic=(1.0,) * len(self.algebraic),
            scalars=tuple(-1.0 if name in ODD else 1.0 for name in self.scalars),
        )

    @property
    def held_symmetries(self) -> tuple[str, ...]:
        """Motions that cost nothing and that a condition holds: translation along the axis, by z(0) + z(1) = 0 with v0 free."""
        return ("translation",) if "v0" in self.scalars else ()

    @property
    def held(self) -> tuple[str, ...]:
        """The multipliers of what is held of the whole surface; each has an integral condition."""
        return tuple(name for name in self.scalars if name in HELD)

    def named(self, p: Traced) -> Any:
        """Parameters by name."""
        return SimpleNamespace(**{name: p[i] for i, name in enumerate(self.parameters)})

    def field_values(self, y: Traced) -> dict[str, Traced]:
        """Fields by name."""
        return {name: y[i] for i, name in enumerate(self.fields)}

    def scalar_values(self, s: Traced) -> dict[str, Traced]:
        """Scalars by name."""
        return {name: s[i] for i, name in enumerate(self.scalars)}

    def stored(self, y: Traced, a: Traced, s: Traced) -> Traced:
        """(r, z, psi, h[, c r h])."""
        f, h = self.field_values(y), self.stretch(a, s)
        quantities = [f["r"], f["z"], f["psi"], h]
        quantities += [f[name] * f["r"] * h for name in ("c", "c_2") if name in f]
        return jnp.stack(quantities)

    def stretch(self, a: Traced, s: Traced) -> Traced:
        """h: the same everywhere in the scaling (SLE) parameterization, a field in others."""
        return a[self.algebraic.index("h")] if "h" in self.algebraic else s[self.scalars.index("h")]

    def site(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced) -> Site:
        """The state of motion at one point."""
        f, df, scalar = self.field_values(y), self.field_values(dy), self.scalar_values(s)
        zero = jnp.zeros(())
        rates = Rates(
            dq[0], dq[1] + scalar.get("v0", zero), dq[2], dq[3], f["v"], f.get("v_phi", zero), f.get("turning", zero)
        )
        # The density is linear in the gradients of dr/dt, dz/dt, dpsi/dt, dh/dt, so their values do not matter.
        gradients = Rates(zero, zero, zero, zero, df["v"], df.get("v_phi", zero), df.get("turning", zero))
        geometry = Geometry(f["r"], f["psi"], df["psi"], self.stretch(a, s), f.get("area", zero))
        return Site(geometry, rates, gradients, f.get("c", zero), df.get("c", zero), f.get("c_2", zero))

    def all_terms(self, a: Traced, s: Traced, p: Traced) -> tuple[AbstractTerm, ...]:
        """The model's terms and those of the constraints, whose multipliers are unknowns."""
        scalar = self.scalar_values(s)
        terms = (*self.terms(self.named(p)), *(term(scalar[name]) for name in self.held if (term := HELD[name].term)))
        if "gamma" in self.algebraic:
            terms = (*terms, Incompressibility(a[0]))
        return terms

    def variation(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, p: Traced) -> Variation:
        """dR/dw and dR/dw' at one point."""
        f = self.field_values(y)
        site = self.site(dy, y, a, s, dq)
        terms, multipliers = self.all_terms(a, s, p), Multipliers(f["alpha"], f["beta"])
        found = variation(terms, multipliers, site)
        if "turning" in f:
            # P' = dR/d(turning) + its multiplier gives the multiplier, in which the functional is linear.
            slope = self.field_values(dy)["turning_moment"]
            found = variation(terms, multipliers._replace(turning=slope - jnp.asarray(found.force.turning)), site)
        return found

    def equations(self, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, u: Traced, p: Traced) -> Traced:
        """Geometric relations, P' = dR/dw, definitions of the fluxes, species balance, constraints; one row per unknown."""
        f, df = self.field_values(y), self.field_values(dy)
        site = self.site(dy, y, a, s, dq)
        force, flux = self.variation(dy, y, a, s, dq, p)
        dr, dz = tangent_slopes(site.geometry)
        rows = [
            df["r"] - dr,
            df["z"] - dz,
            f["moment"] - flux.psi,
            df["moment"] - force.psi,
            df["alpha"] - force.r,
            df["beta"] - force.z,
            f["meridional_force"] - flux.meridional_velocity,
            df["meridional_force"] - force.meridional_velocity,
        ]
        if "v_phi" in f:
            rows += [
                f["azimuthal_force"] - flux.azimuthal_velocity,
                df["azimuthal_force"] - force.azimuthal_velocity,
            ]
        if "turning" in f:
            rows += [f["turning_moment"] - flux.turning, f["turning"] - turning_rate(site.geometry, site.rates)]
        rows += self._species_balances(dy, y, dq, u, p, site)
        if "area" in f:
            rows.append(df["area"] - area_element(site.geometry))
        if "gamma" in self.algebraic:
            dilation = self.scalar_values(s).get("dilation", jnp.zeros(()))
            rows.append(divergence(site.geometry, site.rates, site.gradients) - dilation)
        if "h" in self.algebraic:
            w, slip = site.rates, self.scalar_values(s)["slip"]
            carried = site.gradients.meridional_velocity if self.parameterization == "lagrangian" else 0.0
            stretching = carried + site.geometry.dpsi * normal_velocity(site.geometry, w)
            rows.append(dq[3] - stretching - slip * site.geometry.h)
        return jnp.stack(rows)

    def species_laws(self, p: Traced) -> tuple[Species, ...]:
        """The laws of none, one or two species."""
        if self.species is None:
            return ()
        found = self.species(self.named(p))
        return found if isinstance(found, tuple) else (found,)

    def _species_balances(self, dy: Traced, y: Traced, dq: Traced, u: Traced, p: Traced, site: Site) -> list[Traced]:
        """Definitions of the fluxes and balances of the amounts; the law of the second species sees the two exchanged."""
        f, df, rows = self.field_values(y), self.field_values(dy), []
        moment = f["moment"] / f["r"]
        slope = (df["moment"] - moment * df["r"]) / f["r"]
        for i, law in enumerate(self.species_laws(p)):
            c, flux = STATE_AND_FLUX[SPECIES[i]]
            own = site._replace(bending=moment, bending_slope=slope)
            if i == 1:
                own = own._replace(concentration=f["c_2"], second_concentration=f["c"])
            rows += [f[flux] - law.flux(own, df[c]), df[flux] + dq[4 + i] - law.source(own, u)]
        return rows

    def _end(self, name: str, end: Any, y: Traced, s: Traced, dq: Traced, p: Traced) -> Traced:
        """The residual of one end condition."""
        state, flux = STATE_AND_FLUX[name]
        f = self.field_values(y)
        if isinstance(end, Pinned):
            return f[state] - end.value(self.named(p))
        if isinstance(end, Free):
            return f[flux]
        return f[flux] - self._traction(jnp.asarray(end.tension(self.named(p))), y, s, dq, p)

    def _traction(self, tension: Traced, y: Traced, s: Traced, dq: Traced, p: Traced) -> Traced:
        """P_v at an end for a given tension there, on an incompressible surface (div v = 0 fixes v')."""
        dy = jnp.zeros_like(y)
        site = self.site(dy, y, tension[None], s, dq)
        v_slope = -site.geometry.h * divergence(site.geometry, site.rates, site.gradients)
        dy = dy.at[self.fields.index("v")].set(v_slope)
        return self.variation(dy, y, tension[None], s, dq, p).flux.meridional_velocity

    def end_conditions(self, y0: Traced, y1: Traced, s: Traced, dq0: Traced, dq1: Traced, p: Traced) -> Traced:
        """One row per end of each rate, the gauge alpha(0) = 0 (closed: = alpha(1)), the frame z(0) + z(1) = 0, a(0) = 0."""
        f0, f1, scalar = self.field_values(y0), self.field_values(y1), self.scalar_values(s)
        rows = []
        for name, start, stop in self.ends:
            rows += [self._end(name, start, y0, s, dq0, p), self._end(name, stop, y1, s, dq1, p)]
        # Of two poles neither is preferred: alpha(0) + alpha(1) = 0 follows from the equations, so both vanish.
        rows.append(f0["alpha"] - f1["alpha"] if "v0" in scalar else f0["alpha"])
        if "v0" in scalar:
            rows.append(f0["z"] + f1["z"])
            # Without friction a translation meets no force: beta(1) = 0 then repeats beta(0) = 0, and v0 = 0 by choice.
            axial = 2 * [name for name, _, _ in self.ends].index("z") + 1
            rows[axial] = jnp.where(self.named(p).friction > 0.0, rows[axial], scalar["v0"])
        if "area" in f0:
            rows.append(f0["area"])
        # They vanish at the poles as psi is held there; values at nodes follow from those between up to one number.
        rows += [f0[name] + f1[name] for name in STATE_AND_FLUX["turning"] if name in f0]
        return jnp.stack(rows)

    def integrands(self, dy: Traced, y: Traced, a: Traced, s: Traced, u: Traced, p: Traced) -> Traced:
        """The elements of what is held: volume, area."""
        geometry = self.site(dy, y, a, s, jnp.zeros(6)).geometry
        return jnp.array([HELD[name].element(geometry) for name in self.held])

    def targets(self, s: Traced, p: Traced) -> Traced:
        """The values of what is held."""
        named, multipliers = self.named(p), self.scalar_values(s)
        stores = {name: law(named) for name, law in self.storages}
        return jnp.array(
            [
                stores[name].size(multipliers[name]) if name in stores else getattr(named, HELD[name].parameter)
                for name in self.held
            ]
        )

    def stored_energy(self, p: Traced, sizes: Mapping[str, Any]) -> Any:
        """Of what is held elastically, at sizes given by their multipliers."""
        named = self.named(jnp.asarray(p))
        return sum(law(named).energy(jnp.asarray(sizes[name])) for name, law in self.storages)


def make_surface_system(
    parameters: tuple[str, ...],
    terms: TermFactory,
    ends: Ends,
    *,
    species: SpeciesFactory | None = None,
    species_count: int = 1,
    storages: Mapping[str, Callable[[Any], AbstractStorage]] | None = None,
    turning: bool = False,
    parameterization: str = "sle",
    incompressible: bool = False,
    fixed_volume: bool = False,
    fixed_area: bool = False,
    comoving: bool = False,
    azimuthal: bool = False,
    material_area: bool = False,
) -> SurfaceSystem:
    """Choose the unknowns of a surface and check that conditions and unknowns balance.

    Raises ValueError naming the missing or surplus condition.
    """
    fields = ["r", "z", "psi", "moment", "alpha", "beta", "v", "meridional_force"]
    rates = ["r", "z", "psi", "v"]
    if azimuthal:
        fields += ["v_phi", "azimuthal_force"]
        rates.append("v_phi")
    if species is not None:
        rates += SPECIES[:species_count]
        fields += [field for name in SPECIES[:species_count] for field in STATE_AND_FLUX[name]]
    if turning:
        if not comoving:
            raise ValueError(
                "a rate of turning needs a closed surface: at a rim matter passes, whose turning is not known."
            )
        fields += STATE_AND_FLUX["turning"]
    if material_area:
        fields.append("area")
    if material_area and not incompressible:
        raise ValueError(
            "material_area needs an incompressible surface: only there is the cumulative area a material label."
        )
    if incompressible and fixed_area and not comoving:
        raise ValueError(
            "incompressible and fixed_area both fix the area of an open surface, so that neither tension has a value: keep one."
        )
    multipliers = ["p"] * fixed_volume + ["dilation" if incompressible else "sigma"] * fixed_area
    astray = [name for name in storages or {} if name not in multipliers]
    if astray:
        raise ValueError(
            f"storages: {astray[0]} is no multiplier of this surface, which has {', '.join(multipliers) or 'none'}; an "
            "elastic area needs fixed_area and a surface that is not incompressible, an elastic volume fixed_volume."
        )
    if parameterization != "sle" and not comoving:
        raise ValueError(
            f"parameterization = {parameterization!r}: is for closed surfaces; at a rim matter leaves the mesh. Use 'sle'."
        )
    length = "h" if parameterization == "sle" else "slip"
    scalars = (length, *multipliers, *(["v0"] if comoving else []))
    check_ends(ends, tuple(rates))
    if not incompressible and any(isinstance(end, Traction) for pair in ends.values() for end in pair):
        raise ValueError("a Traction end needs an incompressible surface; use Free or Pinned.")
    conditions = [f"{name} at u = {u}" for name in rates for u in (0, 1)] + ["gauge alpha(0) = 0"]
    conditions += ["turning(0) + turning(1) = 0", "turning_moment(0) + turning_moment(1) = 0"] * turning
    conditions += ["frame z(0) + z(1) = 0"] * comoving + ["area(0) = 0"] * material_area
    check_count(len(fields), scalars, conditions, [HELD[name].parameter for name in multipliers])
    return SurfaceSystem(
        fields=tuple(fields),
        algebraic=("gamma",) * incompressible + ("h",) * (parameterization != "sle"),
        parameterization=parameterization,
        scalars=scalars,
        parameters=parameters,
        terms=terms,
        species=species,
        storages=tuple((storages or {}).items()),
        ends=tuple((name, *ends[name]) for name in rates),
    )
