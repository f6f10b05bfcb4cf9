"""The equations derived by differentiation of one density agree with the paper's explicit ones, on arbitrary states.

A state is a set of random Taylor polynomials in u about random points, with r' = h cos(psi), a' = r h and rates that
keep these, and nothing else: no balance holds, so whole expressions are compared, not zeros.
"""

from collections.abc import Callable
from functools import cache
from math import factorial
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.exact import paper_equations as paper

from shapespace.base.arrays import Array, Traced
from shapespace.geometry.curve import Geometry
from shapespace.geometry.motion import Rates, coordinate_flow
from shapespace.geometry.parameterization import eulerian_rates, lagrangian_rates
from shapespace.models import closed_surface, open_membrane
from shapespace.physics.activity import ActiveTension
from shapespace.physics.force import Pressure
from shapespace.physics.tension import Incompressibility
from shapespace.physics.term import AbstractTerm, Site
from shapespace.physics.viscosity import BulkViscosity
from shapespace.variational.rayleighian import density
from shapespace.variational.surface import SurfaceSystem

SYSTEMS = {"closed": closed_surface.RECIPE.system(azimuthal=True), "open": open_membrane.RECIPE.system(azimuthal=True)}
SEEDS = (0, 1, 2)
POINTS = 40
ORDER = 6
TOLERANCE = 1e-10
# Each function runs a few times only: compiling it costs far more than running it.
CHEAP = {"xla_backend_optimization_level": 0, "xla_disable_hlo_passes": "fusion"}

FREE = ("h", "psi", "z", "r_t", "z_t", "v", "v_phi", "c", "c_t", "gamma", "moment", "alpha", "beta")
FORCES = ("meridional_force", "azimuthal_force", "species_flux")

Series = dict[str, Array]
"""Taylor coefficients about each point, (ORDER + 1, POINTS), by name."""


def product(a: Array, b: Array) -> Array:
    """Coefficients of a b."""
    return np.array([sum(a[k] * b[n - k] for k in range(n + 1)) for n in range(ORDER + 1)])


def slope(a: Array) -> Array:
    """Coefficients of a'; the last is unknown and set to 0."""
    return np.array([(n + 1) * a[n + 1] for n in range(ORDER)] + [0 * a[0]])


def antiderivative(a: Array, start: Array) -> Array:
    """Coefficients of the integral of a that begins at `start`."""
    return np.array([start, *(a[n] / (n + 1) for n in range(ORDER))])


def sine_and_cosine(a: Array) -> tuple[Array, Array]:
    """Coefficients of sin(a) and cos(a), from sin' = a' cos and cos' = -a' sin."""
    sin, cos = [np.sin(a[0])], [np.cos(a[0])]
    for n in range(1, ORDER + 1):
        sines = sum(k * a[k] * cos[n - k] for k in range(1, n + 1)) / n
        cosines = -sum(k * a[k] * sin[n - k] for k in range(1, n + 1)) / n
        sin.append(sines)
        cos.append(cosines)
    return np.array(sin), np.array(cos)


def reciprocal(a: Array) -> Array:
    """Coefficients of 1/a."""
    found = [1 / a[0]]
    for n in range(1, ORDER + 1):
        found.append(-sum(a[k] * found[n - k] for k in range(1, n + 1)) / a[0])
    return np.array(found)


