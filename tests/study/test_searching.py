"""Searches for all stationary states: what is found from the resting sphere alone, the record of starts, stores, resuming."""

from pathlib import Path

import numpy as np
import pytest

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.engine import state_of
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.search_store import Search, open_search
from shapespace.study.searching import search_states
from shapespace.study.starts import find_start, find_starts
from shapespace.study.steady import steady


def swimmer(peclet: float = 24.0) -> Scenario:
    return scenario("polar-swimmer", elements=20, peclet=peclet)


def story(found: Search) -> list[tuple[str, str, str, float]]:
    """What a search did, exactly."""
    return [(one.start, one.outcome, one.label, one.observables.get("velocity", 0.0)) for one in found.tried]


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Search:
    """A search of seven starts, stored."""
    return search_states(swimmer(), max_tries=7, out=tmp_path_factory.mktemp("searches") / "swimmer")


def test_the_sphere_and_the_swimmer_above_the_pitchfork(stored: Search):
    """The swimmer counts once: its mirror image swims the other way. The sphere's rate is Pe/2 - 2 - k = 1."""
    assert stored.outcome is Outcome.MAX_STARTS
    sphere, swims = stored.states
    assert (sphere.start, sphere.is_mirrored, sphere.n_unstable) == ("reference", False, 1)
    assert sphere.growth_rates[0] == pytest.approx([1.0, 0.0], abs=1e-6)
    assert sphere.parities[0] == "antisymmetric"
    assert (swims.is_mirrored, swims.n_unstable) == (True, 0)
    named = steady(swimmer())
    assert abs(swims.observables["velocity"]) == pytest.approx(abs(named.observables["velocity"]), rel=1e-6)
    assert [one.start for one in stored.tried[:3]] == ["reference", "reference", "state default"]
    assert stored.tried[1].outcome == "repeated"
    assert stored.label_of(stored.tried[1]) == "state-1"
    assert all(one.outcome for one in stored.tried)


def test_a_stored_search_reloads_and_its_states_are_starts(stored: Search):
    assert stored.store is not None
    again = open_search(stored.store)
    assert story(again) == story(stored)
    start = find_start(f"{stored.store}:state-2")
    np.testing.assert_array_equal(start.frame.nodes, stored["state-2"].frame.nodes)
    assert [one.text for one in find_starts(stored.store, swimmer())] == [
        f"{stored.store}:state-1",
        f"{stored.store}:state-2",
    ]
    found = steady(swimmer(), start=start)
    assert found.outcome is Outcome.CONVERGED
    assert found.found.iterations <= 2
    np.testing.assert_allclose(state_of(found.frame).nodes, start.frame.nodes, atol=1e-8)
    with pytest.raises(InputError, match="choose one of state-1, state-2"):
        find_start(f"{stored.store}:state-3")
    with pytest.raises(InputError, match="model is closed-surface, not open-membrane"):
        find_starts(stored.store, scenario("membrane-protrusion"))


def test_an_interrupted_search_goes_on_as_if_it_had_not_been(stored: Search, tmp_path: Path):
    """Three tries, then the rest; a finished search is left as it is, another request is refused."""
    part = search_states(swimmer(), max_tries=3, out=tmp_path / "part")
    assert len(part.tried) == 3
    whole = search_states(swimmer(), max_tries=7, out=tmp_path / "part", resume=True)
    assert story(whole) == story(stored)
    assert len(search_states(swimmer(), max_tries=5, out=tmp_path / "part", resume=True).tried) == 7
    with pytest.raises(StoreError, match="peclet is 24"):
        search_states(swimmer(25.0), out=tmp_path / "part", resume=True)
    with pytest.raises(StoreError, match="starts are"):
        search_states(swimmer(), origins=[stored.store or ""], out=tmp_path / "part", resume=True)
    with pytest.raises(StoreError, match="holds a search already"):
        search_states(swimmer(), out=tmp_path / "part")


def test_states_of_other_parameters_are_starts(stored: Search):
    """The swimmer of Pe = 24, from its store, at Pe = 26."""
    assert stored.store is not None
    found = search_states(swimmer(26.0), origins=[f"{stored.store}:state-2"], max_tries=5)
    assert any(f"{stored.store}:state-2" == one.start for one in found.tried)
    assert len(found.states) == 2


def test_bad_requests_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="must be at least 1"):
        search_states(swimmer(), max_tries=0)
    with pytest.raises(InputError, match="needs the directory"):
        search_states(swimmer(), resume=True)
    with pytest.raises(StoreError, match="holds no search"):
        open_search(tmp_path)


def test_three_symmetric_divisions_from_the_sphere_alone():
    """Between the folds at 1.2935 and 2.3625 of the branch: nearly round, waisted and nearly divided; the middle one unstable."""
    found = search_states(scenario("guided-division", ring_amplitude=1.8), max_tries=9)
    symmetric = [one for one in found.states if not one.is_mirrored]
    assert len(symmetric) >= 3
    round_one, waisted, divided = sorted(symmetric, key=lambda one: -one.observables["equator_radius"])[:3]
    assert "neck_radius" not in round_one.observables
    assert divided.observables["neck_radius"] < 0.1 < waisted.observables["neck_radius"]
    assert (round_one.n_unstable, divided.n_unstable) == (0, 0)
    assert waisted.n_unstable is not None
    assert waisted.n_unstable > 0
    assert all(one.residual < 1e-6 for one in found.states)
