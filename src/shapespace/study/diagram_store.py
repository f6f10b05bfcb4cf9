"""Diagrams as results: a directory that is one Zarr store, a chunk per tile, with the states that tiles start from.

    zarr.json, NAME/...   the Zarr store: what `xarray.open_zarr` reads
    anchors/NNNNNN.npz    of each asked state, what it is in the middle of every tile; see `records` for these and the rest

The chunks of a tile are written by whoever computes it, each in one step, that of `outcome` last: it marks the tile done.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import zarr
from numpy.typing import NDArray

from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.curve_store import Curve, open_curve
from shapespace.study.files import storage
from shapespace.study.frame import Array, read_arrays, write_arrays
from shapespace.study.grid import Axis, Grid
from shapespace.study.presenting import Plotted, Summary
from shapespace.study.records import AbstractRecordStore, holds_store
from shapespace.study.regimes import Regime
from shapespace.study.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr

OUTCOME, UNSTABLE, REGIME, COUNT = "outcome", "n_unstable", "regime", "n_states"
_OUTCOMES = (
    Outcome.CONVERGED,
    Outcome.NO_STATE,
    Outcome.NOT_REACHED,
    Outcome.DIVERGED,
    Outcome.MAX_ITERATIONS,
    Outcome.SINGULAR,
    Outcome.NOT_FINITE,
    Outcome.NECK_CLOSED,
    Outcome.SELF_INTERSECTING,
    Outcome.BRANCH_STALLED,
    Outcome.INFERRED,
)
CODES = {outcome: code for code, outcome in enumerate(_OUTCOMES, start=1)}
"""Numbers of outcomes in stores, which stay; 0 is a point that is not computed yet. Names are stored beside them."""
NOT_COMPUTED = 0
PHYSICAL_ENDS = [CODES[one] for one in (Outcome.NECK_CLOSED, Outcome.SELF_INTERSECTING)]
CURVES, BOUNDARIES = "curves", "boundaries.json"
"""Beside the Zarr store: a folder of curves, and what is known of changes of the map that lie on none."""
ABOUT_SOLUTION = {
    "correction": "size of the last Newton correction, relative to the state",
    "iterations": "Newton iterations",
    "elements": "collocation elements",
}


def kind_codes(outcome: Array, regime: Array, unstable: Array | None = None, but: int = 0) -> NDArray[np.int64]:
    """A number for what kind each state is of, from what is stored; 0 is none, -1 a surface that touches itself.

    unstable: numbers of growing modes. but: flags that make no difference.
    """
    code = regime.astype(np.int64) & ~but
    if unstable is not None:
        code += 256 * (1 + np.nan_to_num(unstable, nan=-1.0).astype(np.int64))
    # What is inferred has a regime where it is inferred that there is a state.
    is_state = (outcome == CODES[Outcome.CONVERGED]) | ((outcome == CODES[Outcome.INFERRED]) & (regime > 0))
    code[~is_state] = 0
    code[np.isin(outcome, PHYSICAL_ENDS)] = -1
    return code


@dataclass(frozen=True, eq=False)
class Anchors:
    """What a state is in the middle of the tiles, tile after tile.

    outcomes (m,): how it was found; meshes, xs: of those that were, else empty. All dimensionless.
    """

    state: str
    outcomes: tuple[Outcome, ...]
    meshes: tuple[Array, ...]
    xs: tuple[Array, ...]


@dataclass(frozen=True)
class DiagramRequest:
    """What is asked for besides the scenario.

    states: names. branches: with more than none, up to so many states at each point, on all sheets that folds connect with those
    named and those of the stores `origins`. adaptive: only at the points of a quad-tree.
    """

    grid: Grid
    states: tuple[str, ...]
    stability: bool
    branches: int = 0
    origins: tuple[str, ...] = ()
    adaptive: bool = False

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the states at one point."""
        return tuple(f"state-{number + 1}" for number in range(self.branches)) or self.states

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        axes = {name: asdict(axis) for name, axis in (("x", self.grid.x), ("y", self.grid.y))}
        more = {"branches": self.branches, "origins": [*self.origins]} if self.branches else {}
        more |= {"adaptive": True} if self.adaptive else {}
        return {**axes, "states": [*self.states], "stability": self.stability, **more}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """What `as_dict` described."""
        grid = Grid(Axis(**stored["x"]), Axis(**stored["y"]))
        more = stored.get("branches", 0), tuple(stored.get("origins", ())), stored.get("adaptive", False)
        return cls(grid, tuple(stored["states"]), stored["stability"], *more)


