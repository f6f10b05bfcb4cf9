"""Boundaries of diagrams: curves against closed forms and the map's own changes; regimes; resuming; their picture."""

import re
from pathlib import Path

import numpy as np
import pytest

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.boundaries import NEAR, distances, find_changes
from shapespace.study.diagram_store import BOUNDARIES, CURVES, Diagram
from shapespace.study.diagrams import diagram
from shapespace.study.regimes import Regime, describe, telling_aspects
from shapespace.study.scenario import Scenario, scenario
from shapespace.view.curve import COLOURS
from shapespace.view.diagram import plot_diagram

X, Y = "peclet=17.5:40:8", "turnover_rate=7:13:6"
STATES = ("trivial", "default")


def swimmer() -> Scenario:
    return scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3)


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    """Spheres and swimmers; the boundary is asked for when the map is complete."""
    out = tmp_path_factory.mktemp("boundaries") / "map"
    diagram(swimmer(), X, Y, states=STATES, stability=True, out=out, workers=1)
    # What an interrupted call leaves.
    (out / CURVES / "pitchfork-1").mkdir(parents=True)
    return diagram(swimmer(), X, Y, states=STATES, stability=True, boundaries=True, out=out, workers=1, resume=True)


def test_the_boundary_is_where_theory_says(mapped: Diagram):
    """Pe* = (2 + k R0^2/D)/(c0 f'(c0)) with c0 f' = 1/2 (exact result 2), from one edge of the map to the other."""
    (found,) = mapped.boundaries
    assert (found.of, found.outcome) == ("pitchfork", Outcome.REACHED_STOP)
    values = {key: np.array([point.parameters[i] for point in found.points]) for i, key in enumerate(found.keys)}
    np.testing.assert_allclose(values["peclet"], 2.0 * (2.0 + values["turnover_rate"]), rtol=1e-6)
    assert np.ptp(values["turnover_rate"]) == pytest.approx(5.75, abs=0.3)
    assert all(17.5 <= value <= 40.0 for value in values["peclet"])
    assert mapped.unexplained == []


def test_boundaries_agree_with_the_map(mapped: Diagram):
    """Changes of kind are between all neighbours on different sides, and within a cell of the curve."""
    changes, data = find_changes(mapped), mapped.dataset
    side = (data["peclet"] > 2.0 * (2.0 + data["turnover_rate"])).to_numpy()
    assert len(changes) == sum(int(np.abs(np.diff(side.astype(int), axis=axis)).sum()) for axis in (0, 1))
    (found,) = mapped.boundaries
    assert distances(np.stack([one.middle for one in changes]), found, mapped).max() < NEAR


def test_regimes_are_those_of_spheres_and_swimmers(mapped: Diagram):
    data = mapped.dataset
    is_polar = data["peclet"] > 2.0 * (2.0 + data["turnover_rate"])
    rest = Regime.NO_NECK | Regime.SYMMETRIC | Regime.RESTING
    sphere, swims = data["regime"].sel(state="trivial"), data["regime"].sel(state="default")
    polar = Regime.NO_NECK | Regime.ASYMMETRIC | Regime.SWIMMING | Regime.STABLE
    for expected, where, found in (
        (rest | Regime.STABLE, ~is_polar, sphere),
        (rest | Regime.UNSTABLE, is_polar, sphere),
        (polar, is_polar, swims),
        (0, ~is_polar, swims),
    ):
        assert (found.where(where, int(expected)) == int(expected)).all()
    meanings = data["regime"].attrs["flag_meanings"].split()
    assert [meanings[i] for i in range(8) if int(polar) >> i & 1] == ["no-neck", "asymmetric", "stable", "swimming"]
    assert {*mapped.regimes.ravel().tolist()} == {int(rest | Regime.STABLE), int(rest | Regime.UNSTABLE | polar)}


def test_words_for_regimes():
    both = Regime.NECK | Regime.NO_NECK | Regime.STABLE
    assert describe(int(both)) == "no neck & neck, stable"
    assert describe(0) == "no state"
    assert telling_aspects([int(both), int(Regime.NECK | Regime.STABLE)]) == Regime.NECK | Regime.NO_NECK
    assert describe(int(both), telling_aspects([int(both), int(Regime.NECK | Regime.STABLE)])) == "no neck & neck"