def random_series(seed: int, *, uniform_length: bool) -> tuple[Series, Array]:
    """A state, and the points u it belongs to."""
    rng = np.random.default_rng(seed)
    decay = np.array([1 / factorial(n) for n in range(ORDER + 1)])[:, None]
    q = {name: decay * rng.normal(size=(ORDER + 1, POINTS)) for name in (*FREE, *FORCES)}
    q["psi"][0] = rng.uniform(-np.pi, np.pi, POINTS)
    q["h"][0], q["c"][0] = rng.uniform(0.5, 1.5), rng.uniform(0.3, 3.0, POINTS)
    if uniform_length:
        q["h"][1:] = 0.0
    sin, cos = sine_and_cosine(q["psi"])
    q["r"] = antiderivative(product(q["h"], cos), rng.uniform(0.4, 2.0, POINTS))
    q["area"] = antiderivative(product(q["r"], q["h"]), rng.uniform(0.0, 1.2, POINTS))
    q["v_n"] = product(sin, q["r_t"]) + product(cos, q["z_t"])
    dr_t, dz_t = slope(q["r_t"]), slope(q["z_t"])
    q["psi_t"] = -product(reciprocal(q["h"]), product(dr_t, sin) + product(dz_t, cos))
    q["h_t"] = product(dr_t, cos) - product(dz_t, sin)
    q["element"] = product(q["r"], q["h"])
    q["element_t"] = product(q["r_t"], q["h"]) + product(q["r"], q["h_t"])
    q["amount_t"] = product(q["c_t"], q["element"]) + product(q["c"], q["element_t"])
    return q, rng.uniform(size=POINTS)


def random_parameters(system: SurfaceSystem, seed: int) -> dict[str, float]:
    """Positive random constants, with a coat and a pulled patch whose edges lie within the surface; p and v0 too."""
    rng = np.random.default_rng(100 + seed)
    values = {name: float(rng.uniform(0.5, 2.0)) for name in system.parameters}
    patches = {"coat_area": 0.4, "coat_sharpness": 2.5, "pulled_area": 0.7, "pulled_sharpness": 1.5}
    return values | {name: value for name, value in patches.items() if name in values} | {"p": -0.7, "v0": 0.3}


class Case(NamedTuple):
    """A state in the paper's terms; `at` holds values and derivatives (d, dd, ddd) by name."""

    shape: paper.Shape
    flow: paper.Flow
    material: paper.Material
    at: dict[str, Array]
    c: dict[str, float]


def make_case(kind: str, q: Series, c: dict[str, float]) -> Case:
    """Values at the points from Taylor coefficients."""
    at = {"d" * n + name: factorial(n) * a[n] for name, a in q.items() for n in range(4)}
    zero = np.zeros(POINTS)
    common = {"kappa": c["bending_rigidity"], "eta_s": c["shear_viscosity"], "friction": c["friction"]}
    common["f_phi"] = c["friction"] * c["rotation_rate"] * at["r"]
    if kind == "closed":
        C0 = (c["spontaneous_curvature"] + zero, zero, zero)
        active = paper.active_tension(c["active_tension"], c["saturation_concentration"], at["c"], at["dc"])
        material = paper.Material(
            **common, eta_b=c["bulk_viscosity"], gamma=c["tension"] + zero, dgamma=zero,
            active=active[0], dactive=active[1], f_n=c["p"] + zero, f_u=zero,
        )  # fmt: skip
    else:
        coat = paper.patch(c["spontaneous_curvature"], c["coat_area"], c["coat_sharpness"], at["area"])
        C0 = (coat[0], coat[1] * at["darea"], coat[2] * at["darea"] ** 2 + coat[1] * at["ddarea"])
        total = np.log1p(np.exp(2 * c["pulled_sharpness"] * c["pulled_area"])) / (2 * c["pulled_sharpness"])
        f_z = paper.patch(c["pulling_force"] / (2 * np.pi * total), c["pulled_area"], c["pulled_sharpness"], at["area"])
        material = paper.Material(
            **common, eta_b=0.0, gamma=at["gamma"], dgamma=at["dgamma"], active=zero, dactive=zero,
            f_n=f_z[0] * np.cos(at["psi"]), f_u=-f_z[0] * np.sin(at["psi"]),
        )  # fmt: skip
    shape = paper.Shape(*(at[n] for n in ("r", "psi", "dpsi", "ddpsi", "dddpsi", "h", "dh", "ddh")), *C0)
    flow = paper.Flow(*(at["d" * n + name] for name in ("v_n", "v", "v_phi") for n in range(3)))
    return Case(shape, flow, material, at, c)


def stack(q: Series, names: tuple[str, ...]) -> Traced:
    """Coefficients (POINTS, fields, ORDER + 1) of the named series."""
    return jnp.asarray(np.stack([q[name].T for name in names], axis=1))


