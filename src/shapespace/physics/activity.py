"""Active isotropic tension regulated by a species, with the reaction left out or shown (paper Sec. IV C, D)."""

from abc import abstractmethod
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from shapespace.base.arrays import Traced
from shapespace.geometry.curve import Geometry, area_element, total_curvature
from shapespace.geometry.motion import coordinate_flow, divergence
from shapespace.physics.onsager import LinearLaws, reaction_laws
from shapespace.physics.tension import tension_power
from shapespace.physics.term import AbstractReacting, AbstractTerm, Ledger, Site


class ActiveTension(AbstractTerm):
    """Power xi Delta mu(c) div(v) with the Hill law xi Delta mu = amplitude c^2/(c^2 + c_s^2) (Eq. stresssc).

    The term is what eliminating the reaction rate r_p at fixed Delta mu leaves (physics/onsager.py).
    amplitude: (xi Delta mu)_0 [energy/length^2]; saturation: c_s [concentration].
    """

    ledger: ClassVar[Ledger] = Ledger.CHEMICAL
    amplitude: Traced
    saturation: Traced

    def tension(self, concentration: Traced) -> Traced:
        """xi Delta mu(c) [energy/length^2]."""
        return self.amplitude * concentration**2 / (concentration**2 + self.saturation**2)

    def power(self, site: Site) -> Traced:
        """xi Delta mu(c) div(v) r h."""
        return tension_power(self.tension(site.concentration), site)


class ActiveMoment(AbstractTerm):
    """Power m(c) d(2H)/dt of an active bending moment m = amplitude c/reference: an active spontaneous curvature m/kappa.

    amplitude: [energy/length]; reference: c0. Unlike a spontaneous curvature it does no work when the area changes at the
    same curvature. Sphere: p = 2 gamma/R + 2 m/R^2.

    As m d(2H)/dt r h = d/dt(m 2H r h) - m 2H div(v) r h with m carried by the matter, and m r dpsi'/dt = -(m r)' dpsi/dt, each
    up to a flux along the surface that vanishes where psi is held, no gradient of a rate but div(v) is needed.
    """

    ledger: ClassVar[Ledger] = Ledger.CHEMICAL
    amplitude: Traced
    reference: Traced

    def power(self, site: Site) -> Traced:
        """-m d(2H)/dt r h."""
        g, w = site.geometry, site.rates
        m, slope = (self.amplitude / self.reference * value for value in (site.concentration, site.concentration_slope))
        direction = Geometry(w.r, w.psi, 0.0 * w.psi, w.h, -coordinate_flow(g, w) * g.r)
        along = -coordinate_flow(g, w) * slope / g.h
        stored = jax.jvp(lambda x, m: m * total_curvature(x) * area_element(x), (g, m), (direction, along))[1]
        turned = (slope * g.r + m * g.h * jnp.cos(g.psi)) * w.psi
        return tension_power(m * total_curvature(g), site) - stored + turned


class Reaction(eqx.Module):
    """The reaction behind an active tension: xi = (xi Delta mu)/Delta mu, mobility Lambda, potential Delta mu, at one point.

    mobility: Lambda [1/(energy length^2 time)], > 0; potential: Delta mu [energy], not 0, held by the surroundings.
    """

    active: ActiveTension
    mobility: Traced
    potential: Traced

    def laws(self, concentration: Traced) -> LinearLaws:
        """tension = xi Delta mu, r_p = -xi div v + Lambda Delta mu."""
        return reaction_laws(self.active.tension(concentration) / self.potential, self.mobility)

    def rate(self, dilation: Traced, concentration: Traced) -> Traced:
        """r_p [1/(length^2 time)] (Eq. constrp)."""
        return self.laws(concentration).fluxes(jnp.stack([dilation, self.potential]))[1]


class AbstractReactionTerm(AbstractTerm):
    """A term in which the reaction rate r_p is the force, at the value that makes the functional stationary.

    The functional has r_p in two terms, whose sum is xi Delta mu div(v) and a constant: at the stationary r_p the motion
    that changes r_p changes the sum of both terms no further.
    """

    reaction: eqx.AbstractVar[Reaction]

    @abstractmethod
    def density(self, laws: LinearLaws, dilation: Traced, rate: Traced) -> Traced:
        """Power per area, of the laws with odd forces, div v and r_p."""

    def power(self, site: Site) -> Traced:
        """The density times r h."""
        dilation = divergence(site.geometry, site.rates, site.gradients)

        def at(dilation: Traced, concentration: Traced) -> Traced:
            laws, rate = self.reaction.laws(concentration), self.reaction.rate(dilation, concentration)
            return self.density(laws.dissipative(), dilation, rate)

        found = jnp.vectorize(at)(dilation, jnp.asarray(site.concentration))
        return found * area_element(site.geometry)


class ReactionDissipation(AbstractReactionTerm):
    """Half of what the reaction dissipates, (r_p + xi div v)^2/(2 Lambda) (Eqs. CR1, CR2, disspart)."""

    ledger: ClassVar[Ledger] = Ledger.REACTION
    reaction: Reaction

    def density(self, laws: LinearLaws, dilation: Traced, rate: Traced) -> Traced:
        """The Rayleigh function of the flipped laws."""
        return laws.rayleigh(jnp.stack([dilation, rate]))


class ReactionSupply(AbstractReactionTerm, AbstractReacting):
    """-r_p Delta mu: the chemical energy that the reaction takes up (Eq. dtFequi)."""

    ledger: ClassVar[Ledger] = Ledger.CHEMICAL
    reaction: Reaction

    def density(self, laws: LinearLaws, dilation: Traced, rate: Traced) -> Traced:
        """-r_p Delta mu."""
        return -rate * self.reaction.potential

    def reaction_rate(self, site: Site) -> Traced:
        """What the supply is the power of."""
        return -self.power(site) / self.reaction.potential
