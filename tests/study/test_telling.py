"""Which observable is drawn where none is asked for."""

import pytest

import shapespace as ss
from shapespace.study.telling import most_telling


@pytest.mark.parametrize("units", [{}, {"length": "1 m", "energy": "1 J", "time": "1 s"}])
def test_the_velocity_counts_where_it_is_more_than_round_off_in_any_units(units: dict[str, str]):
    """A swimmer of 10 um has a speed of some 1e-7 m/s, which is no round-off; 1e-9 of the scale is."""
    case = ss.scenario("polar-swimmer")
    if units:
        case = case.in_units(length="10 um", energy="1e-17 J", time="10 s").in_units(
            **{k: v.split()[1] for k, v in units.items()}
        )
    scale = case.scales.factor("velocity")
    assert most_telling(case, lambda name: {"velocity": 0.1 * scale, "equator_radius": 0.0}[name]) == "velocity"
    assert most_telling(case, lambda name: {"velocity": 1e-9 * scale, "equator_radius": 0.0}[name]) == "equator_radius"
