"""Tension and moment tensors of a solved surface, coded by hand, and what the balances of force and torque leave over.

Nothing here comes from the functional: curvatures and strain rates are built from r, psi, h and the velocities at the
Gauss points, the constitutive laws are those of the main text, the normal tensions come from the torque balance (TB), and the
divergences are those of App. A in the unit basis. Derivatives along the curve are those of the interpolants of each element.
"""

from typing import NamedTuple

import numpy as np
from tests.exact import paper_equations as paper
from tests.surfaces import stage_fields

from shapespace.base.arrays import Array
from shapespace.base.problem import Rate
from shapespace.numerics.gauss import gauss_rule
from shapespace.study.engine import Engine


class Surface(NamedTuple):
    """Shape and velocity at the Gauss points (N, k), and `along`, which differentiates such arrays over u."""

    r: Array
    psi: Array
    h: float
    cu: Array
    cp: Array
    v_u: Array
    v_phi: Array
    v_n: Array
    strain: tuple[Array, Array, Array]
    fields: dict[str, Array]
    widths: Array
    derivative: Array

    def along(self, f: Array) -> Array:
        """f' by the polynomials through the Gauss points of each element."""
        return np.asarray(f @ self.derivative.T / self.widths[:, None])

    def divergence(self, u: Array, p: Array) -> Array:
        """((r t_u)'/h - cos(psi) t_p) of what r times a divergence has in common."""
        return np.asarray(self.along(self.r * u) / self.h - np.cos(self.psi) * p)


def differentiation(points: Array) -> Array:
    """D (k, k): derivatives at the points of the polynomial with given values there."""
    powers = np.vander(points, increasing=True)
    slopes = np.zeros_like(powers)
    slopes[:, 1:] = powers[:, :-1] * np.arange(1, len(points))
    return np.asarray(slopes @ np.linalg.inv(powers))


def surface_of(engine: Engine, x: Array, rate: Rate) -> Surface:
    """Shape and motion of a state."""
    problem, names = engine.problem, engine.system.fields
    state, f = problem.unpack(x), stage_fields(engine, x)
    slopes = {name: state.slopes[..., i] for i, name in enumerate(names)}
    r, psi, h = f["r"], f["psi"], float(f["h"])
    dq = problem.rates(x, engine.p, rate)
    v_n = np.sin(psi) * dq[..., 0] + np.cos(psi) * (dq[..., 1] + f.get("v0", 0.0))
    zero = np.zeros_like(r)
    v_phi, cu, cp, cot = f.get("v_phi", zero), slopes["psi"] / h, np.sin(psi) / r, np.cos(psi) / r
    strain = (slopes["v"] / h + cu * v_n, cot * f["v"] + cp * v_n, 0.5 * (slopes.get("v_phi", zero) / h - cot * v_phi))
    f |= {"gamma": state.algebraic[..., 0]} if engine.system.algebraic else {}
    derivative = differentiation(gauss_rule(problem.degree).points)
    return Surface(r, psi, h, cu, cp, f["v"], v_phi, v_n, strain, f, state.widths, derivative)


class Tensors(NamedTuple):
    """Components in the unit basis: tension t_ij and t_in, moment m_ij, and the external force density."""

    uu: Array
    pp: Array
    up: Array
    un: Array
    moment: Array
    force_u: Array
    force_phi: Array
    force_n: Array


def tensors_of(engine: Engine, s: Surface) -> Tensors:
    """The constitutive laws (Tgen, Mgen, te, me, stressd, fext) with the coat (scpara), the pull (pullforce) and p n."""
    v, f, sin, cos = engine.values, s.fields, np.sin(s.psi), np.cos(s.psi)
    kappa, zero = v["bending_rigidity"], np.zeros_like(s.r)
    c_0, axial, gamma, active = v["spontaneous_curvature"] + zero, zero, zero, zero
    if "area" in f:
        c_0 = paper.patch(v["spontaneous_curvature"], v["coat_area"], v["coat_sharpness"], f["area"])[0]
        pulled, sharp = v["pulled_area"], v["pulled_sharpness"]
        size = 2.0 * np.pi * np.logaddexp(0.0, 2.0 * sharp * pulled) / (2.0 * sharp)
        axial = paper.patch(v["pulling_force"] / size, pulled, sharp, f["area"])[0]
    if "c" in f:
        gamma = v["tension"] + zero
        active = paper.active_tension(v["active_tension"], v["saturation_concentration"], f["c"], zero)[0]
    gamma = gamma + f.get("gamma", 0.0) + f.get("sigma", 0.0)
    uu, pp, up = s.strain
    isotropic = gamma + active + v.get("bulk_viscosity", 0.0) * (uu + pp)
    moment = kappa * (s.cu + s.cp - c_0)
    return Tensors(
        uu=isotropic + 0.5 * kappa * ((s.cp - c_0) ** 2 - s.cu**2) + v["shear_viscosity"] * (uu - pp),
        pp=isotropic + 0.5 * kappa * ((s.cu - c_0) ** 2 - s.cp**2) - v["shear_viscosity"] * (uu - pp),
        up=2.0 * v["shear_viscosity"] * up,
        # (TB): the moments m_uphi = m and m_phiu = -m turn about e_phi by (r m_uphi)'/(r h) + cos(psi)/r m_phiu = t_un.
        un=s.divergence(moment, moment) / s.r,
        moment=moment,
        force_u=-v["friction"] * s.v_u - axial * sin,
        force_phi=-v["friction"] * (s.v_phi - v["rotation_rate"] * s.r),
        force_n=f.get("p", 0.0) + axial * cos - v.get("normal_friction", 0.0) * s.v_n,
    )


def misses(engine: Engine, x: Array, rate: Rate) -> dict[str, float]:
    """What (FB) leaves over of r times each component of div T + f, relative to the largest summand, over the surface."""
    s = surface_of(engine, x, rate)
    t = tensors_of(engine, s)
    summands = {
        "meridional": (s.divergence(t.uu, t.pp), s.r * s.cu * t.un, s.r * t.force_u),
        "azimuthal": (s.divergence(t.up, -t.up), s.r * t.force_phi),
        "normal": (s.along(s.r * t.un) / s.h, -s.r * s.cu * t.uu, -s.r * s.cp * t.pp, s.r * t.force_n),
    }
    sizes = {name: max(float(np.abs(part).max()) for part in parts) for name, parts in summands.items()}
    scale = max(sizes.values())
    return {name: float(np.abs(sum(parts)).max()) / scale for name, parts in summands.items()}
