"""Where branches begin and end: at branch points, at other parameters, at bounds of keys, away from their stop."""

from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study import branch_starts

COARSE = {"elements": 20}


def swimmer(**keys: float | bool) -> ss.Scenario:
    return ss.scenario("polar-swimmer", **COARSE, **keys)


@pytest.fixture(scope="module")
def sphere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The resting sphere through its pitchfork at Pe = 22."""
    path = tmp_path_factory.mktemp("ends") / "sphere"
    ss.branch(swimmer(), "peclet", 23.0, start=21.0, state="trivial", stability=False, out=path)
    return path


def labels(found: ss.Branch) -> list[str]:
    return [point.label for point in found.special_points]


def speeds(found: ss.Branch) -> list[float]:
    return [point.observables["velocity"] for point in found.points]


def test_a_branch_begins_at_a_pitchfork_and_stays_on_the_sphere():
    """Both ways; what is unstable on one side grows from there on."""
    found = ss.branch(swimmer(), "peclet", 24.0, start=22.0, state="trivial", both=True)
    assert found.outcome is Outcome.REACHED_STOP
    assert [one.parameter for one in found.special_points] == [20.0, 24.0]
    np.testing.assert_allclose(speeds(found), 0.0, atol=1e-9)
    assert [one.n_unstable for one in found.special_points] == [0, 1]


@pytest.mark.parametrize("value", [22.0, 22.0000001, 21.9999999])
def test_a_branch_stops_at_a_pitchfork_and_goes_on(value: float):
    found = ss.branch(swimmer(), "peclet", 24.0, start=21.0, at=(value,), state="trivial")
    assert found.outcome is Outcome.REACHED_STOP
    assert sorted(labels(found)) == ["end-1", "pitchfork-1", "user-1"]
    assert found["user-1"].parameter == value
    assert found["pitchfork-1"].parameter == pytest.approx(22.0, abs=1e-8)
    assert (found["pitchfork-1"].n_unstable_before, found["pitchfork-1"].n_unstable_after) == (0, 1)
    np.testing.assert_allclose(speeds(found), 0.0, atol=1e-8)


def test_a_branch_ends_at_a_pitchfork():
    found = ss.branch(swimmer(), "peclet", 22.0, start=21.0, state="trivial", stability=False)
    assert (found.outcome, labels(found)) == (Outcome.REACHED_STOP, ["pitchfork-1", "end-1"])


def test_a_point_of_a_curve_of_pitchforks_is_a_start(sphere: Path, tmp_path: Path):
    """Also in the second key, whose value there is where the branch begins."""
    forks = tmp_path / "forks"
    ss.curve(f"{sphere}:pitchfork-1", "turnover_rate", 10.0, at=(9.5,), out=forks)
    found = ss.branch(swimmer(turnover_rate=9.5), "peclet", 24.0, origin=f"{forks}:user-1", stability=False)
    assert found["start"].parameter == pytest.approx(23.0, abs=1e-8)  # 2 (2 + k)
    assert found.outcome is Outcome.REACHED_STOP
    np.testing.assert_allclose(speeds(found), 0.0, atol=1e-8)
    other = ss.branch(swimmer(peclet=23.0), "turnover_rate", 9.8, origin=f"{forks}:user-1", stability=False)
    assert other["start"].parameter == pytest.approx(9.5, abs=1e-9)
    np.testing.assert_allclose(speeds(other), 0.0, atol=1e-8)


@pytest.mark.parametrize("keys", [{"elements": 40}, {"friction": 1.1}, {"turnover_rate": 9.2}, {"degree": 5}])
def test_the_other_branch_leaves_at_other_parameters_too(sphere: Path, keys: dict[str, float]):
    """The pitchfork is found again there; the two sides are mirror images, in the sense that they have here."""
    onset = 2.0 * (2.0 + keys.get("turnover_rate", 9.0))
    sides = []
    for side in (1, -1):
        case = swimmer().with_overrides(keys)
        found = ss.branch(case, "peclet", 24.0, origin=f"{sphere}:pitchfork-1", side=side, stability=False)
        assert found.outcome is Outcome.REACHED_STOP
        assert found["start"].parameter == pytest.approx(onset, abs=1e-7)
        sides.append(found["end-1"].observables["velocity"])
    assert sides[0] == pytest.approx(-sides[1], rel=1e-6)
    known = ss.branch(swimmer(), "peclet", 24.0, origin=f"{sphere}:pitchfork-1", side=1, stability=False)
    if "degree" not in keys:
        assert np.sign(known["end-1"].observables["velocity"]) == np.sign(sides[0])


def test_a_branch_point_that_is_not_found_again_is_said(sphere: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(branch_starts, "branch_point_near", lambda *_: Outcome.DIVERGED)
    case = swimmer(turnover_rate=9.1)
    path = tmp_path / "none"
    found = ss.branch(case, "peclet", 24.0, origin=f"{sphere}:pitchfork-1", side=1, stability=False, out=path)
    assert found.outcome is Outcome.DIVERGED
    assert "was not found at these parameters" in found.detail
    assert not path.exists()


def test_a_state_at_other_parameters_starts_from_a_branch_point(sphere: Path):
    """Left along its own branch, the sphere, as Newton's method finds nothing at the point itself."""
    for keys in ({"peclet": 22.5}, {"turnover_rate": 10.0, "peclet": 22.0}):
        found = ss.steady(swimmer(**keys), start=f"{sphere}:pitchfork-1")
        assert found.outcome is Outcome.CONVERGED
        assert abs(found.observables["velocity"]) < 1e-8


