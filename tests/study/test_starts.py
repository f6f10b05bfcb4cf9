"""Stored states as starts: of a stationary state at other parameters, and of a run."""

from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError, StoreError
from shapespace.study.run import store_frame
from shapespace.study.store import RunStore


@pytest.fixture(scope="module")
def swimmer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store of a swimming state."""
    found = ss.steady(ss.scenario("polar-swimmer", elements=20, peclet=24))
    assert found.outcome is ss.Outcome.CONVERGED
    path = tmp_path_factory.mktemp("store") / "swimmer"
    store_frame(path, found.scenario, found.frame, found.outcome)
    return path


def test_a_stored_state_is_found_again_and_leads_to_other_parameters(swimmer: Path):
    stored = RunStore.open(swimmer).read(-1).observables
    again = ss.steady(ss.scenario("polar-swimmer", elements=20, peclet=24), start=swimmer)
    assert again.found.iterations <= 2
    assert again.observables["velocity"] == pytest.approx(stored["velocity"], rel=1e-9)
    further = ss.scenario("polar-swimmer", elements=20, peclet=23, friction=0.5)
    there = ss.steady(further, start=str(swimmer))
    assert there.observables["velocity"] == pytest.approx(ss.steady(further).observables["velocity"], rel=1e-6)


def test_a_state_fits_another_discretisation(swimmer: Path):
    other = ss.scenario("polar-swimmer", elements=40, degree=5, peclet=24)
    found = ss.steady(other, start=swimmer)
    assert (found.problem.base.elements, found.problem.base.degree) == (40, 5)
    velocity = RunStore.open(swimmer).read(-1).observables["velocity"]
    assert found.observables["velocity"] == pytest.approx(velocity, rel=1e-7)


def test_a_run_starts_at_rest_there(swimmer: Path):
    run = ss.run(ss.scenario("polar-swimmer", elements=20, peclet=24, until=0.01), start=swimmer)
    first, last = run.frames[0], run.frames[-1]
    np.testing.assert_array_equal(first.nodes, RunStore.open(swimmer).read(-1).nodes)
    assert last.observables["velocity"] == pytest.approx(first.observables["velocity"], rel=1e-6)


def test_starts_that_do_not_fit_are_refused(swimmer: Path, tmp_path: Path):
    with pytest.raises(InputError, match="model is closed-surface"):
        ss.steady(ss.scenario("membrane-protrusion"), start=swimmer)
    with pytest.raises(InputError, match="azimuthal_flow is False"):
        ss.run(ss.scenario("polar-swimmer", azimuthal_flow=True), start=swimmer)
    with pytest.raises(StoreError, match="holds no run"):
        ss.steady(ss.scenario("polar-swimmer"), start=tmp_path)
    with pytest.raises(InputError, match="choose one of default, trivial"):
        ss.steady(ss.scenario("polar-swimmer"), state="oblate")