def parameter_vector(system: SurfaceSystem, c: dict[str, float]) -> Traced:
    """The constants in the system's order."""
    return jnp.asarray([c[name] for name in system.parameters])


Point = tuple[Traced, Traced, Traced, Traced, Traced]
"""dy, y, algebraic, scalars, dq: what the system takes at a point."""


@cache
def compiled(kind: str) -> Callable[..., dict[str, Any]]:
    """Rows of the first-order system, dR/dw, d/du(dR/dw') - dR/dw, and the species' balance, at one point each."""
    system = SYSTEMS[kind]

    def at(here: Point, ahead: Point, u: Traced, p: Traced) -> dict[str, Any]:
        (force, _), (_, fluxes) = jax.jvp(lambda *x: system.variation(*x, p), here, ahead)
        found = {"rows": system.equations(*here, u, p), "force": force}
        found["balance"] = jax.tree.map(jnp.subtract, fluxes, force)
        dy, y, a, s, dq = here
        found["ends"] = system.end_conditions(y, y, s, dq, dq, p)
        if system.species is not None:
            species = system.species(system.named(p))

            def carried(dy: Traced, y: Traced, a: Traced, s: Traced, dq: Traced) -> Traced:
                return species.flux(system.site(dy, y, a, s, dq), system.field_values(dy)["c"])

            source = species.source(system.site(dy, y, a, s, dq), u)
            found["species"] = jax.jvp(carried, here, ahead)[1] + dq[4] - source
        return found

    return jax.jit(jax.vmap(at, in_axes=(0, 0, 0, None)), compiler_options=CHEAP)


def derived(kind: str, q: Series, u: Array, c: dict[str, float]) -> dict[str, Any]:
    """What the system makes of a state with h' = 0; z is stored in the frame that moves at v0."""
    system = SYSTEMS[kind]
    y, w = stack(q, system.fields), stack(q, ("r_t", "z_t", "psi_t", "h_t", "amount_t"))
    if "v0" in system.scalars:
        w = w.at[:, 1, 0].add(-c["v0"])
    gamma = stack(q, ("gamma",))
    s = jnp.tile(jnp.asarray([{**c, "h": q["h"][0, 0]}[name] for name in system.scalars]), (POINTS, 1))
    here = (y[..., 1], y[..., 0], gamma[..., 0], s, w[..., 0])
    ahead = (2 * y[..., 2], y[..., 1], gamma[..., 1], 0 * s, w[..., 1])
    return jax.device_get(compiled(kind)(here, ahead, jnp.asarray(u), parameter_vector(system, c)))


def assert_agree(found: Any, expected: Array, size: Array | float = 0.0) -> None:
    """At every point equal to TOLERANCE of the value, of the `size` of its terms, or of 1."""
    assert np.shape(found) == np.shape(expected) == (POINTS,)
    error = np.abs(np.asarray(found) - expected) / np.maximum(1.0, np.abs(expected) + size)
    assert error.max() < TOLERANCE


@pytest.fixture(params=[(kind, seed) for kind in SYSTEMS for seed in SEEDS], ids=str)
def states(request: pytest.FixtureRequest) -> tuple[str, Case, Array, dict[str, Any]]:
    """A state with h' = 0 in the paper's terms, its points, and what the derived system makes of it."""
    kind, seed = request.param
    q, u = random_series(seed, uniform_length=True)
    c = random_parameters(SYSTEMS[kind], seed)
    return kind, make_case(kind, q, c), u, derived(kind, q, u, c)


def reference_concentration(c: dict[str, float], u: Array) -> Array:
    """c0hat(u)."""
    return paper.ring(c["reference_concentration"], c["ring_amplitude"], c["ring_width"], u)


