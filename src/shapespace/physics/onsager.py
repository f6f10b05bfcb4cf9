"""The flux-force flip: active stress from dissipative couplings only (paper Sec. IV D).

With Delta mu as force the coupling xi is reactive and drops out of the entropy production. With the reaction rate r_p as
force instead, the same laws read T = ... + (xi^2/Lambda) div(v) + (xi/Lambda) r_p, Delta mu = r_p/Lambda + (xi/Lambda) div(v),
whose power is (r_p + xi div v)^2/(2 Lambda) - r_p Delta mu. Its variation over r_p gives r_p = Lambda Delta mu - xi div(v);
putting that back leaves xi Delta mu div(v) - Lambda Delta mu^2/2: an isotropic tension and a constant.
"""

from shapespace.base.arrays import Traced


def reaction_power(rate: Traced, dilation: Traced, coupling: Traced, mobility: Traced, potential: Traced) -> Traced:
    """(r_p + xi div v)^2/(2 Lambda) - r_p Delta mu per area: the terms of R with r_p in Eq. (rayldens)."""
    return (rate + coupling * dilation) ** 2 / (2.0 * mobility) - rate * potential


def stationary_reaction_rate(dilation: Traced, coupling: Traced, mobility: Traced, potential: Traced) -> Traced:
    """r_p = Lambda Delta mu - xi div(v) (Eq. constrp)."""
    return mobility * potential - coupling * dilation


def reduced_power(dilation: Traced, coupling: Traced, mobility: Traced, potential: Traced) -> Traced:
    """xi Delta mu div(v) - Lambda Delta mu^2/2 per area: the power with r_p eliminated."""
    return coupling * potential * dilation - 0.5 * mobility * potential**2
