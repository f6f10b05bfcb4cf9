"""Scales: dimensions of every key, round trips, invariance under a change of units, and limits of range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES, Scales

CLOSED = {
    "bending_rigidity": 2.0,
    "bulk_viscosity": 3.0,
    "shear_viscosity": 5.0,
    "sphere_radius": 7.0,
    "reference_concentration": 11.0,
}
OPEN = {"bending_rigidity": 2.0, "shear_viscosity": 5.0, "base_radius": 7.0}


def rescaled(values: dict[str, float], units: dict[str, float]) -> dict[str, float]:
    """The same values in other units: `units` are the old ones measured in the new ones."""
    return {
        name: value * np.prod([units[base] ** power for base, power in QUANTITIES[name].dimension._asdict().items()])
        for name, value in values.items()
    }


def test_scales_of_the_two_models():
    closed, membrane = Scales.of(CLOSED), Scales.of(OPEN)
    assert (closed.length, closed.energy, closed.concentration) == (7.0, 2.0, 11.0)
    assert_allclose(closed.time, 3.0 * 7.0**2 / 2.0, rtol=1e-15)
    assert_allclose(membrane.time, 5.0 * 7.0**2 / 2.0, rtol=1e-15)
    assert membrane.concentration == 1.0


def test_what_defines_the_scales_becomes_one():
    assert_allclose([*Scales.of(CLOSED).to_dimensionless(CLOSED).values()], [1, 1, 5 / 3, 1, 1], rtol=1e-15)
    assert_allclose([*Scales.of(OPEN).to_dimensionless(OPEN).values()], 1, rtol=1e-15)


@pytest.mark.parametrize(
    ("name", "ones", "units"),
    [
        ("radius", "R0", "length"),
        ("velocity", "R0/tau", "length/time"),
        ("tension_pole", "kappa/R0^2", "energy/length^2"),
        ("bulk_viscosity", "kappa tau/R0^2", "energy time/length^2"),
        ("meridional_curvature", "1/R0", "1/length"),
        ("max_concentration", "c0", "concentration"),
        ("dissipation", "kappa/tau", "energy/time"),
        ("diffusivity", "R0^2/tau", "length^2/time"),
        ("polarity", "1", "1"),
        ("tangent_angle", "rad", "rad"),
    ],
)
def test_unit_names_a_scale_only_where_it_is_the_unit(name: str, ones: str, units: str):
    assert Scales(1.0, 1.0, 1.0, 1.0).unit(name) == ones
    assert Scales.of(CLOSED).unit(name) == units


def test_length_of_the_membrane_has_its_own_symbol():
    assert Scales.of(dict.fromkeys(OPEN, 1.0)).unit("height") == "R_b"


@given(
    st.tuples(*[st.floats(1e-3, 1e3)] * 4), st.one_of(st.just(0.0), st.floats(1e-200, 1e6), st.floats(-1e6, -1e-200))
)
def test_values_survive_the_round_trip(scales: tuple[float, float, float, float], value: float):
    for name in QUANTITIES:
        there = Scales(*scales).to_dimensionless({name: value})[name]
        assert_allclose(Scales(*scales).from_dimensionless(name, there), value, rtol=1e-15)


@given(st.tuples(*[st.floats(1e-6, 1e6)] * 4))
def test_dimensionless_values_do_not_depend_on_the_units(factors: tuple[float, float, float, float]):
    values = {name: 1.0 + 0.1 * number for number, name in enumerate(QUANTITIES)} | CLOSED
    values.pop("base_radius")
    other = rescaled(values, dict(zip(("length", "energy", "time", "concentration"), factors, strict=True)))
    expected = Scales.of(values).to_dimensionless(values)
    found = Scales.of(other).to_dimensionless(other)
    assert_allclose([*found.values()], [*expected.values()], rtol=1e-13)


def test_arrays_are_scaled_too():
    assert_allclose(Scales.of(CLOSED).from_dimensionless("radius", np.array([0.0, 1.0])), [0.0, 7.0])


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_must_be_positive_and_finite(length: float):
    with pytest.raises(InputError, match="length scale"):
        Scales(length, 1.0, 1.0)


@pytest.mark.parametrize("length", [1e-200, 1e200])
def test_units_out_of_range_are_named(length: float):
    with pytest.raises(InputError, match=r"friction: .*choose units"):
        Scales(length, 1.0, 1.0).to_dimensionless({"friction": 1.0})
    with pytest.raises(InputError, match=r"until = 1e\+300"):
        Scales(1.0, 1.0, 1e-300).to_dimensionless({"until": 1e300})