class DiagramStore(AbstractRecordStore[Anchors]):
    """One diagram. `create` and `resume` give a store to write, `open` one to read, also while it is being written."""

    noun = "diagram"
    folder = "anchors"
    note = "anchors are dimensionless, in units of the scales; observables are in the scenario's units"

    @staticmethod
    def encode(record: Anchors) -> bytes:
        """All anchors of one state in a few arrays."""
        words = json.dumps({"state": record.state, "outcomes": record.outcomes})
        empty = np.zeros(0)
        return write_arrays(
            {
                "mesh_sizes": np.array([len(one) for one in record.meshes]),
                "sizes": np.array([len(one) for one in record.xs]),
                "meshes": np.concatenate([empty, *record.meshes]),
                "xs": np.concatenate([empty, *record.xs]),
                "about": np.frombuffer(words.encode(), dtype=np.uint8),
            }
        )

    @staticmethod
    def decode(data: bytes) -> Anchors:
        """The anchors in the bytes of a file."""
        stored = read_arrays(data)
        about = json.loads(stored["about"].tobytes())
        meshes, xs = (
            tuple(np.split(stored[name], np.cumsum(stored[sizes])[:-1]))
            for name, sizes in (("meshes", "mesh_sizes"), ("xs", "sizes"))
        )
        return Anchors(about["state"], tuple(Outcome(one) for one in about["outcomes"]), meshes, xs)

    @classmethod
    def create(cls, path: str | Path, scenario: Scenario, request: DiagramRequest, observables: Sequence[str]) -> Self:
        """A new store, with no point computed, in a directory that is empty or does not exist; StoreError otherwise."""
        store = cls._create(path, scenario, {cls.noun: request.as_dict()})
        store.prepare(observables)
        return store

    @classmethod
    def resume(cls, path: str | Path, scenario: Scenario, request: DiagramRequest, observables: Sequence[str]) -> Self:
        """A stored diagram to continue; scenario and request must be the same."""
        path = Path(path)
        manifest = cls._read_manifest(path)
        stored, wanted = manifest.get(cls.noun), request.as_dict()
        difference = cls._scenario_of(path, manifest).difference(scenario)
        kept = stored if isinstance(stored, dict) else {}
        for name in dict.fromkeys((*wanted, *kept)):
            if kept.get(name) != wanted.get(name):
                difference = difference or f"{name} is {_short(kept.get(name))}, not {_short(wanted.get(name))}"
        if difference:
            raise StoreError(
                f"{path}: holds a diagram whose {difference}; resume with the same value or choose another --out."
            )
        store = cls._reopen(path, scenario)
        store.prepare(observables)
        return store

    def _disorder(self, previous: Anchors, record: Anchors) -> str | None:
        return None

    @cached_property
    def request(self) -> DiagramRequest:
        """What was asked for."""
        return DiagramRequest.from_dict(self.manifest[self.noun])

    def prepare(self, observables: Sequence[str]) -> None:
        """Make the arrays of the Zarr store, all fill, unless they are there: its description comes last."""
        with storage(self.path):
            if (self.path / "zarr.json").exists():
                return
            root = zarr.open_group(self.path, mode="a", zarr_format=3)
            grid, states = self.request.grid, self.request.labels
            names = [*observables, *ABOUT_SOLUTION]
            for axis in (grid.x, grid.y):
                coordinate = self._array(root, axis.key, (axis.key,), np.nan, "f8", (axis.count,), (axis.count,))
                coordinate[:] = axis.values
            dims: tuple[str, ...]
            shape: tuple[int, ...]
            chunks: tuple[int, ...]
            dims, shape, chunks = grid.keys[::-1], grid.shape[::-1], (grid.y.edge, grid.x.edge)
            if self.request.branches:
                self._array(root, COUNT, dims, -1, "i2", shape, chunks)
            if len(states) > 1:
                dims, shape, chunks = ("state", *dims), (len(states), *shape), (len(states), *chunks)
                label = root.create_array(
                    "state", shape=(len(states),), dtype="str", dimension_names=("state",), overwrite=True
                )
                label[:] = np.array(states)
            for name in names:
                self._array(root, name, dims, np.nan, "f8", shape, chunks)
            if self.request.stability:
                self._array(root, UNSTABLE, dims, np.nan, "f8", shape, chunks)
            self._array(root, REGIME, dims, 0, "u1", shape, chunks)
            self._array(root, OUTCOME, dims, NOT_COMPUTED, "i1", shape, chunks)
            root.attrs.update(self._attributes())
            with warnings.catch_warnings():
                # One read instead of one for each array; readers of the plain format pass over it.
                warnings.simplefilter("ignore", zarr.errors.ZarrUserWarning)
                zarr.consolidate_metadata(self.path)

    def _array(
        self, root: Any, name: str, dims: tuple[str, ...], fill: float, dtype: str, shape: Any, chunks: Any
    ) -> Any:
        return root.create_array(
            name,
            shape=shape,
            chunks=chunks,
            dtype=dtype,
            fill_value=fill,
            dimension_names=dims,
            attributes=self._about(name),
            overwrite=True,
        )

    def _about(self, name: str) -> dict[str, Any]:
        """Attributes of a variable."""
        if name == OUTCOME:
            meanings = ["not-computed", *CODES]
            return {"flag_values": [*range(len(meanings))], "flag_meanings": " ".join(meanings)}
        if name == REGIME:
            masks = {
                "flag_masks": [*map(int, Regime)],
                "flag_meanings": " ".join(one.words.replace(" ", "-") for one in Regime),
            }
            return {"long_name": "what the state is like; 0 where there is none", **masks}
        if name == COUNT:
            return {
                "long_name": "number of states found; where there are more than are stored, those of least bending energy are"
            }
        if name == UNSTABLE:
            return {"long_name": "number of growing modes"}
        if name in ABOUT_SOLUTION:
            return {"long_name": ABOUT_SOLUTION[name]}
        quantity = QUANTITIES[name]
        return {"long_name": quantity.meaning, "symbol": quantity.symbol, "units": self.scenario.scales.unit(name)}

    def _attributes(self) -> dict[str, Any]:
        manifest = self.manifest
        return {
            "title": f"{self.scenario.name}: stationary states over {' and '.join(self.request.grid.keys)}",
            "source": f"shapespace {self.versions['shapespace']}",
            "parameters": self.scenario.values(),
            **{name: manifest[name] for name in ("created", "versions", "scenario", "diagram")},
        }

    def write_tile(self, tile: tuple[int, int], values: Mapping[str, NDArray[Any]]) -> None:
        """The points of a tile, (states, n_x, n_y) by name; what is not given stays empty."""
        with storage(self.path, "nothing finished is lost: then resume the diagram"):
            # Without the lock: tiles are written by those who compute them, each its own chunks.
            root: Any = zarr.open_group(self.path, mode="r+")
            x, y = self.request.grid.span(tile)
            where = (..., y, x)
            for name in [*(set(values) - {OUTCOME}), OUTCOME]:
                rows = values[name].swapaxes(1, 2)
                root[name][where] = rows if len(rows) > 1 else rows[0]

    @property
    def outcomes(self) -> NDArray[np.int8]:
        """Codes (states, n_x, n_y) of all points."""
        root: Any = zarr.open_group(self.path, mode="r")
        codes = np.asarray(root[OUTCOME][...])
        return codes.reshape(-1, *codes.shape[-2:]).swapaxes(1, 2)

    @property
    def missing_tiles(self) -> list[tuple[int, int]]:
        """Tiles that are not done, in order."""
        grid, codes = self.request.grid, self.outcomes
        return [tile for tile in grid.tiles if (codes[(0, *grid.span(tile))] == NOT_COMPUTED).any()]


