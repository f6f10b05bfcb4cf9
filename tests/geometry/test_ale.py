"""The identities of App. B and C on surfaces without symmetry that move as they like: metric, curvature, area, transport.

A motion X(s, t) of a surface is a formula; its mesh is carried by the coordinates s. Matter moves at v = dX/dt + q with any
coordinate flow q^i. All tensors come from derivatives of X, none from the package.
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.testing import assert_allclose

Tensor = Any
POINTS = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 2))
TIMES = (0.0, 0.3)
# Each function runs once: compiling it costs far more than running it.
CHEAP = {"xla_backend_optimization_level": 0, "xla_disable_hlo_passes": "fusion"}


def place(s: Tensor, t: Tensor) -> Tensor:
    """X: a patch that bends, shears, swells and drifts."""
    x, y = s
    bump = jnp.sin(x + 0.4 * t) * jnp.cos(0.7 * y - t) + 0.3 * x * y * t
    return jnp.array([x + 0.2 * y * t + 0.1 * t**2, (1.0 + 0.3 * t) * y + 0.1 * x**2, bump])


def flow(s: Tensor, t: Tensor) -> Tensor:
    """q^i, contravariant."""
    x, y = s
    return jnp.array([0.5 * jnp.cos(y) + 0.2 * x * t, jnp.sin(x * y) - 0.3 * t])


def density(s: Tensor, t: Tensor) -> Tensor:
    """f, what is transported."""
    return 1.3 + jnp.sin(s[0] - t) * s[1]


def tangents(s: Tensor, t: Tensor) -> Tensor:
    """e_i, (2, 3)."""
    return jax.jacfwd(place)(s, t).T


def normal(s: Tensor, t: Tensor) -> Tensor:
    e = tangents(s, t)
    n = jnp.cross(e[0], e[1])
    return n / jnp.linalg.norm(n)


def metric(s: Tensor, t: Tensor) -> Tensor:
    """g_ij."""
    e = tangents(s, t)
    return e @ e.T


def curvature(s: Tensor, t: Tensor) -> Tensor:
    """C_ij = -n . d_i d_j X."""
    return -jnp.einsum("kij,k->ij", jax.jacfwd(jax.jacfwd(place))(s, t), normal(s, t))


def area(s: Tensor, t: Tensor) -> Tensor:
    """sqrt(g)."""
    return jnp.sqrt(jnp.linalg.det(metric(s, t)))


def velocity(s: Tensor, t: Tensor) -> Tensor:
    """v = dX/dt + q^i e_i (ExpGenDyn)."""
    return jax.jacfwd(place, 1)(s, t) + flow(s, t) @ tangents(s, t)


def relative(s: Tensor, t: Tensor) -> Tensor:
    """w_i = v_i - q_i, covariant."""
    return tangents(s, t) @ velocity(s, t) - metric(s, t) @ flow(s, t)


def normal_speed(s: Tensor, t: Tensor) -> Tensor:
    return normal(s, t) @ velocity(s, t)


def christoffel(s: Tensor, t: Tensor) -> Tensor:
    """Gamma[k, i, j] = e^k . d_i e_j."""
    e = tangents(s, t)
    return jnp.einsum("km,mn,nij->kij", jnp.linalg.inv(metric(s, t)), e, jax.jacfwd(jax.jacfwd(place))(s, t))


def gradient(field: Any, s: Tensor, t: Tensor) -> Tensor:
    """nabla_i w_j, indices (i, j), of a covariant vector field."""
    return jax.jacfwd(field)(s, t).T - jnp.einsum("kij,k->ij", christoffel(s, t), field(s, t))


def tensor_gradient(field: Any, s: Tensor, t: Tensor) -> Tensor:
    """nabla_k T_ij, indices (i, j, k)."""
    gamma, value = christoffel(s, t), field(s, t)
    return jax.jacfwd(field)(s, t) - jnp.einsum("lki,lj->ijk", gamma, value) - jnp.einsum("lkj,il->ijk", gamma, value)


@partial(jax.jit, compiler_options=CHEAP)
@jax.vmap
def both_sides(s: Tensor, t: Tensor) -> Tensor:
    """(dtgij), (dtCij), (dtg): rates at fixed s, and what the identities say."""
    g, c, v_n = metric(s, t), curvature(s, t), normal_speed(s, t)
    inverse, dw = jnp.linalg.inv(g), gradient(relative, s, t)
    mixed = inverse @ c
    carried = jnp.einsum("ijk,k->ij", tensor_gradient(curvature, s, t), inverse @ relative(s, t))
    turned = jnp.einsum("kj,ik->ij", mixed, dw)
    bent = gradient(jax.grad(normal_speed), s, t)
    dilation = jnp.trace(inverse @ dw) + jnp.trace(mixed) * v_n
    return {
        "metric": (jax.jacfwd(metric, 1)(s, t), dw + dw.T + 2 * c * v_n),
        "curvature": (jax.jacfwd(curvature, 1)(s, t), turned + turned.T + carried - bent + c @ mixed * v_n),
        "area": (jax.jacfwd(area, 1)(s, t), area(s, t) * dilation),
    }


def test_metric_curvature_and_area_element():
    times = jnp.array([TIMES[i % 2] for i in range(len(POINTS))])
    for name, (rate, expected) in both_sides(jnp.asarray(POINTS), times).items():
        assert float(jnp.abs(rate).max()) > 0.1
        assert_allclose(rate, expected, atol=1e-11, err_msg=name)


def integral(start: Tensor, t: Tensor) -> Tensor:
    """F(t) over the coordinate region that a fixed set of material elements, the unit square at t0, has come to.

    start: coordinates s(S, t) of material points S as a function on the square and time.
    """
    x, w = np.polynomial.legendre.leggauss(14)
    points = jnp.array(np.stack(np.meshgrid(0.5 * (x + 1), 0.5 * (x + 1)), axis=-1).reshape(-1, 2))
    weights = jnp.array(0.25 * np.outer(w, w).ravel())

    def at(material: Tensor) -> Tensor:
        s = start(material, t)
        return density(s, t) * area(s, t) * jnp.linalg.det(jax.jacfwd(start)(material, t))

    return weights @ jax.vmap(at)(points)


def test_transport():
    """(dtFfin2), (dtFfin3): d/dt of an integral over matter, in coordinates that know nothing of the matter."""
    t = TIMES[1]

    def material(s: Tensor, later: Tensor) -> Tensor:
        """s(S, t) to first order about t: it moves at the coordinate flow (qidyn)."""
        return s + flow(s, t) * (later - t)

    rate = jax.jit(jax.grad(lambda later: integral(material, later)), compiler_options=CHEAP)(t)

    def change(s: Tensor) -> Tensor:
        """(d(f sqrt g)/dt)/sqrt(g) + nabla_i (f q^i)."""
        local = jax.jacfwd(lambda time: density(s, time) * area(s, time))(t)
        carried = jax.jacfwd(lambda at: density(at, t) * area(at, t) * flow(at, t))(s)
        return (local + jnp.trace(carried)) / area(s, t)

    def total(s: Tensor) -> Tensor:
        """df/dt + f div v."""
        along = jax.jacfwd(density, 1)(s, t) + jax.grad(density)(s, t) @ flow(s, t)
        e, inverse = tangents(s, t), jnp.linalg.inv(metric(s, t))
        divergence = jnp.einsum("ij,ik,kj->", inverse, e, jax.jacfwd(velocity)(s, t))
        return along + density(s, t) * divergence

    for form in (change, total):
        x, w = np.polynomial.legendre.leggauss(14)
        points = jnp.array(np.stack(np.meshgrid(0.5 * (x + 1), 0.5 * (x + 1)), axis=-1).reshape(-1, 2))
        weights = jnp.array(0.25 * np.outer(w, w).ravel())
        found = weights @ jax.jit(jax.vmap(lambda s, form=form: form(s) * area(s, t)), compiler_options=CHEAP)(points)
        assert_allclose(found, rate, rtol=1e-10)