def test_first_order_system(states):
    """Every row: (dur, duz, vardpsidt, alphaprime, betaprime, Tuu, Tup, divTu, divTp, cdt, divvexp)."""
    kind, (s, f, m, at, c), u, found = states
    td, (cot, _), rh = paper.dissipative_tension(s, f, m), paper.cotangent(s), s.r * s.h
    coat = paper.f_kappa(s, m)["C0"] * s.dC0 * s.r
    expected = [
        0 * s.r,
        at["dz"] + s.h * np.sin(s.psi),
        at["moment"] - paper.moment(s, m),
        at["dmoment"] - paper.moment_prime(s, m, at["alpha"], at["beta"]),
        at["dalpha"] - paper.alpha_prime(s, f, m),
        at["dbeta"] - paper.beta_prime(s, f, m),
        at["meridional_force"] - s.r * (td.uu + m.gamma),
        at["dmeridional_force"] - ((td.pp + m.gamma) * cot + m.friction * f.v_u - m.f_u) * rh + coat,
        at["azimuthal_force"] - s.r * td.up,
        at["dazimuthal_force"] + (td.up * cot - m.friction * f.v_phi + m.f_phi) * rh,
    ]
    if kind == "open":
        expected += [0 * s.r, paper.divergence(s, f)]
    else:
        drift = at["c"] * s.h * paper.coordinate_flow(s, f, at["r_t"], at["z_t"]) - c["diffusivity"] * at["dc"] / s.h
        source = c["turnover_rate"] * (reference_concentration(c, u) - at["c"]) * rh
        expected += [at["species_flux"] - s.r * drift, at["dspecies_flux"] + at["amount_t"] - source]
    for row, value in zip(found["rows"].T, expected, strict=True):
        assert_agree(row, value)


def test_meridional_and_azimuthal_balance(states):
    """P' - dR/dw = r h times (varivu), and (vphi) with eta_s and the sign of its Euler-Lagrange line corrected."""
    _, (s, f, m, _, _), _, found = states
    rh = s.r * s.h
    assert_agree(found["balance"].meridional_velocity, rh * paper.meridional_balance(s, f, m))
    assert_agree(found["balance"].azimuthal_velocity, rh * paper.azimuthal_balance(s, f, m))


def test_moment_and_length_balance(states):
    """P_psi' - dR/dpsi_t = (kappa r/h) (psi'' - the paper's psi'') by (vardpsidt); dR/dh_t = zeta' by (vardhdt)."""
    _, (s, _, m, at, _), _, found = states
    assert_agree(found["balance"].psi, m.kappa * s.r / s.h * (at["ddpsi"] - paper.ddpsi(s, m, at["alpha"], at["beta"])))
    assert_agree(found["force"].h, paper.zeta_prime(s, m, at["alpha"], at["beta"]))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", SYSTEMS)
def test_multipliers_of_the_paper_solve_the_constrained_equations(kind: str, seed: int):
    """With (alpha, beta): zeta' = 0, psi'' is the state's own, the tangential combination of the equations for alpha'
    and beta' holds on any shape (hence zeta'' = 0), the other one is r h (n . div T + f_n), also as (betaprime2)."""
    q, u = random_series(seed, uniform_length=True)
    c = random_parameters(SYSTEMS[kind], seed)
    s, f, m, _, _ = make_case(kind, q, c)
    pairs = zip(paper.multipliers(s, m), paper.multiplier_slopes(s, m), strict=True)
    q |= {name: np.array([*next(pairs), *0 * q["r"][2:]]) for name in ("alpha", "beta")}
    found = derived(kind, q, u, c)
    sin, cos, rh, size = np.sin(s.psi), np.cos(s.psi), s.r * s.h, np.abs(q["alpha"][:2]).max(axis=0)
    assert_agree(found["force"].h, 0 * sin, size)
    assert_agree(found["balance"].psi, 0 * sin, size)
    radial, axial = found["rows"].T[4:6]
    assert_agree(radial * cos - axial * sin, 0 * sin, size)
    assert_agree(radial * sin + axial * cos, rh * paper.normal_balance(s, f, m), size)
    assert_agree(axial, rh * cos * paper.beta_balance(s, f, m), size)


