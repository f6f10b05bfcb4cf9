"""The paper's route as a peer: guided division (Fig. 6) by backward Euler with `scipy.integrate.solve_bvp`.

Every time step is one boundary value problem in the mesh coordinate u, written by hand as an explicit first-order
system for eleven fields (order of `FIELDS`) and two scalars (meridian length h, pressure p). With the rates

    r_t = (r - r_old)/dt,  z_t = (z - z_old)/dt,  c_t = (c - c_old)/dt,
    v_n = sin(psi) r_t + cos(psi) z_t,   q^u = [v_u + sin(psi) z_t - cos(psi) r_t]/h,

the curvatures C_phi = sin(psi)/r and C_u = psi'/h = m/(kappa r) - C_phi, the strain rates S_u = v_u'/h + C_u v_n and
S_phi = (cos(psi) v_u + sin(psi) v_n)/r, and T = gamma + (xi dmu)_0 f(c) + eta_b (S_u + S_phi) +- eta_s (S_u - S_phi)
(+ for T_u, - for T_phi), f(c) = c^2/(c^2 + c_s^2),

    r' = h cos(psi)        z' = -h sin(psi)        psi' = h C_u
    m' = h (m cos(psi)/r + alpha sin(psi) + beta cos(psi))                             bending moment times r
    alpha' = r h N sin(psi) + h (kappa/2)(C_u^2 - C_phi^2),   beta' = r h N cos(psi),  N = T_u C_u + T_phi C_phi - p
    v_u' = h (S_u - C_u v_n),      n' = h (cos(psi) T_phi + Gamma r v_u)               n = r T_u
    c' = h j/(D r),                j' = r h [c_t + q^u c' + c (S_u + S_phi) + k (c - c0hat(u))]
    V' = pi r^2 h sin(psi).

Thirteen conditions: r, psi, beta, v_u and j at both ends, V(0) = 0, V(1) = V0, and alpha(0) = 0 in place of the two
conditions on zeta (zeta vanishes identically). Units: kappa = eta_b = R0 = D = 1, hence tau = 1.
Source: arXiv 2501.17849v2, Sec. IV E, App. D and E, with the sign of z' corrected.

Two set-ups of the same equations. `USUAL`: the usual hole r = 1e-3 at the poles, solve_bvp's own difference Jacobian,
each step started from the previous solution on its mesh. `TUNED`: the best found, and the one to compare with: regular
pole expansion at the hole, exact Jacobian, first guess linear in time, mesh thinned and refined ahead between steps.
A step that needs more than `MAX_NODES` nodes or `STEP_SECONDS` seconds has failed, and the run ends there.

Run: python benchmarks/peer_solve_bvp.py [--steps N] [--tol T] [--setup tuned|usual|both] [--check]
Takes about 4 minutes with the defaults, most of it at tol 1e-6; a second or two with --steps 20 --tol 1e-3.
Expect: usual, tol 1e-6, fails near step 184 (mesh doubled every step as the neck closes); the others pass the neck.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicHermiteSpline, PPoly

Array = NDArray[Any]

FIELDS = ("r", "z", "psi", "m", "alpha", "beta", "v_u", "n", "c", "j", "V")
REMEMBERED = [FIELDS.index(name) for name in ("r", "z", "c")]
TIME_STEP = 1e-3
TOLERANCES = (1e-3, 1e-6)
MAX_NODES = 20_000
STEP_SECONDS = 120.0


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
    """How the poles are cut out: solve_bvp puts nodes on the ends, where the equations divide by r.

    regular=False: the usual hole. u runs from 0 to 1, r = `hole`, psi = arcsin(hole) (the unit sphere's cap), v_u = 0.
    regular=True: the pole's first-order expansion. u runs from d = hole/pi to 1 - d with r = h d, C_u = C_phi and
    T_u = T_phi, as on every smooth surface to O(hole^2): no boundary layer at the hole, no stretch of u.
    """

    hole: float = 1e-3
    regular: bool = True

    @property
    def interval(self) -> tuple[float, float]:
        """The range of u that is solved."""
        gap = self.hole / np.pi if self.regular else 0.0
        return gap, 1.0 - gap


@dataclass(frozen=True)
class Peer:
    """One set-up of the peer: what does not change the equations, and their parameters."""

    parameters: Parameters = field(default_factory=Parameters)
    ends: Ends = field(default_factory=Ends)
    exact_jacobian: bool = True  # by complex step; False: solve_bvp's forward differences
    adapt_mesh: bool = True  # thin out and refine ahead between steps; solve_bvp itself only adds nodes
    extrapolate: bool = True  # first guess linear in time; False: the previous solution
    max_nodes: int = MAX_NODES
    step_seconds: float = STEP_SECONDS


TUNED = Peer()
USUAL = Peer(ends=Ends(regular=False), exact_jacobian=False, adapt_mesh=False, extrapolate=False)


@dataclass(frozen=True)
class StepResult:
    """One time step: `sol` maps u to the eleven fields (`FIELDS`); `residuals` are relative, per interval of `mesh`.

    `seconds` is wall-clock, `cpu_seconds` processor time, `iterations` the meshes tried, `earlier` the step before.
    """

    success: bool
    message: str
    time: float
    sol: PPoly
    h: float
    p: float
    mesh: Array
    residuals: Array
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    iterations: int = 0
    earlier: "StepResult | None" = None

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


def complex_step_jacobian(
    u: Array, y: Array, scalars: Array, old: Array, dt: float, par: Parameters
) -> tuple[Array, Array]:
    """Exact d y'/d y (11, 11, m) and d y'/d(h, p) (11, 2, m): all thirteen complex perturbations in one evaluation."""
    n, step = y.shape[0], 1e-30
    perturbed = np.repeat(y[:, None, :], n + 2, axis=1).astype(complex)
    perturbed[range(n), range(n)] += 1j * step
    unknowns = np.repeat(scalars[:, None, None], n + 2, axis=1).astype(complex)
    unknowns[range(2), range(n, n + 2)] += 1j * step
    slopes = right_hand_side(u, perturbed, unknowns, old, dt, par).imag / step
    return slopes[:, :n], slopes[:, n:]


def sphere_start(peer: Peer = TUNED, amplitude: float = 0.0) -> StepResult:
    """The unit sphere at rest with c = c0: r = sin(psi), z = cos(psi), psi = pi u, h = pi, p = 2 T.

    `amplitude` e adds, to first order, the normal displacement e P_2(cos psi) at uniform stretch of the meridian.
    """
    par, ends = peer.parameters, peer.ends
    u = np.linspace(*ends.interval, 801)  # fine, because its interpolation error is divided by dt in the first step
    cap = np.arcsin(ends.hole)
    psi = np.pi * u if ends.regular else cap + (np.pi - 2.0 * cap) * u
    h = float(np.pi if ends.regular else np.pi - 2.0 * cap)
    sin, cos, zero = np.sin(psi), np.cos(psi), np.zeros_like(u)
    c = zero + par.reference_concentration
    tension = float(par.isotropic_tension(np.asarray(par.reference_concentration)))
    bending = 2.0 * par.bending_rigidity
    volume = np.pi * (2.0 / 3.0 - cos + cos**3 / 3.0)
    y = np.array([sin, cos, psi, bending * sin, zero, zero, zero, tension * sin, c, zero, volume])
    slope = np.array(
        [cos, -sin, zero + 1.0, bending * cos, zero, zero, zero, tension * cos, zero, zero, np.pi * sin**3]
    )
    normal, normal_slope = 0.25 * (1.0 + 3.0 * np.cos(2.0 * psi)), -1.5 * np.sin(2.0 * psi)
    along, along_slope = -0.375 * np.sin(2.0 * psi), -0.75 * np.cos(2.0 * psi)
    y[:2] += amplitude * np.array([normal * sin + along * cos, normal * cos - along * sin])
    stretch, turn = normal + along_slope, normal_slope - along
    slope[:2] += amplitude * np.array([stretch * cos + turn * sin, turn * cos - stretch * sin])
    sol = CubicHermiteSpline(u, y, h * slope, axis=1)
    return StepResult(True, "sphere", 0.0, sol, h, 2.0 * tension, u[::20], np.zeros(40))


def first_mesh(previous: StepResult, tol: float, adapt: bool) -> Array:
    """The mesh on which to start a step: the previous one, thinned and refined ahead where `adapt`.

    A node goes where both its intervals have a residual below tol/100 (merging two raises it some 30 times) or are
    narrower than 1e-6: round-off in the residuals grows as 1/width, so such nodes, once made, breed more of them.
    Intervals above 0.7 tol, about to fail, are halved beforehand: cheaper than a second solve.
    """
    mesh, width = previous.mesh, np.diff(previous.mesh)
    if not adapt or previous.earlier is None:
        return mesh
    spare = (previous.residuals < 1e-2 * tol) | (width < 1e-6)
    keep, i = np.ones(mesh.size, bool), 1
    while i < mesh.size - 1:
        if spare[i - 1] and spare[i]:
            keep[i] = False
            i += 1  # two neighbours never go at once
        i += 1
    halve = (previous.residuals > 0.7 * tol) & (width > 2e-6)
    return np.union1d(mesh[keep], (mesh[:-1] + 0.5 * width)[halve])


def first_guess(previous: StepResult, mesh: Array, extrapolate: bool) -> tuple[Array, Array]:
    """Fields (11, m) and scalars (h, p) to start a step from."""
    fields, scalars = previous.sol(mesh), np.array([previous.h, previous.p])
    before = previous.earlier
    if not extrapolate or before is None or before.time == 0.0:  # v_u of the start is only a guess: no trend from it
        return fields, scalars
    return 2.0 * fields - before.sol(mesh), 2.0 * scalars - np.array([before.h, before.p])


def backward_euler_step(previous: StepResult, dt: float, tol: float, peer: Peer = TUNED) -> StepResult:
    """One implicit step from `previous`, warm-started from it. Failure is in `success` and `message`, never raised.

    A step that runs out of time keeps the fields of `previous`; one that runs out of nodes, the last iterate.
    """
    par, ends = peer.parameters, peer.ends
    wall, cpu = time.perf_counter(), time.process_time()
    remembered = PPoly(np.ascontiguousarray(previous.sol.c[:, :, REMEMBERED]), previous.sol.x)
    at_ends = remembered(np.array(ends.interval))

    def fun(u: Array, y: Array, s: Array) -> Array:
        if time.perf_counter() - wall > peer.step_seconds:
            raise _OutOfTime
        return right_hand_side(u, y, s, remembered(u).T, dt, par)

    def jacobian(u: Array, y: Array, s: Array) -> tuple[Array, Array]:
        return complex_step_jacobian(u, y, s, remembered(u).T, dt, par)

    def conditions(ya: Array, yb: Array, s: Array) -> Array:
        rates = (np.array([ya[:2], yb[:2]]) - at_ends[:, :2]) / dt
        return end_conditions(ya, yb, s, ends, par, rates)

    mesh = first_mesh(previous, tol, peer.adapt_mesh)
    fields, scalars = first_guess(previous, mesh, peer.extrapolate)
    fun_jac = jacobian if peer.exact_jacobian else None
    result = replace(previous, success=False, message=f"not solved within {peer.step_seconds:g} s", iterations=0)
    try:
        out = solve_bvp(fun, conditions, mesh, fields, scalars, fun_jac=fun_jac, tol=tol, max_nodes=peer.max_nodes)
        result = StepResult(
            success=out.status == 0,
            message=out.message,
            time=previous.time + dt,
            sol=out.sol,
            h=float(out.p[0]),
            p=float(out.p[1]),
            mesh=out.x,
            residuals=out.rms_residuals,
            iterations=out.niter,
            earlier=replace(previous, earlier=None),
        )
    except _OutOfTime:
        pass
    return replace(result, seconds=time.perf_counter() - wall, cpu_seconds=time.process_time() - cpu)


def march(n_steps: int, dt: float = TIME_STEP, tol: float = 1e-3, peer: Peer = TUNED) -> Iterator[StepResult]:
    """Step after step from the sphere; the step that fails, if any, is the last one."""
    state = sphere_start(peer)
    for _ in range(n_steps):
        state = backward_euler_step(state, dt, tol, peer)
        yield state
        if not state.success:
            return


def passive_decay_rate(peer: Peer = TUNED, dt: float = TIME_STEP, tol: float = 1e-6, amplitude: float = 1e-3) -> float:
    """Rate of the l = 2 mode of the passive sphere, backward Euler undone; exact: -37.00489 (gamma 9, Gamma 0.09)."""
    passive = replace(peer, parameters=replace(peer.parameters, active_tension=0.0, ring_amplitude=0.0))
    radii: list[Array] = []
    for sign in (1.0, -1.0):  # the difference of the two leaves out the even orders and the hole
        first = backward_euler_step(sphere_start(passive, sign * amplitude), dt, tol, passive)
        radii.append(np.array([first.neck_radius, backward_euler_step(first, dt, tol, passive).neck_radius]))
    before, after = radii[0] - radii[1]
    return float((1.0 - before / after) / dt)


def print_checks(peer: Peer) -> None:
    """Two exact results: the sphere without a ring is at rest at p = 2 T, and a passive one relaxes at a known rate."""
    still = replace(peer, parameters=replace(peer.parameters, ring_amplitude=0.0))
    start = sphere_start(still)
    step = backward_euler_step(start, TIME_STEP, 1e-6, still)
    drift = abs(step.neck_radius - start.neck_radius) / TIME_STEP
    print(f"  sphere at rest: |dr/dt| = {drift:.1e}, p/2T - 1 = {step.p / start.p - 1.0:.1e}")
    print(f"  passive l = 2 rate: {passive_decay_rate(peer):.5f} (exact -37.00489)")


def print_run(n_steps: int, tol: float, peer: Peer) -> None:
    """March and print every tenth step, the totals, and how the run ended."""
    print("    t      r(1/2)        h            p           nodes  meshes  seconds   cpu s")
    results: list[tuple[float, float, int]] = []
    for i, step in enumerate(march(n_steps, TIME_STEP, tol, peer), start=1):
        results.append((step.seconds, step.cpu_seconds, step.nodes))
        if not step.success:
            print(f"  step {i} failed after {step.seconds:.1f} s with {step.nodes} nodes: {step.message}")
        elif i % 10 == 0 or i == 1 or i == n_steps:
            print(
                f"  {step.time:.3f}  {step.neck_radius:.9f}  {step.h:.8f}  {step.p:.8f}  "
                f"{step.nodes:6d}  {step.iterations:6d}  {step.seconds:7.3f}  {step.cpu_seconds:6.3f}",
                flush=True,
            )
    seconds, cpu, nodes = np.array(results).T
    print(f"  {len(results)} steps in {seconds.sum():.1f} s ({cpu.sum():.1f} s of CPU), <= {nodes.max():.0f} nodes;")
    print(f"  per step: mean {seconds.mean():.4f} s, median {np.median(seconds):.4f} s, worst {seconds.max():.3f} s")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables: each set-up at each tolerance."""
    parser = argparse.ArgumentParser(
        description="Guided division by scipy.integrate.solve_bvp, backward Euler, dt = 1e-3."
    )
    parser.add_argument("--steps", type=int, default=250, help="time steps of 1e-3 (the neck closes near step 190)")
    parser.add_argument("--tol", type=float, action="append", help="tolerance of solve_bvp; default 1e-3 and 1e-6")
    parser.add_argument("--setup", choices=("tuned", "usual", "both"), default="both")
    parser.add_argument("--check", action="store_true", help="first compare with exact results")
    options = parser.parse_args(arguments)
    for name, peer in (("tuned", TUNED), ("usual", USUAL)):
        if options.setup not in (name, "both"):
            continue
        if options.check:
            print(f"{name} set-up against exact results")
            print_checks(peer)
        for tol in options.tol or TOLERANCES:
            print(f"{name} set-up, tol {tol:g}, at most {MAX_NODES} nodes and {STEP_SECONDS:g} s a step")
            print_run(options.steps, tol, peer)


if __name__ == "__main__":
    main()
