"""The paper's route as a peer: guided division (Fig. 6) by backward Euler with `scipy.integrate.solve_bvp`.

Every time step is one boundary value problem in the mesh coordinate u, written by hand as an explicit first-order system
for eleven fields (order of `FIELDS`) and two scalars (meridian length h, pressure p). With the rates

    r_t = (r - r_old)/dt,  z_t = (z - z_old)/dt,  c_t = (c - c_old)/dt,
    v_n = sin(psi) r_t + cos(psi) z_t,   q^u = [v_u + sin(psi) z_t - cos(psi) r_t]/h,

the curvatures C_phi = sin(psi)/r and C_u = psi'/h = m/(kappa r) - C_phi, the strain rates S_u = v_u'/h + C_u v_n and
S_phi = (cos(psi) v_u + sin(psi) v_n)/r, and the tensions T = gamma + xi f(c) + eta_b (S_u + S_phi) +- eta_s (S_u - S_phi),

    r' = h cos(psi)        z' = -h sin(psi)        psi' = h C_u
    m' = h (m cos(psi)/r + alpha sin(psi) + beta cos(psi))                             bending moment times r
    alpha' = r h N sin(psi) + h (kappa/2)(C_u^2 - C_phi^2),   beta' = r h N cos(psi),  N = T_u C_u + T_phi C_phi - p
    v_u' = h (S_u - C_u v_n),      n' = h (cos(psi) T_phi + Gamma r v_u)               n = r T_u
    c' = h j/(D r),                j' = r h [c_t + q^u c' + c (S_u + S_phi) + k (c - c0hat(u))]
    V' = pi r^2 h sin(psi).

Thirteen conditions: r, psi, beta, v_u and j at both ends, V(0) = 0, V(1) = V0, and alpha(0) = 0 in place of the two
conditions on zeta (zeta vanishes identically). Units: kappa = eta_b = R0 = D = 1, hence tau = 1.

`solve_bvp` puts nodes on the poles, where the equations divide by r, so the surface has a hole there (`Ends`).
Source: arXiv 2501.17849v2, Sec. IV E, App. D and E, with the signs of z' and of the v_phi equation corrected.

Run: python benchmarks/peer_solve_bvp.py [--steps N] [--tol T]
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicHermiteSpline, PPoly

Array = NDArray[Any]

FIELDS = ("r", "z", "psi", "m", "alpha", "beta", "v_u", "n", "c", "j", "V")
REMEMBERED = (FIELDS.index("r"), FIELDS.index("z"), FIELDS.index("c"))
TIME_STEP = 1e-3
MAX_NODES = 20_000
STEP_SECONDS = 120.0
REPORT_TIMES = (0.01, 0.05, 0.1, 0.15)


@dataclass(frozen=True)
class Parameters:
    """Guided division (paper Table 5, with w^2 = 0.02): dimensionless, kappa = eta_b = R0 = D = 1."""

    bending_rigidity: float = 1.0
    bulk_viscosity: float = 1.0
    shear_viscosity: float = 1.0
    friction: float = 0.09
    tension: float = 9.0
    active_tension: float = 450.0
    saturation_concentration: float = 10.0
    diffusivity: float = 1.0
    turnover_rate: float = 45.0
    reference_concentration: float = 1.0
    ring_amplitude: float = 4.0
    ring_width_squared: float = 0.02
    enclosed_volume: float = 4.0 * np.pi / 3.0

    def isotropic_tension(self, c: Array) -> Array:
        """gamma + (xi dmu)_0 c^2/(c^2 + c_s^2)."""
        return self.tension + self.active_tension * c**2 / (c**2 + self.saturation_concentration**2)

    def reference_profile(self, u: Array) -> Array:
        """c0hat(u) = c0 [1 + Delta_c exp(-(u - 1/2)^2/w^2)]."""
        ring = np.exp(-((u - 0.5) ** 2) / self.ring_width_squared)
        return self.reference_concentration * (1.0 + self.ring_amplitude * ring)


@dataclass(frozen=True)
class Ends:
    """How the poles are cut out.

    regular=False: the usual hole. u runs from 0 to 1, r = `hole`, psi = arcsin(hole) (the cap of the unit sphere), v_u = 0.
    regular=True: the pole's first-order expansion. u runs from d = hole/pi to 1 - d with r = h d, C_u = C_phi
    and T_u = T_phi, as on every smooth surface to O(hole^2), so that no boundary layer forms at the hole.
    """

    hole: float = 1e-3
    regular: bool = False

    @property
    def interval(self) -> tuple[float, float]:
        """The range of u that is solved."""
        gap = self.hole / np.pi if self.regular else 0.0
        return gap, 1.0 - gap


@dataclass(frozen=True)
class Peer:
    """One set-up of the peer; the defaults are the fastest found that reaches the tolerance."""

    parameters: Parameters = field(default_factory=Parameters)
    ends: Ends = field(default_factory=Ends)
    complex_step: bool = True  # Jacobian; False: solve_bvp's own forward differences
    coarsen: bool = True  # drop nodes whose neighbours beat the tolerance by far (solve_bvp itself only adds)
    anticipate: float = 0.5
    extrapolate: bool = False  # first guess linear in time instead of constant
    max_nodes: int = MAX_NODES
    step_seconds: float = STEP_SECONDS


@dataclass(frozen=True)
class StepResult:
    """One time step: `sol` maps u to the eleven fields; h, p the scalars; `residuals` per interval of `mesh`."""

    success: bool
    time: float
    sol: PPoly
    h: float
    p: float
    mesh: Array
    residuals: Array
    seconds: float
    message: str
    newton: int = 0
    earlier: PPoly | None = None

    @property
    def nodes(self) -> int:
        """Number of mesh nodes."""
        return int(self.mesh.size)

    @property
    def neck_radius(self) -> float:
        """r(u = 1/2)."""
        return float(self.sol(0.5)[0])


class _OutOfTime(Exception):
    """Raised inside a solve that has used up its wall-clock limit; solve_bvp has no limit of its own."""


def right_hand_side(u: Array, y: Array, scalars: Array, old: Array, dt: float, par: Parameters) -> Array:
    """y' for fields y (11, ...) at u; `old` holds r, z, c of the previous time at u. Accepts complex y and scalars."""
    r, _, psi, m, alpha, beta, v, n, c, j, _ = y
    h, p = scalars
    r_t, z_t, c_t = (r - old[0]) / dt, (y[1] - old[1]) / dt, (c - old[2]) / dt
    sin, cos = np.sin(psi), np.cos(psi)
    c_phi = sin / r
    c_u = m / (par.bending_rigidity * r) - c_phi
    v_n = sin * r_t + cos * z_t
    q_u = (v + sin * z_t - cos * r_t) / h
    eta_b, eta_s = par.bulk_viscosity, par.shear_viscosity
    isotropic = par.isotropic_tension(c)
    t_u = n / r
    s_phi = (cos * v + sin * v_n) / r
    s_u = (t_u - isotropic - (eta_b - eta_s) * s_phi) / (eta_b + eta_s)
    divergence = s_u + s_phi
    t_phi = isotropic + eta_b * divergence - eta_s * (s_u - s_phi)
    normal = r * h * (t_u * c_u + t_phi * c_phi - p)
    dc = h * j / (par.diffusivity * r)
    source = c_t + q_u * dc + c * divergence + par.turnover_rate * (c - par.reference_profile(u))
    out = np.empty_like(y)
    out[0] = h * cos
    out[1] = -h * sin
    out[2] = h * c_u
    out[3] = h * (m * cos / r + alpha * sin + beta * cos)
    out[4] = normal * sin + 0.5 * h * par.bending_rigidity * (c_u**2 - c_phi**2)
    out[5] = normal * cos
    out[6] = h * (s_u - c_u * v_n)
    out[7] = h * (cos * t_phi + par.friction * r * v)
    out[8] = dc
    out[9] = r * h * source
    out[10] = np.pi * r**2 * h * sin
    return out


