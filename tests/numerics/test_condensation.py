"""The structured linear algebra against dense linear algebra: random systems, singular ones, stiff ones."""

from typing import NamedTuple

import numpy as np
import pytest

from shapespace.base.arrays import Array
from shapespace.numerics.condensation import Factors, determinant_sign, factorise, solve
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.transposed import solve_transposed


class Size(NamedTuple):
    """Elements N, Gauss points k, differential and algebraic fields, scalars, integral conditions."""

    elements: int
    degree: int
    n: int
    n_a: int
    n_s: int
    n_i: int


class System(NamedTuple):
    """Blocks by element and stage: points (N, k, m + n_i, m + n + n_s), ends (n_b, 2n + n_s), targets (n_i, n_s).

    jumps (N, n, n_s): scalars in continuity rows; nodes (N + 1, n_i, n): node values in integral rows.
    """

    size: Size
    widths: Array
    points: Array
    ends: Array
    targets: Array
    jumps: Array | None = None
    nodes: Array | None = None


SIZES = [
    Size(1, 2, 2, 1, 1, 0),
    Size(2, 2, 1, 0, 0, 0),
    Size(3, 2, 2, 1, 1, 1),
    Size(4, 3, 3, 0, 0, 0),
    Size(5, 3, 3, 0, 2, 1),
    Size(4, 4, 4, 2, 3, 2),
    Size(6, 5, 2, 3, 0, 0),
    Size(7, 3, 10, 0, 3, 1),
    Size(9, 6, 5, 1, 1, 0),
]


def random_system(size: Size, seed: int, filled: float = 1.0, spread: float = 0.0) -> System:
    """Random blocks; a share `filled` of their entries is not zero, and rows differ by up to 10^spread in scale."""
    rng = np.random.default_rng(seed)
    m = size.n + size.n_a
    columns = m + size.n + size.n_s
    points = rng.standard_normal((size.elements, size.degree, m + size.n_i, columns))
    points *= rng.random((m + size.n_i, columns)) < filled
    # Every equation has an unknown of its own: without it a sparse pattern may be singular.
    own = rng.permutation(m)
    points[:, :, np.arange(m), own] += 2.0 * np.where(rng.random(m) < 0.5, -1.0, 1.0)
    points *= 10.0 ** (spread * rng.uniform(-1.0, 1.0, (size.elements, size.degree, m + size.n_i, 1)))
    ends = rng.standard_normal((size.n + size.n_s - size.n_i, 2 * size.n + size.n_s))
    widths, targets = rng.uniform(0.2, 1.0, size.elements), rng.standard_normal((size.n_i, size.n_s))
    jumps = rng.standard_normal((size.elements, size.n, size.n_s))
    return System(
        size, widths, points, ends, targets, jumps, rng.standard_normal((size.elements + 1, size.n_i, size.n))
    )


def dense_matrix(system: System) -> Array:
    """The whole matrix, as condensation.py states it: columns nodes, stages (slope, algebraic), scalars."""
    s, (n_rows, columns) = system.size, system.points.shape[2:]
    rule, n, m = gauss_rule(s.degree), s.n, s.n + s.n_a
    stages, scalars = (s.elements + 1) * n, (s.elements + 1) * n + s.elements * s.degree * m
    size = scalars + s.n_s
    rows, integrals = [], np.zeros((s.n_i, size))
    integrals[:, scalars:] -= system.targets
    if system.nodes is not None:
        integrals[:, :stages] += system.nodes.transpose(1, 0, 2).reshape(s.n_i, stages)
    for e in range(s.elements):
        w, first = system.widths[e], stages + e * s.degree * m
        for j in range(s.degree):
            block = np.zeros((n_rows, size))
            a = system.points[e, j]
            block[:, first + j * m : first + (j + 1) * m] = a[:, :m]
            block[:, e * n : (e + 1) * n] = a[:, m : m + n]
            for l in range(s.degree):
                block[:, first + l * m : first + l * m + n] += w * rule.matrix[j, l] * a[:, m : m + n]
            block[:, scalars:] = a[:, m + n : columns]
            rows.append(block[:m])
            integrals += w * rule.weights[j] * block[m:]
    for e in range(s.elements):
        block = np.zeros((n, size))
        block[:, (e + 1) * n : (e + 2) * n], block[:, e * n : (e + 1) * n] = np.eye(n), -np.eye(n)
        for l in range(s.degree):
            at = stages + (e * s.degree + l) * m
            block[:, at : at + n] = -system.widths[e] * rule.weights[l] * np.eye(n)
        if system.jumps is not None:
            block[:, scalars:] = system.jumps[e]
        rows.append(block)
    ends = np.zeros((len(system.ends), size))
    ends[:, :n], ends[:, s.elements * n : stages] = system.ends[:, :n], system.ends[:, n : 2 * n]
    ends[:, scalars:] = system.ends[:, 2 * n :]
    return np.concatenate([*rows, ends, integrals])


