"""The mirror symmetry of closed surfaces: reflected states have reflected residuals, reflected solutions are solutions."""

import numpy as np
import pytest
from tests.surfaces import make_engine, march

from shapespace.base.arrays import Array
from shapespace.base.problem import Rate
from shapespace.numerics.state import state_from_functions
from shapespace.study.engine import Engine

COEFFICIENT = 3.0
ACTIVE = {"peclet": 60.0, "ring_amplitude": 2.0, "spontaneous_curvature": 0.7, "friction": 0.3, "seed_amplitude": 0.2}


def rough_state(engine: Engine, seed: int) -> Array:
    """The initial state with a smooth random field added to every field and a random number to every scalar."""
    random = np.random.default_rng(seed)
    state = engine.initial_state()
    waves = np.arange(1, 5)
    a, b = random.standard_normal((2, 4, len(engine.system.fields))) * 0.05

    def bumps(u: Array) -> tuple[Array, Array]:
        cos, sin = np.cos(np.pi * u[..., None] * waves), np.sin(np.pi * u[..., None] * waves)
        return cos @ a + sin @ b, np.pi * ((cos * waves) @ b - (sin * waves) @ a)

    values, slopes = state.nodes + bumps(state.mesh)[0], state.slopes + bumps(state.stage_points)[1]
    # Off the axis, and never through it.
    values[:, 0] += 0.5
    scalars = state.scalars + 0.1 * random.standard_normal(len(state.scalars))
    degree = engine.problem.degree
    return engine.problem.pack(state_from_functions(state.mesh, degree, values, slopes, state.algebraic, scalars))


@pytest.mark.parametrize("azimuthal", [False, True])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_reflected_state_has_the_reflected_residual(azimuthal: bool, friction: float):
    """Point by point and row by row up to sign, in motion; end conditions change places."""
    engine = make_engine("polar-swimmer", **{**ACTIVE, "friction": friction}, azimuthal_flow=azimuthal)
    problem, p = engine.problem, engine.p
    x, before = rough_state(engine, 0), rough_state(engine, 1)
    rows = []
    for state, earlier in ((x, before), (problem.reflected(x), problem.reflected(before))):
        assert state is not None
        assert earlier is not None
        rows.append(np.abs(problem.residual(state, p, Rate.of_growth(problem.stored(earlier, p), COEFFICIENT))))
    points = problem.elements * problem.degree * problem.n
    here, there = (row[:points].reshape(problem.elements, problem.degree, -1) for row in rows)
    np.testing.assert_allclose(here, there[::-1, ::-1], rtol=1e-9, atol=1e-9)
    ends = len(engine.system.ends)
    here, there = (row[-2 * ends - 3 :] for row in rows)
    if friction > 0.0:
        np.testing.assert_allclose(
            here[: 2 * ends].reshape(-1, 2), there[: 2 * ends].reshape(-1, 2)[:, ::-1], atol=1e-12
        )
    np.testing.assert_allclose(here[2 * ends :], there[2 * ends :], atol=1e-12)
    image = problem.reflected(x)
    assert image is not None
    np.testing.assert_allclose(problem.reflected(image), x, atol=1e-14)


@pytest.mark.parametrize("azimuthal", [False, True])
def test_a_reflected_solution_is_a_solution(azimuthal: bool):
    """A moving surface of no symmetry: all rows hold for its image."""
    engine = make_engine("polar-swimmer", elements=40, **ACTIVE, azimuthal_flow=azimuthal)
    problem, p = engine.problem, engine.p
    moments, _ = march(engine, 0.02, order=1, fixed_step=0.01)
    before, now = (problem.reflected(moment.x) for moment in moments[-2:])
    assert before is not None
    assert now is not None
    residuals = [
        problem.residual(x, p, Rate.of_growth(problem.stored(earlier, p), 1.0 / 0.01))
        for x, earlier in ((moments[-1].x, moments[-2].x), (now, before))
    ]
    sizes = [np.abs(residual).max() for residual in residuals]
    difference = problem.linearise(now, p, Rate.of_growth(problem.stored(before, p), 100.0))[1].solve(residuals[1])
    assert problem.norm(difference, now) < 1e-7, f"residuals {sizes}"
    assert np.abs(problem.unpack(now).scalars[2]) > 1e-3


def test_open_membranes_have_no_mirror():
    engine = make_engine("membrane-protrusion")
    assert engine.problem.reflected(engine.problem.pack(engine.initial_state())) is None
