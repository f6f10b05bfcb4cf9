"""Surfaces that are not well posed are refused, and told what is missing."""

from dataclasses import replace

import pytest

from shapespace.models import open_membrane, vesicle
from shapespace.physics.storage import AreaElasticity
from shapespace.variational.ends import Free, Pinned, check_count, check_ends


def test_conditions_that_are_missing_or_surplus_are_counted_and_listed():
    ends, integrals = ["r(0)", "r(1)", "z(1)"], ["volume"]
    check_count(3, ("p",), ends, integrals)
    with pytest.raises(ValueError, match=r"1 condition\(s\) missing: 3 fields and the scalars .*'volume'") as caught:
        check_count(3, ("h", "p"), ends, integrals)
    assert "pressure -> volume" in str(caught.value)
    with pytest.raises(ValueError, match=r"2 condition\(s\) surplus"):
        check_count(2, (), ends, integrals)


def test_rates_without_ends_and_ends_without_rates_are_named():
    both = (Pinned(), Free())
    check_ends({"r": both, "z": both}, ("r", "z"))
    with pytest.raises(ValueError, match=r"missing \['z'\], surplus \['psi'\]"):
        check_ends({"r": both, "psi": both}, ("r", "z"))


def test_two_terms_that_fix_the_same_field_are_named():
    with pytest.raises(ValueError, match="incompressible and fixed_area both fix the area of an open surface"):
        replace(open_membrane.RECIPE, fixed_area=True).system()
    with pytest.raises(ValueError, match="sigma is no multiplier of this surface, which has p, dilation"):
        replace(vesicle.RECIPE, incompressible=True, storages={"sigma": AreaElasticity}).system()