def end_conditions(ya: Array, yb: Array, scalars: Array, ends: Ends, par: Parameters, rates: Array) -> Array:
    """The thirteen end conditions; `rates` holds (r_t, z_t) at both ends, shape (2, 2), first axis the end."""
    h = scalars[0]
    cut, rest = ends.hole, [ya[5], yb[5], ya[9], yb[9], ya[4], ya[10], yb[10] - par.enclosed_volume]
    if not ends.regular:
        cap = np.arcsin(cut)
        hole = [ya[0] - cut, yb[0] - cut, ya[2] - cap, yb[2] - np.pi + cap, ya[6], yb[6]]
        return np.array(hole + rest)
    expansion = []
    for y, (r_t, z_t) in ((ya, rates[0]), (yb, rates[1])):
        r, sin, cos = y[0], np.sin(y[2]), np.cos(y[2])
        s_phi_r = cos * y[6] + sin * (sin * r_t + cos * z_t)
        expansion += [
            r - h * cut / np.pi,
            y[3] - 2.0 * par.bending_rigidity * sin,
            y[7] - r * par.isotropic_tension(y[8]) - 2.0 * par.bulk_viscosity * s_phi_r,
        ]
    return np.array(expansion + rest)


def complex_step_jacobian(u: Array, y: Array, scalars: Array, old: Array, dt: float, par: Parameters) -> tuple[Array, Array]:
    """Exact d y'/d y (11, 11, m) and d y'/d(h, p) (11, 2, m): all thirteen complex perturbations in one evaluation."""
    n, step = y.shape[0], 1e-30
    perturbed = np.repeat(y[:, None, :], n + 2, axis=1).astype(complex)
    perturbed[range(n), range(n)] += 1j * step
    unknowns = np.repeat(scalars[:, None, None], n + 2, axis=1).astype(complex)
    unknowns[range(2), range(n, n + 2)] += 1j * step
    slopes = right_hand_side(u, perturbed, unknowns, old, dt, par).imag / step
    return slopes[:, :n], slopes[:, n:]


