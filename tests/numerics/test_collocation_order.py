"""Gauss collocation converges at its orders: 2k at element ends, k + 1 in between, k for slopes and algebraic fields."""

import functools

import numpy as np
import pytest
from tests.numerics.manufactured import SCALAR, exact, solve_everything

from shapespace.base.arrays import Array
from shapespace.base.outcome import Outcome
from shapespace.base.problem import Rate
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.mesh import uniform_mesh
from shapespace.numerics.newton import Newton, solve_root
from shapespace.numerics.state import State
from shapespace.study.engine import Engine
from shapespace.study.scenario import scenario

DENSE = np.linspace(0.0, 1.0, 1777)
COUNTS = {2: (10, 20, 40), 3: (8, 16, 32), 4: (6, 12, 24), 5: (4, 8, 16, 32), 6: (4, 8, 16, 32)}


def graded(elements: int) -> Array:
    """A smooth mesh whose largest element is twice the smallest."""
    x = np.linspace(0.0, 1.0, elements + 1)
    return x + np.sin(2.0 * np.pi * x) / (6.0 * np.pi)


@functools.cache
def errors(elements: int, degree: int) -> dict[str, float]:
    """Largest errors of the manufactured problem, by where they are."""
    problem, root = solve_everything(graded(elements), degree)
    assert root.outcome is Outcome.CONVERGED, root
    state = problem.unpack(root.x)
    at_ends, between = exact(state.mesh), exact(DENSE)
    pairs = {
        "ends": (state.nodes, np.stack([at_ends["y1"], at_ends["y2"]], axis=1)),
        "between": (state.values(DENSE), np.stack([between["y1"], between["y2"]], axis=1)),
        "slopes": (state.derivatives(DENSE), np.stack([between["dy1"], between["dy2"]], axis=1)),
        "algebraic": (state.algebraic_values(DENSE), between["a"][:, None]),
        "scalar": (state.scalars, np.array([SCALAR])),
    }
    return {name: float(np.abs(found - true).max()) for name, (found, true) in pairs.items()}


def observed_orders(degree: int, where: str) -> tuple[Array, list[float]]:
    found = [errors(elements, degree)[where] for elements in COUNTS[degree]]
    return np.log2(np.array(found[:-1]) / found[1:]), found


@pytest.mark.parametrize("degree", COUNTS)
@pytest.mark.parametrize(("where", "extra"), [("between", 1), ("slopes", 0), ("algebraic", 0)])
def test_order_between_element_ends(degree: int, where: str, extra: int):
    orders, found = observed_orders(degree, where)
    message = f"degree {degree}, {where}: errors {found}, observed orders {orders}"
    assert abs(orders[-1] - (degree + extra)) < 0.35, message


@pytest.mark.parametrize("degree", COUNTS)
@pytest.mark.parametrize("where", ["ends", "scalar"])
def test_superconvergence(degree: int, where: str):
    """Order 2k, as long as round-off (1e-13) is far."""
    orders, found = observed_orders(degree, where)
    message = f"degree {degree}, {where}: errors {found}, observed orders {orders}"
    clear = [order for order, error in zip(orders, found[1:], strict=True) if error > 1e-12]
    assert clear, message
    assert abs(clear[-1] - 2 * degree) < 0.6, message


STEP = 0.02
RING = {"initial_ring_amplitude": 1.0, "seed_amplitude": 0.3}
FIELDS = Engine.of(scenario("guided-division")).system.fields
# Of r, z and h the poles' error, of order k + 1, is soon the largest part everywhere, tiny as it is (1e-11 at N = 40).
INNER = ("psi", "alpha", "v", "species_flux")


def sphere_with_ring(u: Array, width: float) -> Array:
    """(r, z, psi, h, c r h) of the unit sphere with the initial ring, exactly, at u."""
    sin, cos = np.sin(np.pi * u), np.cos(np.pi * u)
    c = (1.0 + np.exp(-(((u - 0.5) / width) ** 2))) * (1.0 + 0.3 * cos)
    return np.stack([sin, cos, np.pi * u, np.full_like(u, np.pi), np.pi * c * sin], axis=-1)


@functools.cache
def after_one_step(elements: int, degree: int) -> State:
    """Guided division one backward Euler step after a lopsided ring: a strong flow towards and away from both poles."""
    engine = Engine.of(scenario("guided-division", elements=20, degree=degree, **RING))
    problem = CollocationProblem(engine.system, uniform_mesh(elements), degree)
    guess = Engine(problem, engine.p, engine.values).initial_state()
    before = sphere_with_ring(np.append(guess.stage_points.ravel(), [0.0, 1.0]), engine.values["ring_width"])
    rate = Rate(1.0 / STEP, -before.ravel() / STEP)
    root = solve_root(problem, problem.pack(guess), engine.p, rate, Newton(1e-12))
    assert root.outcome is Outcome.CONVERGED, root
    return problem.unpack(root.x)


def surface_orders(degree: int, elements: int, reference: State) -> dict[str, dict[str, float]]:
    """Observed orders by place and field, from `elements` to twice as many."""
    found = []
    for count in (elements, 2 * elements):
        state = after_one_step(count, degree)
        nodal = np.abs(state.nodes - reference.values(state.mesh))
        between = np.abs(state.values(DENSE) - reference.values(DENSE))
        inner = (state.mesh > 0.15) & (state.mesh < 0.85)
        poles = nodal[[0, -1]].max(axis=0)
        found.append({"inner ends": nodal[inner].max(axis=0), "between": between.max(axis=0), "poles": poles})
    tiny = 1e-300
    return {
        place: dict(zip(FIELDS, np.log2((coarse + tiny) / (found[1][place] + tiny)), strict=True))
        for place, coarse in found[0].items()
    }


def check_surface(degree: int, elements: int, reference: State) -> None:
    """Two-sided: 2k at element ends away from the poles, k + 1 between element ends."""
    orders = surface_orders(degree, elements, reference)
    nodal = {name: orders["inner ends"][name] for name in INNER}
    assert max(abs(order - 2 * degree) for order in nodal.values()) < 0.45, f"degree {degree}, element ends: {nodal}"
    between = orders["between"]
    assert max(abs(order - degree - 1) for order in between.values()) < 0.7, f"degree {degree}, between: {between}"
    assert abs(np.mean(list(between.values())) - degree - 1) < 0.25, f"degree {degree}, between: {between}"


@pytest.mark.parametrize("degree", [2, 4])
def test_order_of_a_surface_with_poles(degree: int):
    check_surface(degree, 20, after_one_step(40, 6))


@pytest.mark.slow
@pytest.mark.parametrize("degree", [2, 3, 4])
def test_order_of_a_surface_with_poles_against_a_finer_reference(degree: int):
    check_surface(degree, 20, after_one_step(120, 6))


@pytest.mark.parametrize(("degree", "field"), [(4, "meridional_force"), (4, "moment")])
def test_order_at_the_poles(degree: int, field: str):
    """A regular singular point costs superconvergence: the multipliers of symmetry converge there with order k + 1."""
    orders = surface_orders(degree, 20, after_one_step(40, 6))["poles"]
    assert abs(orders[field] - degree - 1) < 0.35, f"degree {degree}: {orders}"


@pytest.mark.slow
@pytest.mark.parametrize(("degree", "elements", "field"), [(2, 80, "meridional_force"), (3, 40, "c")])
def test_order_at_the_poles_for_other_degrees(degree: int, elements: int, field: str):
    orders = surface_orders(degree, elements, after_one_step(120, 6))["poles"]
    assert abs(orders[field] - degree - 1) < 0.35, f"degree {degree}: {orders}"
