"""The energy law of a surface: what is stored, dissipated and supplied (exact result 5 of the energy balance).

Multiplying each variation by its rate and integrating gives, with 2 D the dissipation rate,

    dF/dt + 2 D = external + chemical power,

where D is the sum of its channels and the external power that of forces and of the ends, 2 pi [P_v v_u + P_phi v_phi]
from u = 0 to 1 (`boundary_power`): shape coordinates are held or free of force there. Of a species the amount
2 pi int c r h du changes by its supply alone, 2 pi int (d(c r h)/dt + N') du.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element, meridional_curvature, volume_element
from shapespace.physics.bending import HelfrichBending
from shapespace.physics.force import AxialForce
from shapespace.physics.term import CHANNELS, AbstractEnergy, AbstractReacting, AbstractTerm, Ledger, Site, carried_rate
from shapespace.variational.rayleighian import booked_power
from shapespace.variational.surface import SurfaceSystem


def densities(
    system: SurfaceSystem, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, p: Traced
) -> dict[str, Traced]:
    """Densities per du of area, volume, energies, powers, amounts; `curvature` = |C_u^u| serves for its largest value."""
    site = system.site(dy, y, a, s, dq)
    g, terms = site.geometry, system.terms(system.named(p))
    element = 2.0 * jnp.pi * area_element(g)
    energies = [term for term in terms if isinstance(term, AbstractEnergy)]
    bending = [term for term in energies if isinstance(term, HelfrichBending)]
    forces = [term for term in terms if isinstance(term, AxialForce)]
    zero = jnp.zeros(())
    found = {
        "length": g.h,
        "area": element,
        "volume": volume_element(g),
        "energy": sum((term.density(g, site.concentration) * element for term in energies), start=zero),
        "bending_energy": sum((term.density(g) * element for term in bending), start=zero),
        "chemical_power": -2.0 * jnp.pi * booked_power(terms, Ledger.CHEMICAL, site),
        "force_power": -2.0 * jnp.pi * booked_power(terms, Ledger.EXTERNAL, site),
        "pulling_force": sum((term.density(g.area) * element for term in forces), start=zero),
        "curvature": jnp.abs(meridional_curvature(g)),
    }
    found |= {channel.value: 4.0 * jnp.pi * booked_power(terms, channel, site) for channel in channels(terms)}
    if reacting := [term for term in terms if isinstance(term, AbstractReacting)]:
        found["reaction_rate"] = 2.0 * jnp.pi * sum((term.reaction_rate(site) for term in reacting), start=zero)
    if system.species is not None:
        supply = dq[4] + system.field_values(dy)["species_flux"]
        found |= {"amount": element * site.concentration, "amount_supply": 2.0 * jnp.pi * supply}
        found["chemical_power"] += 2.0 * jnp.pi * sum((_exchange(term, site, dq) for term in energies), start=zero)
    return found


def _exchange(energy: AbstractEnergy, site: Site, dq: Traced) -> Traced:
    """df/dc times what diffusion and turnover change of c r h: the energy that a species brings in other than by motion."""
    g, w = site.geometry, site.rates
    slope = jax.grad(energy.density, argnums=1)(g, site.concentration)
    still = dq[4] - site.concentration * (w.r * g.h + g.r * w.h)
    return slope * (still - carried_rate(site) * area_element(g))


def channels(terms: tuple[AbstractTerm, ...]) -> tuple[Ledger, ...]:
    """The channels of dissipation that a model has."""
    return tuple(channel for channel in CHANNELS if any(term.ledger is channel for term in terms))


def boundary_power(system: SurfaceSystem, y0: Any, y1: Any) -> Any:
    """2 pi [P_v v_u + P_phi v_phi] between the fields (n,) at u = 0 and at u = 1: the work of whatever drives the ends."""
    column = {name: i for i, name in enumerate(system.fields)}
    pairs = [("meridional_force", "v"), *([("azimuthal_force", "v_phi")] if "v_phi" in column else [])]

    def work(y: Any) -> Any:
        return sum(y[column[force]] * y[column[velocity]] for force, velocity in pairs)

    return 2.0 * math.pi * (work(y1) - work(y0))
