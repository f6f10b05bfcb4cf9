"""Small stores of every kind, and a large map of spheres, whose states are known without solving."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.app.served import MoreStores, Stores

from shapespace.base.outcome import Outcome
from shapespace.study.branching import branch
from shapespace.study.curve_store import CurveStore
from shapespace.study.curves import curve
from shapespace.study.diagram_store import CODES, CURVES, OUTCOME, REGIME, Anchors, DiagramRequest, DiagramStore
from shapespace.study.diagrams import diagram, make_request
from shapespace.study.engine import Engine
from shapespace.study.grid import Axis, Grid
from shapespace.study.named import reference
from shapespace.study.regimes import Regime
from shapespace.study.run import run
from shapespace.study.scenario import Scenario, scenario
from shapespace.study.searching import search_states
from shapespace.study.steady import observables_at
from shapespace.study.tiles import observable_names

X, Y = "peclet", "inverse_hydrodynamic_length"


def swimmer(**changes: float) -> Scenario:
    """On few elements."""
    return scenario("polar-swimmer", elements=20, mesh_tolerance=1e-3, **changes)


def make_stores(folder: Path) -> Stores:
    """Those that most tests need."""
    return Stores(make_run(folder / "run"), make_branch(folder / "branch"), make_map(folder / "map", 100))


def make_more(folder: Path, spheres: Path) -> MoreStores:
    """Of the other kinds. spheres: the branch above."""
    division = make_division(folder / "division")
    return MoreStores(
        division,
        make_curve(folder / "folds", f"{division}:fold-1", X, 460.0),
        make_curve(folder / "forks", f"{spheres}:pitchfork-1", "turnover_rate", 11.0),
        make_search(folder / "search"),
        make_states(folder / "states"),
    )


def make_branch(path: Path) -> Path:
    """The sphere through the onset of swimming."""
    branch(swimmer(), X, 24.0, start=20.0, at=(23.0,), state="trivial", out=path)
    return path


def make_run(path: Path, until: float = 0.02) -> Path:
    """The first steps of a division."""
    run(scenario("guided-division", elements=20, mesh_tolerance=1e-3, until=until), out=path)
    return path


def make_division(path: Path) -> Path:
    """Past the first fold of guided division; its curve bends, and ends where special points crowd."""
    division = scenario("guided-division", elements=20, mesh_tolerance=1e-2)
    branch(division, "ring_amplitude", 2.4, start=0.0, state="trivial", out=path)
    return path


def make_curve(path: Path, origin: str, key: str, stop: float) -> Path:
    """Of a special point, a little way."""
    curve(origin, key, stop, out=path)
    return path


def make_search(path: Path) -> Path:
    """Two states, of which one is stable."""
    search_states(swimmer(peclet=24.0), max_tries=3, out=path)
    return path


def make_states(path: Path) -> Path:
    """A map of two states, one of which is not everywhere, with the pitchforks between and folds that are made up."""
    axes = f"{X}=20:36:6", "turnover_rate=8:12:4"
    diagram(swimmer(), *axes, states=("trivial", "default"), stability=True, boundaries=True, workers=1, out=path)
    (forks,) = (path / CURVES).iterdir()
    known = CurveStore.open(forks)
    aside = np.array([3.0 if key == X else 0.0 for key in known.request["keys"]])
    with CurveStore.create(path / CURVES / "made-up", known.scenario, known.request) as store:
        for number, point in enumerate(known):
            named = {"label": "cusp-1", "kind": "cusp"} if number == len(known) // 2 else {}
            store.append(replace(point, of="fold", parameters=point.parameters + aside, **named))
        store.finish(Outcome.REACHED_STOP)
    return path


def make_map(path: Path, count: int) -> Path:
    """A map of spheres at rest; its velocity is made up, so that there is something to see."""
    at = reference(swimmer())
    grid = Grid(Axis(X, 10.0, 20.0, count), Axis(Y, 0.5, 5.0, count))
    request: DiagramRequest = make_request(at, grid, ("trivial",), stability=False)
    with DiagramStore.create(path, at, request, observable_names(at, grid.keys)) as store:
        store.append(_spheres(at, grid))
        engine = Engine.of(at)
        known = observables_at(at, engine.problem, engine.problem.pack(engine.initial_state()))
        names = [name for name in observable_names(at, grid.keys) if name in known]
        for tile in grid.tiles:
            x, y = grid.span(tile)
            q = grid.values(x, y)
            values = {name: np.full((1, *q.shape[:2]), known[name]) for name in names}
            values["velocity"] = made_up(q[..., 0], q[..., 1])[None]
            values[REGIME] = np.where(values["velocity"] < -1.5, Regime.SWIMMING, Regime.RESTING).astype(np.uint8)
            values[OUTCOME] = np.full((1, *q.shape[:2]), CODES[Outcome.CONVERGED], np.int8)
            store.write_tile(tile, values)
        store.finish(Outcome.COMPLETE)
    return path


def made_up(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The velocity of a map of spheres."""
    return np.sin(x) * np.cos(y) - 0.1 * x


def _spheres(at: Scenario, grid: Grid) -> Anchors:
    meshes, xs = [], []
    for i, j in grid.tiles:
        q = grid.values(grid.x.anchors[i], grid.y.anchors[j]).reshape(2)
        engine = Engine.of(at.with_overrides({X: q[0], Y: q[1]}))
        meshes.append(engine.problem.mesh)
        xs.append(engine.problem.pack(engine.initial_state()))
    return Anchors("trivial", (Outcome.CONVERGED,) * len(xs), tuple(meshes), tuple(xs))
