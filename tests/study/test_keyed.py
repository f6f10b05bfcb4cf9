"""Keys as parameters: the powers by which they enter, and the derivatives along them."""

import numpy as np
import pytest

from shapespace.base.errors import InputError
from shapespace.study.engine import Engine
from shapespace.study.keyed import KeyedProblem, make_powers
from shapespace.study.scenario import scenario


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("polar-swimmer", ("peclet",)),
        ("polar-swimmer", ("inverse_hydrodynamic_length",)),
        ("guided-division", ("enclosed_volume",)),
        ("guided-division", ("bending_rigidity", "diffusivity")),
        ("guided-division", ("ring_amplitude", "peclet")),
        ("membrane-protrusion", ("base_radius",)),
        ("vesicle", ("area_radius", "spontaneous_curvature")),
        ("membrane-protrusion", ("pulling_force", "spontaneous_curvature")),
    ],
)
def test_powers_are_the_scenario_itself(name: str, keys: tuple[str, ...]):
    """p(q) equals the parameters of the scenario with these keys, to round-off; slopes and bends to differences."""
    case = scenario(name)
    powers, rng = make_powers(case, keys), np.random.default_rng(0)
    for _ in range(3):
        q = rng.uniform(0.3, 3.0, len(keys))
        exact = Engine.of(case.with_overrides(dict(zip(keys, q.tolist(), strict=True)))).p
        np.testing.assert_allclose(powers.value(q), exact, rtol=1e-12)
        dq, eq = rng.standard_normal((2, len(keys)))
        step = 1e-5
        slope = (powers.value(q + step * dq) - powers.value(q - step * dq)) / (2 * step)
        np.testing.assert_allclose(powers.slope(q, dq), slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())
        bend = (powers.slope(q + step * eq, dq) - powers.slope(q - step * eq, dq)) / (2 * step)
        np.testing.assert_allclose(powers.bend(q, dq, eq), bend, rtol=1e-6, atol=1e-6 * max(np.abs(bend).max(), 1.0))


@pytest.mark.parametrize("key", ["pulling_force", "spontaneous_curvature"])
def test_keys_may_vanish_or_be_negative(key: str):
    """Linear keys pass through zero, where their slope is the same."""
    powers = make_powers(scenario("membrane-protrusion"), (key,))
    for value in (-2.0, 0.0, 3.0):
        exact = Engine.of(scenario("membrane-protrusion", **{key: value})).p
        np.testing.assert_allclose(powers.value(np.array([value])), exact, rtol=1e-12)
        np.testing.assert_array_equal(powers.slope(np.array([value]), np.ones(1)) != 0.0, powers.exponents[:, 0] == 1.0)


def test_keys_with_bounds():
    """A reduced volume, less than one, moves the enclosed volume alone."""
    powers = make_powers(scenario("vesicle"), ("reduced_volume",))
    exact = Engine.of(scenario("vesicle", reduced_volume=0.9)).p
    np.testing.assert_allclose(powers.value(np.array([0.9])), exact, rtol=1e-14)
    assert np.count_nonzero(powers.exponents) == 1


def test_other_keys_are_refused():
    """What is no physical parameter cannot be varied; the message names what can."""
    for key in ("until", "elements", "pressure"):
        with pytest.raises(InputError, match=rf"{key}: is not a parameter.*friction"):
            KeyedProblem.of(scenario("polar-swimmer"), (key,))
