"""States over two parameters of Chan's problem: as found one by one, none beyond the fold, and no other branch's."""

import numpy as np

from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.analysis.sweeping import Sweep
from shapespace.base.outcome import Outcome
from shapespace.study.verification.classic import at_rest, chan

FOLD = 4.041401867
"""a, at b = 0.01; tests/classic.py."""


def values(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(a, b, indexing="ij"), axis=-1)


def start(a: float, b: float) -> Stationary:
    problem = chan()
    return step_to(solve_stationary(problem, at_rest(problem), np.array([0.0, b])), np.array([a, b]))


def test_states_are_those_of_single_solves():
    sweep = Sweep(values(np.linspace(2.0, 3.8, 8), np.linspace(0.01, 0.02, 4)))
    assert sweep.begin((2, 1), start(2.5, 0.012))
    sweep.spread((2, 1))
    assert not sweep.missing
    for at in ((0, 0), (7, 0), (4, 3)):
        found, single = sweep.found[at], start(*sweep.p(at))
        difference = found.problem.norm(found.x - single.problem.carried(single.x, found.problem), found.x)
        assert difference < 1e-6  # two meshes that both meet 1e-6
        assert found.correction < 1e-8


def test_no_states_beyond_a_fold():
    """The upper branch that is there is another state."""
    a = np.linspace(3.5, 4.3, 9)
    sweep = Sweep(values(a, np.array([0.01, 0.0101])))
    assert sweep.begin((0, 0), start(3.5, 0.01))
    sweep.spread((0, 0))
    assert [(i, 0) in sweep.found for i in range(9)] == (a < FOLD).tolist()
    assert all(one in (Outcome.NOT_REACHED, Outcome.NO_STATE) for one in sweep.reasons.values())
    middles = [one.problem.unpack(one.x).values(np.array([0.5]))[0, 0] for one in sweep.found.values()]
    assert max(middles) < 2.0  # the fold is at T = 1.3; the upper branch lies above 10 here


def test_what_exists_does_not_depend_on_where_it_begins():
    grid = values(np.linspace(3.0, 4.2, 7), np.linspace(0.01, 0.011, 3))
    found = []
    for at in ((0, 0), (2, 2)):
        sweep = Sweep(grid)
        assert sweep.begin(at, start(*sweep.p(at)))
        sweep.spread(at)
        found.append(sweep.found)
    assert found[0].keys() == found[1].keys()
    for at, one in found[0].items():
        other = found[1][at]
        assert one.problem.norm(other.problem.carried(other.x, one.problem) - one.x, one.x) < 1e-6
