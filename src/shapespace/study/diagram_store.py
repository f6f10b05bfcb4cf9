"""Diagrams as results: a directory that is one Zarr store, a chunk per tile, with the states that tiles start from.

    zarr.json, NAME/...   the Zarr store: what `xarray.open_zarr` reads
    anchors/NNNNNN.npz    of each asked state, what it is in the middle of every tile; see `records` for these and the rest
    shapes/NNNNNN.npz     of each tile, some of its states

The chunks of a tile are written by whoever computes it, each in one step, that of `outcome` last: it marks the tile done.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from shapespace.base.errors import StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.curve_store import Curve, open_curve
from shapespace.study.diagram_arrays import (
    Variable,
    are_whole,
    chunk_file,
    damaged_chunks,
    make_arrays,
    open_arrays,
    reading,
    write_chunks,
)
from shapespace.study.diagram_request import DiagramRequest
from shapespace.study.diagram_shapes import (
    Anchors,
    Shape,
    decode_anchors,
    decode_shapes,
    encode_anchors,
    encode_shapes,
)
from shapespace.study.files import storage, write_atomically
from shapespace.study.frame import DAMAGE, Array
from shapespace.study.grid import Axis, Tile
from shapespace.study.manifests import holds_store, read_manifest, scenario_of
from shapespace.study.presenting import Plotted, Summary
from shapespace.study.records import AbstractRecordStore
from shapespace.study.regimes import Regime
from shapespace.study.scenario import Scenario
from shapespace.study.versions import own_version

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
SHAPES, CURVES, BOUNDARIES = "shapes", "curves", "boundaries.json"
"""Beside the Zarr store: folders of states and of curves, and what is known of changes of the map that lie on none."""
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


class DiagramStore(AbstractRecordStore[Anchors]):
    """One diagram. `create` and `resume` give a store to write, `open` one to read, also while it is being written."""

    noun = "diagram"
    folder = "anchors"
    note = "anchors are dimensionless, in units of the scales; observables are in the scenario's units"

    encode = staticmethod(encode_anchors)
    decode = staticmethod(decode_anchors)

    @classmethod
    def create(cls, path: str | Path, scenario: Scenario, request: DiagramRequest, observables: Sequence[str]) -> Self:
        """A new store, with no point computed, in a directory that is empty or does not exist; StoreError otherwise."""
        more = {cls.noun: request.as_dict()}
        return cls._create(path, scenario, more, lambda store: store.make_arrays(observables))

    @classmethod
    def resume(cls, path: str | Path, scenario: Scenario, request: DiagramRequest, observables: Sequence[str]) -> Self:
        """A stored diagram to continue; scenario, request and the version of this package must be the same.

        What is damaged counts as not computed.
        """
        path = Path(path)
        manifest = read_manifest(path, cls.noun, cls.folder)
        stored, wanted = manifest.get(cls.noun), request.as_dict()
        kept = stored if isinstance(stored, dict) else {}
        differences = [
            f"{name} is {_short(kept.get(name))}, not {_short(wanted.get(name))}"
            for name in dict.fromkeys((*wanted, *kept))
            if kept.get(name) != wanted.get(name)
        ]
        if of_scenario := scenario_of(path, cls.noun, manifest).difference(scenario):
            differences.insert(0, of_scenario)
        if differences:
            raise StoreError(
                f"{path}: holds a diagram whose {' and '.join(differences)}; resume with the same value or choose another --out."
            )
        if (version := manifest["versions"]["shapespace"]) != own_version():
            raise StoreError(
                f"{path}: was begun by shapespace {version}, this is {own_version()}; resume with that version or choose "
                "another --out."
            )
        store = cls._reopen(path, scenario)
        try:
            store.mend(observables)
        except BaseException:
            store.close()
            raise
        return store

    def _disorder(self, previous: Anchors, record: Anchors) -> str | None:
        return None

    @cached_property
    def request(self) -> DiagramRequest:
        """What was asked for."""
        return DiagramRequest.from_dict(self.manifest[self.noun])

    def mend(self, observables: Sequence[str]) -> None:
        """Make arrays that are not there, and take the mark from tiles of which a part is damaged."""
        with storage(self.path):
            for leftover in self.path.rglob("*.partial"):
                leftover.unlink()
            if not are_whole(self.path):
                self.make_arrays(observables)
            outcome = open_arrays(self.path)[OUTCOME]
            for tile, file in [*damaged_chunks(self.path, self.request.grid.tiles), *self._damaged_shapes()]:
                chunk_file(self.path, outcome, tile).unlink(missing_ok=True)
                file.unlink(missing_ok=True)

    def _damaged_shapes(self) -> Iterator[tuple[Tile, Path]]:
        for tile in self.request.grid.tiles:
            try:
                self.read_shapes(tile)
            except StoreError:
                yield tile, self._shapes_file(tile)

    def make_arrays(self, observables: Sequence[str]) -> None:
        """Make the arrays of the Zarr store, with nothing computed."""
        grid, states = self.request.grid, self.request.labels
        dims: tuple[str, ...] = grid.keys[::-1]
        shape: tuple[int, ...] = grid.shape[::-1]
        chunks: tuple[int, ...] = (grid.y.edge, grid.x.edge)
        variables = [
            Variable(
                axis.key, (axis.key,), (axis.count,), (axis.count,), "f8", np.nan, self._about(axis.key), axis.values
            )
            for axis in (grid.x, grid.y)
        ]
        if self.request.branches:
            variables.append(Variable(COUNT, dims, shape, chunks, "i2", -1, self._about(COUNT)))
        if len(states) > 1:
            count = len(states)
            dims, shape, chunks = ("state", *dims), (count, *shape), (count, *chunks)
            variables.append(Variable("state", ("state",), (count,), (count,), "str", "", {}, np.array(states)))
        kinds = {UNSTABLE: ("f8", np.nan)} if self.request.stability else {}
        kinds |= {REGIME: ("u1", 0), OUTCOME: ("i1", NOT_COMPUTED)}
        for name, (dtype, fill) in {**dict.fromkeys((*observables, *ABOUT_SOLUTION), ("f8", np.nan)), **kinds}.items():
            variables.append(Variable(name, dims, shape, chunks, dtype, fill, self._about(name)))
        with storage(self.path):
            make_arrays(self.path, variables, self._attributes())

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

    def write_tile(self, tile: Tile, values: Mapping[str, NDArray[Any]], shapes: Sequence[Shape] = ()) -> None:
        """The points of a tile, (states, n_x, n_y) by name, and states of it; what is not given stays empty."""
        # Without the lock: tiles are written by those who compute them, each its own chunks.
        with storage(self.path, "nothing finished is lost: then resume the diagram"):
            if shapes:
                file = self._shapes_file(tile)
                file.parent.mkdir(exist_ok=True)
                write_atomically(file, encode_shapes(shapes))
            rows = {name: array.swapaxes(1, 2) for name, array in values.items()}
            write_chunks(
                self.path, tile, {name: one if len(one) > 1 else one[0] for name, one in rows.items()}, OUTCOME
            )

    def read_shapes(self, tile: Tile) -> tuple[Shape, ...]:
        """States of a tile that are stored whole, none of one that is not computed. StoreError where they are damaged."""
        file = self._shapes_file(tile)
        with storage(file):
            if not file.exists():
                return ()
            data = file.read_bytes()
        try:
            return decode_shapes(data)
        except DAMAGE as error:
            raise StoreError(f"{file}: is damaged ({error}); resume the diagram to compute it again.") from None

    def _shapes_file(self, tile: Tile) -> Path:
        return self.path / SHAPES / f"{self.request.grid.number(tile):06d}.npz"

    @property
    def outcomes(self) -> NDArray[np.int8]:
        """Codes (states, n_x, n_y) of all points."""
        with reading(self.path, self.request.grid.tiles):
            codes = np.asarray(open_arrays(self.path)[OUTCOME][...])
        return codes.reshape(-1, *codes.shape[-2:]).swapaxes(1, 2)

    @property
    def missing_tiles(self) -> list[Tile]:
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

        open_arrays(self.store)
        with reading(self.store, self.request.grid.tiles):
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