def test_a_swimmer_that_merges_with_the_sphere_is_no_swimmer_any_more():
    swims = ss.steady(swimmer(peclet=24.0))
    found = ss.steady(swimmer(peclet=15.0), start=swims)
    assert found.outcome is Outcome.NOT_REACHED
    assert "merged with a symmetric state" in found.nearest


def test_a_branch_that_turns_back_says_so():
    """The swimmer ends at the sphere, beyond which it is its own mirror image."""
    found = ss.branch(swimmer(), "peclet", 15.0, start=25.0, stability=False)
    assert found.outcome is Outcome.TURNED_BACK
    assert found["end-1"].parameter == 25.0
    assert found["end-1"].ends == "turned-back"


def test_a_side_branch_that_leads_away_ends(sphere: Path):
    """Swimmers are beyond the pitchfork only: asked for below, the branch ends far on the other side."""
    found = ss.branch(swimmer(), "peclet", 2.0, origin=f"{sphere}:pitchfork-1", side=1, stability=False)
    assert found.outcome is Outcome.TURNED_BACK
    assert found["end-1"].parameter == pytest.approx(242.0, rel=1e-9)


def test_a_branch_ends_where_a_key_leaves_its_range(tmp_path: Path):
    """Both ways from a friction of 1 to one of 3 goes to zero, not to -1."""
    found = ss.branch(
        swimmer(), "friction", 3.0, start=1.0, state="trivial", both=True, stability=False, out=tmp_path / "b"
    )
    assert found.outcome is Outcome.REACHED_STOP
    end = found["out-of-range-1"]
    assert 0.0 <= end.parameter < 1e-3
    assert end.ends == "out-of-range"
    assert ss.open_branch(tmp_path / "b")["out-of-range-1"].parameter == end.parameter


def test_a_start_that_fails_leaves_no_folder(tmp_path: Path):
    path = tmp_path / "made" / "none"
    found = ss.branch(swimmer(), "peclet", 16.0, start=15.0, state="default", out=path)
    assert (found.outcome, found.points, found.store) == (Outcome.NO_STATE, (), None)
    assert not path.parent.exists()


def test_values_outside_are_refused():
    with pytest.raises(InputError, match=r"--at 31: lies outside 15 to 30"):
        ss.branch(swimmer(), "peclet", 30.0, start=15.0, at=(31.0,), state="trivial")


def test_a_flat_disc_has_no_growth_rates():
    """Its deflections dissipate nothing to first order: said as such, also where round-off makes the disc uneven."""
    case = ss.scenario("membrane-protrusion", spontaneous_curvature=0.0, **COARSE)
    found = ss.branch(case, "boundary_tension", -16.0, start=-14.0, state="trivial")
    assert found["pitchfork-1"].parameter == pytest.approx(-14.681970642, abs=1e-8)
    assert {point.spectrum for point in found.points} == {"no-rates"}
    assert {point.n_unstable for point in found.points} == {None}
    assert all(len(point.growth_rates) == 0 for point in found.points)
    # A disc that is hardly pulled has them, the faster the flatter it is.
    pulled = [ss.steady(case.with_overrides({"pulling_force": force})).rates() for force in (0.2, 0.4)]
    assert [rates.n_unstable for rates in pulled] == [0, 0]
    assert pulled[0].values[0][0] / pulled[1].values[0][0] == pytest.approx(4.0, rel=0.01)