def _short(value: Any) -> str:
    if value is None:
        return "none"
    return str(Axis(**value)) if isinstance(value, dict) else str(value)


@dataclass(frozen=True, eq=False)
class Diagram(Plotted):
    """A map of stationary states, as far as it is computed. store: its directory, which is a Zarr store."""

    scenario: Scenario
    request: DiagramRequest
    store: Path

    @cached_property
    def dataset(self) -> "xr.Dataset":
        """Dimensions named as the two keys (and `state` where several are asked), a variable for each observable."""
        # Imported late: it takes half a second to load, and the explorer reads without it.
        import xarray as xr

        return xr.open_zarr(self.store).load()

    def summary(self) -> Summary:
        """Axes, how many points have a state, and the map."""
        facts = {
            "axes": ", ".join(str(axis) for axis in (self.request.grid.x, self.request.grid.y)),
            "states": ", ".join(self.request.states),
            "points": f"{self.points}, {self.converged} with a state, {len(self.failed)} without"
            + (f", {self.inferred} inferred" if self.request.adaptive else ""),
            "store": str(self.store),
        }
        return Summary(f"Diagram of {self.scenario.name}", facts, is_drawn=self.converged > 0)

    @property
    def points(self) -> int:
        """Points of the grid, times the states that were named."""
        return int(np.prod(self.request.grid.shape)) * (1 if self.request.branches else len(self.request.states))

    @property
    def converged(self) -> int:
        """Of these, those with a state that was computed."""
        is_state = self.dataset[OUTCOME] == CODES[Outcome.CONVERGED]
        return int((is_state.any("state") if self.request.branches > 1 else is_state).sum())

    @property
    def inferred(self) -> int:
        """Of these, those that an adaptive map was spared: they have a kind and no values."""
        return int((self.dataset[OUTCOME] == CODES[Outcome.INFERRED]).sum())

    @property
    def regimes(self) -> NDArray[np.int64]:
        """What the states at each point (n_y, n_x) are like, all of them together: flags of `Regime`, 0 where there is none."""
        x, y = self.request.grid.keys
        codes = self.dataset[REGIME].transpose(..., y, x).to_numpy().astype(np.int64)
        return np.asarray(np.bitwise_or.reduce(codes.reshape(-1, *codes.shape[-2:]), axis=0))

    @cached_property
    def boundaries(self) -> tuple[Curve, ...]:
        """Curves of folds and branch points that bound its regions, as far as they were followed."""
        paths = sorted(path for path in (self.store / CURVES).glob("*") if holds_store(path))
        return tuple(open_curve(path) for path in paths)

    @property
    def unexplained(self) -> list[tuple[float, float]] | None:
        """Values of both keys where neighbours differ in kind and no boundary passes; None before boundaries were followed."""
        path = self.store / BOUNDARIES
        with storage(path):
            if not path.exists():
                return None
            return [(x, y) for x, y in json.loads(path.read_text())["unexplained"]]

    @property
    def failed(self) -> list[dict[str, Any]]:
        """Computed points without a state: keys, state, outcome and reason."""
        (x, y), data = self.request.grid.keys, self.dataset
        codes = data[OUTCOME].transpose(..., y, x).to_numpy().reshape(-1, *self.request.grid.shape[::-1])
        names = {code: outcome for outcome, code in CODES.items()}
        is_failed = ~np.isin(codes, (NOT_COMPUTED, CODES[Outcome.CONVERGED], CODES[Outcome.INFERRED]))
        if self.request.branches:
            is_failed[1:] = False
            is_failed[0] &= ~(codes == CODES[Outcome.CONVERGED]).any(axis=0)
        return [
            {
                x: float(data[x][i]),
                y: float(data[y][j]),
                "state": self.request.labels[s],
                "outcome": names[int(codes[s, j, i])].value,
                "reason": names[int(codes[s, j, i])].advice,
            }
            for s, j, i in np.argwhere(is_failed)
        ]


def open_diagram(path: str | Path) -> Diagram:
    """A stored diagram, finished or not. StoreError where there is none."""
    store = DiagramStore.open(path)
    return Diagram(store.scenario, store.request, store.path)