def test_species_balance_is_the_advective_one(states):
    """N' + d(c r h)/dt - source = r h (dc/dt - the paper's dc/dt) by (cdt, quryv, divvexp, c0dyn)."""
    kind, (s, f, _, at, c), u, found = states
    if kind == "closed":
        constants = c["diffusivity"], c["turnover_rate"], reference_concentration(c, u)
        species = paper.Species(at["c"], at["dc"], at["ddc"], *constants)
        q = paper.coordinate_flow(s, f, at["r_t"], at["z_t"])
        assert_agree(found["species"], s.r * s.h * (at["c_t"] - paper.concentration_rate(s, f, q, species)))


def test_end_conditions(states):
    """(Table 3) and the gauge; the rim's gamma_H = gamma_0 through P_v with S_uu = -S_phiphi."""
    kind, (s, f, m, at, c), _, found = states
    n, force = at["species_flux"], at["meridional_force"]
    if kind == "closed":
        expected = [s.r, s.r, at["beta"], at["beta"], s.psi, s.psi - np.pi, f.v_u, f.v_u, f.v_phi, f.v_phi, n, n]
        expected += [0 * at["alpha"], 2 * at["z"]]
    else:
        force = force - s.r * (c["boundary_tension"] - 2 * m.eta_s * paper.strain_rate(s, f)[1])
        expected = [s.r, s.r - c["base_radius"], at["beta"], at["z"], s.psi, s.psi, f.v_u, force, f.v_phi, f.v_phi]
        expected += [at["alpha"], at["area"]]
    for row, value in zip(found["ends"].T, expected, strict=True):
        assert_agree(row, value)


def mixed_rates(g: Geometry, v: Traced, dv: Traced, share: Traced) -> Rates:
    """Rates for q^u = share v^u: Eulerian at 1, Lagrangian at 0."""
    eulerian = eulerian_rates(g, v[0], dv[0], v[1], v[2])
    lagrangian = lagrangian_rates(g, v[0], dv[0], v[1], dv[1], v[2])
    return jax.tree.map(lambda a, b: share * a + (1 - share) * b, eulerian, lagrangian)


SHAPE, VELOCITY = ("r", "psi", "dpsi", "h", "area", "c", "gamma"), ("v_n", "v", "v_phi")


def taylor(coefficients: Traced, x: Traced) -> Traced:
    """Values of the polynomials with the coefficients (fields, terms) at the distance x, exact to x^3."""
    return coefficients[:, 0] + x * (coefficients[:, 1] + x * (coefficients[:, 2] + x * coefficients[:, 3]))


def all_terms(c: dict[str, float], gamma: Traced) -> tuple[AbstractTerm, ...]:
    """The terms of both models and the constraints, each once."""
    p = SimpleNamespace(**c)
    activity = ActiveTension(p.active_tension, p.saturation_concentration)
    constraints = (BulkViscosity(p.bulk_viscosity), Pressure(p.p), Incompressibility(gamma))
    return (*open_membrane.terms(p), activity, *constraints)