def factors_of(system: System) -> Factors:
    """The factorisation under test."""
    rule = gauss_rule(system.size.degree)
    points = np.ascontiguousarray(system.points.transpose(2, 3, 1, 0))
    return factorise(
        system.widths,
        rule.matrix,
        rule.weights,
        points,
        system.ends,
        system.targets,
        system.size.n,
        system.jumps,
        system.nodes,
    )


def structured_solution(system: System, rhs: Array) -> Array:
    """x of `dense_matrix(system) @ x = rhs`, by the structured elimination."""
    s = system.size
    nodes, slopes, algebraic, scalars = np.split(
        solve(factors_of(system), rhs),
        np.cumsum([(s.elements + 1) * s.n, s.elements * s.degree * s.n, s.elements * s.degree * s.n_a]),
    )
    shape = (s.elements, s.degree, -1)
    parts = [part.reshape(shape) for part in (slopes, algebraic) if part.size]
    return np.concatenate([nodes, np.concatenate(parts, axis=2).ravel(), scalars])


def check_against_dense(system: System) -> None:
    """The defect is small beside |A| |x|, and the error small beside what the condition allows."""
    matrix = dense_matrix(system)
    rhs = np.random.default_rng(1).standard_normal(len(matrix))
    assert not factors_of(system).singular
    found, exact = structured_solution(system, rhs), np.linalg.solve(matrix, rhs)
    scale = (np.abs(matrix) @ np.abs(exact)).max() + np.abs(rhs).max()
    defect = np.abs(matrix @ found - rhs).max() / scale
    error = np.abs(found - exact).max() / np.abs(exact).max()
    condition = np.linalg.cond(matrix)
    message = f"defect {defect:.1e}, error {error:.1e}, condition {condition:.1e}"
    assert defect < 1e-11, message
    assert error < 1e-14 * condition + 1e-12, message


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize(("filled", "spread"), [(1.0, 0.0), (0.4, 0.0), (0.4, 4.0)])
def test_random_system(size: Size, filled: float, spread: float):
    for seed in range(3):
        check_against_dense(random_system(size, seed, filled, spread))


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("left", [0.0, 1e-9, 1e-5])
def test_pivots_that_vanish_on_single_elements(size: Size, left: float):
    """What is the largest entry of an equation on most elements is (nearly) nothing on one of them."""
    system = random_system(size, 5)
    m, element = size.n + size.n_a, size.elements // 2
    largest = np.abs(system.points[..., :m, :m]).min(axis=(0, 1)).argmax(axis=1)
    system.points[element, :, np.arange(m), largest] *= left
    check_against_dense(system)


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize(("filled", "left"), [(1.0, 1.0), (0.4, 1.0), (1.0, 1e-9)])
def test_transposed_solves(size: Size, filled: float, left: float):
    """b . J^-1 a = a . J^-T b, also where elements are eliminated on their own."""
    system = random_system(size, 7, filled)
    m, element = size.n + size.n_a, size.elements // 2
    largest = np.abs(system.points[..., :m, :m]).min(axis=(0, 1)).argmax(axis=1)
    system.points[element, :, np.arange(m), largest] *= left
    factors, rng, rows = factors_of(system), np.random.default_rng(0), len(dense_matrix(system))
    for a, b in rng.standard_normal((3, 2, rows)):
        copy, direct, adjoint = b.copy(), solve(factors, a), solve_transposed(factors, b)
        np.testing.assert_array_equal(copy, b)
        scale = np.abs(direct).max() * np.abs(b).sum() + np.abs(adjoint).max() * np.abs(a).sum()
        assert abs(b @ direct - a @ adjoint) < 1e-10 * scale


def test_two_right_hand_sides_through_one_factorisation():
    """Solving changes neither the factors nor the right-hand side."""
    system = random_system(SIZES[5], 2)
    factors, rng = factors_of(system), np.random.default_rng(0)
    rhs = rng.standard_normal(len(dense_matrix(system)))
    copy = rhs.copy()
    first, second = solve(factors, rhs), solve(factors, rhs)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(rhs, copy)


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_the_determinant_changes_sign_with_that_of_the_whole_matrix(size: Size):
    """The factor between the two signs belongs to the size, whatever was pivoted, exchanged or matched on the way."""
    products = set()
    for seed in range(12):
        system = random_system(size, seed, filled=0.5 + 0.5 * (seed % 2))
        products.add(np.linalg.slogdet(dense_matrix(system)).sign * determinant_sign(factors_of(system)))
    assert len(products) == 1
    assert abs(products.pop()) == 1.0


