"""The energy law of a surface: what is stored, dissipated and supplied (exact result 5 of the energy balance).

Multiplying each variation by its rate and integrating gives, with 2 D the dissipation rate,

    dF/dt + 2 D = external + chemical power,

where the external power includes that of the rim, 2 pi P_v v_u at u = 1.
"""

import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import area_element, meridional_curvature, volume_element
from shapespace.physics.bending import HelfrichBending
from shapespace.physics.force import AxialForce
from shapespace.physics.term import AbstractEnergy, Ledger
from shapespace.variational.rayleighian import booked_power
from shapespace.variational.surface import SurfaceSystem


def densities(
    system: SurfaceSystem, dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced, p: Traced
) -> dict[str, Traced]:
    """Densities per du of area, volume, energies and powers; `curvature` = |C_u^u| serves for its largest value."""
    del a  # multipliers do no work
    site = system.site(dy, y, s, dq)
    g, terms = site.geometry, system.terms(system.named(p))
    element = 2.0 * jnp.pi * area_element(g)
    energies = [term for term in terms if isinstance(term, AbstractEnergy)]
    bending = [term for term in energies if isinstance(term, HelfrichBending)]
    forces = [term for term in terms if isinstance(term, AxialForce)]
    zero = jnp.zeros(())
    return {
        "area": element,
        "volume": volume_element(g),
        "energy": sum((term.density(g) * element for term in energies), start=zero),
        "bending_energy": sum((term.density(g) * element for term in bending), start=zero),
        "dissipation": 4.0 * jnp.pi * booked_power(terms, Ledger.DISSIPATION, site),
        "chemical_power": -2.0 * jnp.pi * booked_power(terms, Ledger.CHEMICAL, site),
        "external_power": -2.0 * jnp.pi * booked_power(terms, Ledger.EXTERNAL, site),
        "pulling_force": sum((term.density(g.area) * element for term in forces), start=zero),
        "curvature": jnp.abs(meridional_curvature(g)),
    }