def sphere_start(peer: Peer | None = None) -> StepResult:
    """The unit sphere at rest with c = c0: r = sin(pi u), z = cos(pi u), psi = pi u, h = pi, p = 2 T."""
    peer = Peer() if peer is None else peer
    par, ends = peer.parameters, peer.ends
    u = np.linspace(*ends.interval, 801)  # fine: its interpolation error is divided by dt in the first step
    cap = np.arcsin(ends.hole)
    psi = np.pi * u if ends.regular else cap + (np.pi - 2 * cap) * u
    h = float(np.pi if ends.regular else np.pi - 2 * cap)
    sin, cos, zero = np.sin(psi), np.cos(psi), np.zeros_like(u)
    tension = float(par.isotropic_tension(np.asarray(par.reference_concentration)))
    volume = np.pi * (2.0 / 3.0 - cos + cos**3 / 3.0)
    y = np.array([sin, cos, psi, 2 * par.bending_rigidity * sin, zero, zero, zero, tension * sin, zero + 1, zero, volume])
    y[8] = par.reference_concentration
    slope = np.array([cos, -sin, zero + 1, 2 * par.bending_rigidity * cos, zero, zero, zero, tension * cos, zero, zero, np.pi * sin**3])
    sol = CubicHermiteSpline(u, y, h * slope, axis=1)
    return StepResult(True, 0.0, sol, h, 2 * tension, u[::20], np.ones(40), 0.0, "sphere")


def first_mesh(previous: StepResult, tol: float, coarsen: bool, anticipate: float = 0.5, floor: float = 1e-6) -> Array:
    x, width = previous.mesh, np.diff(previous.mesh)
    if not coarsen:
        return x
    needs_middle = (previous.residuals > anticipate * tol) & (width > 2.0 * floor) if previous.time > 0 else width < 0
    spare = (previous.residuals < 1e-2 * tol) | (width < floor)
    keep, i = np.ones(x.size, bool), 1
    while i < x.size - 1:
        if spare[i - 1] and spare[i]:
            keep[i] = False
            i += 1
        i += 1
    return np.union1d(x[keep], (x[:-1] + 0.5 * width)[needs_middle])


def backward_euler_step(previous: StepResult, dt: float, tol: float, peer: Peer | None = None) -> StepResult:
    """One implicit step from `previous`, warm-started from it. Failure is in `success` and `message`, never raised."""
    peer = Peer() if peer is None else peer
    par, ends = peer.parameters, peer.ends
    started = time.perf_counter()
    source = previous.sol
    old = PPoly(np.ascontiguousarray(source.c[:, :, REMEMBERED]), source.x, axis=0)
    at_ends = old(np.array(ends.interval))

    def fun(u: Array, y: Array, s: Array) -> Array:
        if time.perf_counter() - started > peer.step_seconds:
            raise _OutOfTime
        return right_hand_side(u, y, s, old(u).T, dt, par)

    def jacobian(u: Array, y: Array, s: Array) -> tuple[Array, Array]:
        return complex_step_jacobian(u, y, s, old(u).T, dt, par)

    def ends_fun(ya: Array, yb: Array, s: Array) -> Array:
        rates = (np.array([ya[:2], yb[:2]]) - at_ends[:, :2]) / dt
        return end_conditions(ya, yb, s, ends, par, rates)

    x = first_mesh(previous, tol, peer.coarsen, peer.anticipate)
    guess, scalars = source(x), np.array([previous.h, previous.p])
    if peer.extrapolate and previous.earlier is not None:
        guess = 2.0 * guess - previous.earlier(x)
    try:
        out = solve_bvp(
            fun, ends_fun, x, guess, scalars, tol=tol, max_nodes=peer.max_nodes,
            fun_jac=jacobian if peer.complex_step else None,
        )
    except _OutOfTime:
        spent = time.perf_counter() - started
        return replace(previous, success=False, seconds=spent, message=f"no solution within {peer.step_seconds:g} s")
    return StepResult(
        out.status == 0, previous.time + dt, out.sol, float(out.p[0]), float(out.p[1]), out.x, out.rms_residuals,
        time.perf_counter() - started, out.message, out.niter, source,
    )