def test_a_pole_costs_no_digits():
    """r m' = m, m(1) = 1: m = r, which collocation follows exactly, although m(0) = 0 determines nothing."""
    size, widths = Size(40, 4, 1, 0, 0, 0), np.full(40, 1.0 / 40)
    u = np.cumsum(widths)[:, None] + widths[:, None] * (gauss_rule(4).points - 1.0)
    points = np.stack([u, -np.ones_like(u)], axis=-1)[:, :, None]
    system = System(size, widths, points, np.array([[0.0, 1.0]]), np.zeros((0, 0)))
    rhs = np.zeros(40 * 4 + 40 + 1)
    rhs[-1] = 1.0
    nodes = structured_solution(system, rhs)[:41]
    np.testing.assert_allclose(nodes, np.linspace(0.0, 1.0, 41), atol=1e-14)


def broken(kind: str, size: Size) -> System:
    """A system without a unique solution."""
    system = random_system(size, 3)
    points, ends, targets = system.points.copy(), system.ends.copy(), system.targets.copy()
    m = size.n + size.n_a
    if kind == "equation missing on one element":
        points[size.elements // 2, 0, 0] = 0.0
    elif kind == "equation twice":
        points[:, :, 1] = points[:, :, 0]
    elif kind == "algebraic field free":
        points[:, :, :, m - 1] = 0.0
    elif kind == "end condition missing":
        ends[0] = 0.0
    elif kind == "end condition twice":
        ends[1] = ends[0]
    elif kind == "scalar free":
        points[..., m + size.n :], ends[:, 2 * size.n :], targets[:], system.jumps[:] = 0.0, 0.0, 0.0, 0.0
    else:
        points[size.elements - 1, -1, 0, 0] = float(kind)
    return system._replace(points=points, ends=ends, targets=targets)


KINDS = (
    "equation missing on one element",
    "equation twice",
    "algebraic field free",
    "end condition missing",
    "end condition twice",
    "scalar free",
    "nan",
    "inf",
)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [Size(4, 3, 3, 1, 1, 1), Size(2, 2, 2, 1, 2, 0)], ids=str)
def test_singular_systems_are_flagged(kind: str, size: Size):
    assert factors_of(broken(kind, size)).singular


@pytest.mark.parametrize("mixed", [False, True])
def test_a_repeated_condition_is_flagged(mixed: bool):
    """y'' = 0 with y' given at both ends leaves y free. In mixed unknowns no pivot vanishes exactly, only to round-off."""
    rng = np.random.default_rng(0)
    mix = rng.standard_normal((2, 2)) if mixed else np.eye(2)
    rates = mix @ np.array([[0.0, 1.0], [0.0, 0.0]]) @ np.linalg.inv(mix)
    slope = np.linalg.inv(mix)[1]
    size, widths = Size(12, 4, 2, 0, 0, 0), rng.uniform(0.5, 1.5, 12)
    points = np.broadcast_to(np.concatenate([np.eye(2), -rates], axis=1), (12, 4, 2, 4)).copy()
    ends = np.array([[*slope, 0.0, 0.0], [0.0, 0.0, *slope]])
    assert factors_of(System(size, widths / widths.sum(), points, ends, np.zeros((0, 0)))).singular


def layers(elements: int, thickness: float) -> System:
    """thickness^2 y'' = y as y1' = y2/thickness, y2' = y1/thickness: solutions grow and decay by e^(1/thickness)."""
    size = Size(elements, 4, 2, 0, 0, 0)
    block = np.array([[1.0, 0.0, 0.0, -1.0 / thickness], [0.0, 1.0, -1.0 / thickness, 0.0]])
    points = np.broadcast_to(block, (elements, 4, 2, 4)).copy()
    ends = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return System(size, np.full(elements, 1.0 / elements), points, ends, np.zeros((0, 0)))


@pytest.mark.parametrize(("elements", "thickness"), [(40, 1e-1), (80, 1e-2), (160, 1e-3), (160, 1e-5)])
def test_growing_and_decaying_solutions_together(elements: int, thickness: float):
    """Boundary layers at both ends: elimination must not follow the growing solution (e^1000 overflows a double)."""
    system = layers(elements, thickness)
    rhs = np.zeros(elements * 4 * 2 + elements * 2 + 2)
    rhs[-2:] = 1.0, -0.5
    found, exact = structured_solution(system, rhs), np.linalg.solve(dense_matrix(system), rhs)
    error = np.abs(found - exact).max() / np.abs(exact).max()
    assert error < 1e-11, f"error {error:.1e}"
    nodes = found[: 2 * (elements + 1)].reshape(-1, 2)
    assert np.abs(nodes).max() < 1.01
    if thickness <= 1e-2 and elements * thickness > 0.3:
        u = np.linspace(0.0, 1.0, elements + 1)
        analytic = np.exp(-u / thickness) - 0.5 * np.exp((u - 1.0) / thickness)
        miss = np.abs(nodes[:, 0] - analytic).max()
        assert miss < 1e-3, f"error against the exact solution {miss:.1e}"


def test_blocks_that_do_not_fit_are_refused():
    system = random_system(SIZES[2], 0)
    with pytest.raises(ValueError, match="do not fit"):
        factors_of(system._replace(ends=system.ends[1:]))