@cache
def unconstrained() -> Callable[..., tuple[Traced, ...]]:
    """Euler-Lagrange expressions of the density over (v_n, v_u, v_phi); dR/dv and dR/dv' - [dR/dv'']'."""

    def at(shape: Traced, velocity: Traced, c: dict[str, Traced], share: Traced) -> tuple[Traced, ...]:
        def power(jet: Traced, x: Traced) -> Traced:
            def moved(e: Traced) -> Rates:
                v, dv = jet[:, 0] + e * jet[:, 1] + e**2 / 2 * jet[:, 2], jet[:, 1] + e * jet[:, 2]
                return mixed_rates(Geometry(*taylor(shape[:5], x + e)), v, dv, share)

            rates, gradients = jax.jvp(moved, (jnp.zeros(()),), (jnp.ones(()),))
            *here, concentration, gamma = taylor(shape, x)
            return density(all_terms(c, gamma), Site(Geometry(*here), rates, gradients, concentration))

        def momenta(x: Traced) -> Traced:
            jet = jnp.stack([taylor(v, x) for v in velocity], axis=1)
            return jax.grad(power)(jet, x)

        def slopes(x: Traced) -> tuple[Traced, Traced]:
            return jax.jvp(momenta, (x,), (jnp.ones(()),))

        (value, first), (_, second) = jax.jvp(slopes, (jnp.zeros(()),), (jnp.ones(()),))
        return value[:, 0] - first[:, 1] + second[:, 2], value[:, 0], value[:, 1] - first[:, 2]

    return jax.jit(jax.vmap(at, in_axes=(0, 0, None, None)), compiler_options=CHEAP)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_force_balance_in_other_parameterizations(share: float):
    """Where h depends on u: variation over v_n gives -r h (n . div T + f_n) with (divTen), over v_u and v_phi the
    tangential balances; also (dRdvn) times r h, less f_n, and (dRddvn) with its sign corrected."""
    q, _ = random_series(7, uniform_length=False)
    c = {name: value for system in SYSTEMS.values() for name, value in random_parameters(system, 7).items()}
    (s, f, m, _, _), closed = make_case("open", q, c), make_case("closed", q, c).material
    m = m._replace(eta_b=closed.eta_b, active=closed.active, dactive=closed.dactive, f_n=m.f_n + c["p"])
    velocity = [stack(q, VELOCITY)]
    for _ in range(2):
        velocity.append(jnp.pad(velocity[-1][..., 1:] * jnp.arange(1, ORDER + 1), ((0, 0), (0, 0), (0, 1))))
    coefficients = stack(q | {"dpsi": slope(q["psi"])}, SHAPE), jnp.stack(velocity, axis=1)
    balance, first, second = (np.asarray(x) for x in unconstrained()(*coefficients, c, share))
    rh, te, td = s.r * s.h, paper.equilibrium_tension(s, m), paper.dissipative_tension(s, f, m)
    assert_agree(balance[:, 0], -rh * paper.normal_balance(s, f, m))
    assert_agree(balance[:, 1], -rh * paper.meridional_balance(s, f, m))
    assert_agree(balance[:, 2], -rh * paper.azimuthal_balance(s, f, m))
    cu, cp = paper.c_uu(s)[0], paper.c_pp(s)[0]
    assert_agree(first[:, 0], rh * (cu * (te.uu + td.uu) + cp * (te.pp + td.pp) - m.f_n))
    assert_agree(second[:, 0], s.r * te.n)


def test_rates_of_the_parameterizations():
    """Eulerian and Lagrangian rates, and any in between, against (dtr, dtz, dth, dtpsi, dtpsipr corrected)."""
    q, _ = random_series(8, uniform_length=False)
    s, f, _, at, _ = make_case("open", q, random_parameters(SYSTEMS["open"], 8))
    g = Geometry(s.r, s.psi, s.dpsi, s.h, at["area"])
    zero = np.zeros(POINTS)
    w, dw = f.v_u / s.h, f.dv_u / s.h - f.v_u * s.dh / s.h**2
    for found, expected in (
        (eulerian_rates(g, f.v_n, f.dv_n, f.v_u, f.v_phi), paper.kinematics(s, f, zero, zero)),
        (lagrangian_rates(g, f.v_n, f.dv_n, f.v_u, f.dv_u, f.v_phi), paper.kinematics(s, f, w, dw)),
    ):
        for name in ("r", "z", "psi", "h"):
            assert_agree(getattr(found, name), expected[name])
        assert_agree(coordinate_flow(g, found), s.h * paper.coordinate_flow(s, f, expected["r"], expected["z"]))
    sin, cos = sine_and_cosine(q["psi"])
    slip = product(reciprocal(q["h"]), product(cos, q["r_t"]) - product(sin, q["z_t"]))
    found = paper.kinematics(s, f, slip[0], slip[1])
    for name in ("r", "z", "psi", "h"):
        assert_agree(found[name], at[name + "_t"])
    assert_agree(found["c_uu"], at["dpsi_t"] / s.h - s.dpsi * at["h_t"] / s.h**2)
