"""Error estimates are near the truth, and meshes follow what they have to resolve."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.numerics.manufactured import (
    BoundaryLayer,
    InteriorLayer,
    exact,
    largest_error,
    solve_everything,
    solve_layer,
)

from shapespace.base.arrays import Array
from shapespace.numerics.adaptation import discretisation_error
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.mesh import SIZES, equidistribute, next_size, symmetrise, uniform_mesh
from shapespace.numerics.state import State, state_from_functions

LAYERS = {"boundary": BoundaryLayer(), "interior": InteriorLayer()}


def adapted(name: str, e: float, tolerance: float) -> tuple[CollocationProblem, Array, int]:
    """A layer solved on a mesh that follows it, from 20 equal elements on; and the number of meshes it took.

    About ten; while the layer is unresolved, round-off decides which meshes come next.
    """
    mesh = uniform_mesh(20)
    for count in range(1, 21):
        problem, x = solve_layer(LAYERS[name], mesh, 4, e, tolerance)
        better = problem.adapted(x)
        if better is problem:
            return problem, x, count
        mesh = better.mesh
    pytest.fail(f"the mesh keeps moving after {count} solutions")


@pytest.mark.parametrize("degree", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("elements", [8, 16, 32])
def test_estimate_on_a_smooth_problem(degree: int, elements: int):
    """Within a factor of two of the true error on a uniform mesh, over nine orders of magnitude."""
    problem, root = solve_everything(uniform_mesh(elements), degree)
    state, u = problem.unpack(root.x), np.linspace(0.0, 1.0, 3001)
    truth = np.stack([exact(u)["y1"], exact(u)["y2"]], axis=1)
    error = float(
        (np.abs(state.values(u) - truth).max(axis=0) / np.maximum(np.abs(state.nodes).max(axis=0), 1.0)).max()
    )
    ratio = discretisation_error(state) / error
    assert 0.5 < ratio < 2.0, f"estimate/error = {ratio:.2f} at error {error:.1e}"


@pytest.mark.parametrize("e", [1e-1, 1e-2, 1e-3])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
@pytest.mark.parametrize("name", LAYERS)
def test_adapted_meshes_resolve_layers(name: str, e: float, tolerance: float):
    """The tolerance is met by a few meshes, and the estimate tells by how much, within a factor of ten."""
    e = 0.5 * e if name == "interior" else e
    problem, x, count = adapted(name, e, tolerance)
    error = largest_error(problem, x, lambda u: LAYERS[name].solution(u, e))
    ratio = discretisation_error(problem.unpack(x)) / error
    message = f"error {error:.1e}, estimate/error {ratio:.2f}, {problem.elements} elements, {count} meshes"
    assert error < 2.0 * tolerance, message
    assert 0.1 < ratio < 10.0, message
    assert count <= 5, message


def test_adapted_mesh_beats_the_uniform_one():
    """A layer of 1e-2 at both ends: 40 elements where they are needed do what 160 equal ones do not."""
    problem, x, _ = adapted("boundary", 1e-2, 1e-6)
    assert problem.elements <= 40
    error = largest_error(problem, x, lambda u: BoundaryLayer.solution(u, 1e-2))
    uniform = largest_error(
        *solve_layer(BoundaryLayer(), uniform_mesh(80), 4, 1e-2, 1.0), lambda u: BoundaryLayer.solution(u, 1e-2)
    )
    assert error < 0.1 * uniform, f"{error:.1e} with {problem.elements} elements, {uniform:.1e} with 80 equal ones"


def thin_layer() -> tuple[CollocationProblem, float, float]:
    """A layer 500 times thinner than the first elements: the last problem, the error left and its estimate."""
    problem, x, _ = adapted("interior", 1e-4, 1e-4)
    error = largest_error(problem, x, lambda u: InteriorLayer.solution(u, 1e-4))
    return problem, error, discretisation_error(problem.unpack(x))


def test_estimate_owns_up_to_a_layer_that_is_not_resolved():
    _, error, estimate = thin_layer()
    assert 0.1 < estimate / error < 10.0, f"error {error:.1e}, estimate {estimate:.1e}"


def test_a_layer_far_thinner_than_the_first_elements_is_resolved():
    problem, error, _ = thin_layer()
    assert error < 2e-4, (
        f"error {error:.1e} left on {problem.elements} elements, down to {np.diff(problem.mesh).min():.1e}"
    )


@pytest.mark.parametrize("e", [3e-5, 1e-5])
@pytest.mark.parametrize("name", LAYERS)
def test_meshes_settle_even_where_they_cannot_resolve(name: str, e: float):
    """Layers down to 5000 times thinner than the first elements: resolved or not, the mesh comes to rest."""
    adapted(name, e, 1e-4)


def test_a_good_mesh_is_kept():
    """The same object comes back: nothing is interpolated without need."""
    problem, x, _ = adapted("boundary", 1e-2, 1e-6)
    assert problem.adapted(x) is problem


@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
def test_symmetric_layers_get_symmetric_meshes(tolerance: float):
    mesh = adapted("boundary", 1e-2, tolerance)[0].mesh
    assert np.abs(mesh + mesh[::-1] - 1.0).max() <= np.finfo(float).eps


DENSITIES = st.lists(st.floats(0.0, 1e12), min_size=20, max_size=60)


@settings(max_examples=60, deadline=None)
@given(DENSITIES, st.sampled_from(SIZES), st.sampled_from([0.05, 0.2, 0.5]))
def test_equidistributed_meshes_keep_their_floor(values: list[float], elements: int, floor: float):
    """Any monitor gives an increasing mesh from 0 to 1 without an element larger than 1/(floor N)."""
    mesh = equidistribute(uniform_mesh(len(values)), np.array(values), elements, floor)
    widths = np.diff(mesh)
    assert (mesh[0], mesh[-1], len(mesh)) == (0.0, 1.0, elements + 1)
    assert widths.min() > 0.0
    assert widths.max() <= (1.0 + 1e-9) / (floor * elements), f"largest element {widths.max():.3g}"


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(1e-6, 1e6), min_size=10, max_size=30), st.sampled_from(SIZES))
def test_symmetric_monitors_give_symmetric_meshes(half: list[float], elements: int):
    density = np.array(half + half[::-1])
    mesh = equidistribute(uniform_mesh(len(density)), density, elements)
    assert np.abs(mesh + mesh[::-1] - 1.0).max() < 1e-13
    made = symmetrise(mesh)
    assert np.abs(made + made[::-1] - 1.0).max() <= np.finfo(float).eps


def test_each_element_gets_the_same_share():
    """Without floor and smoothing, the integral of the monitor is the same over all new elements."""
    old = uniform_mesh(50)
    density = np.exp(5.0 * np.sin(9.0 * old[:-1]))
    mesh = equidistribute(old, density, 40, floor=0.0, smoothing=0)
    cumulative = np.concatenate([[0.0], np.cumsum(density * np.diff(old))])
    shares = np.diff(np.interp(mesh, old, cumulative))
    np.testing.assert_allclose(shares, cumulative[-1] / 40, rtol=1e-10)


def test_neighbours_differ_by_a_bounded_factor():
    """A monitor that jumps by 1e6 is smoothed."""
    density = np.where(np.arange(40) == 20, 1e6, 1.0)
    widths = np.diff(equidistribute(uniform_mesh(40), density, 40))
    assert max((widths[1:] / widths[:-1]).max(), (widths[:-1] / widths[1:]).max()) < 30.0


def test_nothing_to_resolve_gives_equal_elements():
    np.testing.assert_allclose(equidistribute(uniform_mesh(20), np.zeros(20), 40), uniform_mesh(40), atol=1e-15)


def test_sizes_at_least_double_up_to_the_largest():
    assert [next_size(size) for size in SIZES] == [40, 80, 120, 160, 240, 320, 320, 320]


def polynomial_state(mesh: Array, degree: int) -> State:
    """u^degree and (1 - u)^degree, which collocation represents exactly."""
    rule = gauss_rule(degree)
    stages = mesh[:-1, None] + np.diff(mesh)[:, None] * rule.points
    values = np.stack([mesh**degree, (1.0 - mesh) ** degree], axis=1)
    slopes = degree * np.stack([stages ** (degree - 1), -((1.0 - stages) ** (degree - 1))], axis=2)
    return state_from_functions(mesh, degree, values, slopes, stages[..., None] ** (degree - 1), np.array([2.0]))


@pytest.mark.parametrize("degree", [2, 3, 4, 5, 6])
def test_polynomials_survive_a_change_of_mesh(degree: int):
    """Values, slopes and algebraic fields of polynomials of the scheme's degree are exact at any u, on any mesh."""
    rng = np.random.default_rng(3)
    meshes = [np.concatenate([[0.0], np.sort(rng.random(n)), [1.0]]) for n in (6, 11)]
    u = rng.random(200)
    for state in (polynomial_state(meshes[0], degree), polynomial_state(meshes[0], degree).on_mesh(meshes[1])):
        np.testing.assert_allclose(state.values(u), np.stack([u**degree, (1 - u) ** degree], 1), atol=1e-12)
        np.testing.assert_allclose(state.derivatives(u)[:, 0], degree * u ** (degree - 1), atol=1e-9)
        np.testing.assert_allclose(state.algebraic_values(u)[:, 0], u ** (degree - 1), atol=1e-9)
        gaps = (
            state.nodes[:-1]
            + np.einsum("e,l,eln->en", state.widths, state.rule.weights, state.slopes)
            - state.nodes[1:]
        )
        assert np.abs(gaps).max() < 1e-14, f"elements do not meet: {np.abs(gaps).max():.1e}"


@pytest.mark.parametrize("degree", [3, 4])
def test_transfer_loses_no_order(degree: int):
    """Error of the transfer to another mesh and back, at order k + 1 as the solution's own."""
    u, found = np.linspace(0.0, 1.0, 999), []
    for elements in (32, 64):
        problem, root = solve_everything(uniform_mesh(elements), degree)
        state = problem.unpack(root.x)
        there = state.on_mesh(uniform_mesh(elements) ** 1.2)
        found.append(float(np.abs(there.values(u) - state.values(u)).max()))
    order = np.log2(found[0] / found[1])
    assert degree + 0.5 < order < degree + 1.6, f"order {order:.2f} of errors {found}"