def test_boundaries_are_not_followed_twice(mapped: Diagram):
    before = {path: path.stat().st_mtime_ns for path in mapped.store.rglob("*")}
    diagram(swimmer(), X, Y, states=STATES, stability=True, boundaries=True, out=mapped.store, workers=1, resume=True)
    changed = {path.name for path, time in before.items() if path.exists() and path.stat().st_mtime_ns != time}
    assert BOUNDARIES not in changed
    assert not [path for path in before if CURVES in path.parts and path.name in changed]


def test_curves_are_drawn_over_maps(mapped: Diagram):
    axes = plot_diagram(mapped, "velocity").axes[0]
    assert COLOURS["pitchfork"] in [line.get_color() for line in axes.lines]
    assert axes.get_ylim()[1] < 14.0
    figure = plot_diagram(mapped, "regime")
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named == [
        "symmetric, stable, resting",
        "symmetric & asymmetric, stable & unstable, resting & swimming",
        "pitchforks",
    ]


FOLDS = (1.293485375, 2.362474188)
"""Of guided division at Pe = 450 by AUTO-07p: benchmarks/README.md."""


@pytest.fixture(scope="module")
def division(tmp_path_factory: pytest.TempPathFactory) -> Diagram:
    """Ellipsoids, dumbbells and what lies between, across the wedge."""
    out = tmp_path_factory.mktemp("boundaries") / "wedge"
    axes = ("ring_amplitude=0.9:2.7:7", "peclet=440:450:2")
    return diagram(scenario("guided-division", elements=40), *axes, branches=3, out=out, workers=1)


@pytest.mark.slow
def test_all_states_between_two_folds(division: Diagram):
    """Three between the folds that another program finds, one elsewhere; in the order of their bending energy."""
    row = division.dataset.sel(peclet=450.0)
    inside = (row["ring_amplitude"] > FOLDS[0]) & (row["ring_amplitude"] < FOLDS[1])
    assert row["n_states"].to_numpy().tolist() == np.where(inside, 3, 1).tolist()
    energy = row["bending_energy"]
    assert (energy.diff("state").where(inside, 1.0) > 0.0).all()
    necks = [bool(code & Regime.NECK) for code in division.regimes[-1].tolist()]
    rounds = [bool(code & Regime.NO_NECK) for code in division.regimes[-1].tolist()]
    # At ring_amplitude = 2.1 the ellipsoid has a slight waist already.
    assert (necks, rounds) == ([False] * 2 + [True] * 5, [True] * 4 + [False] * 3)
    assert (division.points, division.converged, division.failed) == (14, 14, [])
    assert division.dataset["state"].to_numpy().tolist() == ["state-1", "state-2", "state-3"]


@pytest.mark.slow
def test_folds_of_the_map_are_those_of_a_branch(division: Diagram):
    """To 1e-6, and those of another program; every change of the number of states lies within a cell of one."""
    found = diagram(
        division.scenario, *map(str, (division.request.grid.x, division.request.grid.y)), branches=3, boundaries=True,
        out=division.store, workers=1, resume=True,
    )  # fmt: skip
    assert found.unexplained == []
    ends = [point.parameters for curve in found.boundaries for point in curve.points]
    at_edge = sorted(float(one[0]) for one in ends if abs(one[1] - 450.0) < 1e-9)
    np.testing.assert_allclose(at_edge, FOLDS, atol=1e-6)


def test_bad_numbers_of_branches(tmp_path: Path):
    axes = ("ring_amplitude=0.9:2.7:7", "peclet=440:450:2")
    for arguments, part in (
        ({"branches": -1}, "--branches -1: must be 1 to 16, or 0 for the named states alone"),
        ({"branches": 17}, "--branches 17"),
        ({"origins": ("nowhere",)}, "give that too"),
        ({"branches": 2, "origins": ("nowhere",)}, "nowhere"),
    ):
        with pytest.raises((InputError, StoreError), match=re.escape(part)):
            diagram(scenario("guided-division"), *axes, out=tmp_path / "d", workers=1, **arguments)
    assert not (tmp_path / "d").exists()
