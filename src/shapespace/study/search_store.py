"""Searches for stationary states as results: in memory, or in a directory whose `tries/NNNNNN.npz` hold one try each; see
`records`.
"""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.frame import Array, Frame, arrays_of, frame_of_arrays, read_arrays, write_arrays
from shapespace.study.manifests import read_manifest, scenario_of
from shapespace.study.presenting import Plotted, Summary, Table
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import Scenario

SHOWN = ("height", "neck_radius", "velocity")
"""Observables by which states are told apart at a glance; all are in the store."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A start that a search tried, and what it led to.

    place: among the tries. start: how it was made. outcome: converged for a new state, repeated for a known one, neck-closed
    or self-intersecting for a new solution that is no physical shape, else why no solution was found. number: of the solution,
    known or new, counted from zero. frame: of a new solution, at time zero, with its observables; label: if it is a physical
    shape. is_mirrored: its mirror image is another state. growth_rates (m, 2): as of a `BranchPoint`, with errors (m,).
    """

    place: int
    start: str
    outcome: str
    iterations: int
    residual: float
    number: int | None = None
    label: str = ""
    is_mirrored: bool = False
    frame: Frame | None = None
    growth_rates: Array = field(default_factory=lambda: np.zeros((0, 2)))
    growth_rate_errors: Array = field(default_factory=lambda: np.zeros(0))
    parities: tuple[str | None, ...] = ()
    neutral: dict[int, str] = field(default_factory=dict)
    n_unstable: int | None = None

    @property
    def observables(self) -> dict[str, float]:
        """In the scenario's units; empty without a state."""
        return self.frame.observables if self.frame is not None else {}


_ARRAYS = ("growth_rates", "growth_rate_errors")
_WORDS = (
    "place",
    "start",
    "outcome",
    "iterations",
    "number",
    "label",
    "is_mirrored",
    "parities",
    "neutral",
    "n_unstable",
)


class SearchStore(AbstractRecordStore[Tried]):
    """The tries of one search. `create` and `resume` give a store to write, `open` one to read.

    The manifest's entry `search` says where it started: from which stores.
    """

    noun = "search"
    folder = "tries"
    note = "arrays of states are dimensionless, in units of the scales; observables and growth rates are in the scenario's units"

    @staticmethod
    def encode(record: Tried) -> bytes:
        """The arrays of a new state's frame, and what is known of the try."""
        words = json.dumps({name: getattr(record, name) for name in _WORDS})
        return write_arrays(
            {
                **(arrays_of(record.frame) if record.frame is not None else {}),
                **{name: getattr(record, name) for name in _ARRAYS},
                "residual": np.array(record.residual),
                "about": np.frombuffer(words.encode(), dtype=np.uint8),
            }
        )

    @staticmethod
    def decode(data: bytes) -> Tried:
        """The try in the bytes of a file."""
        stored = read_arrays(data)
        about: dict[str, Any] = json.loads(stored["about"].tobytes())
        values: dict[str, Any] = {name: about[name] for name in _WORDS} | {name: stored[name] for name in _ARRAYS}
        values["parities"] = tuple(values["parities"])
        values["neutral"] = {int(place): name for place, name in values["neutral"].items()}
        frame = frame_of_arrays(stored) if "mesh" in stored else None
        return Tried(**values, residual=float(stored["residual"]), frame=frame)

    @classmethod
    def create(cls, path: str | Path, scenario: Scenario, request: Mapping[str, Any]) -> Self:
        """A new store in a directory that is empty or does not exist; StoreError, and nothing written, otherwise."""
        return cls._create(path, scenario, {"search": dict(request)})

    @classmethod
    def resume(cls, path: str | Path, scenario: Scenario, request: Mapping[str, Any]) -> Self:
        """A stored search to continue. Checks every try; scenario and request must be the same."""
        path = Path(path)
        manifest = read_manifest(path, cls.noun, cls.folder)
        difference = scenario_of(path, cls.noun, manifest).difference(scenario)
        if not difference and manifest.get("search") != dict(request):
            difference = f"starts are {manifest.get('search')}, not {dict(request)}"
        if difference:
            raise StoreError(
                f"{path}: holds a search whose {difference}; resume with the same value or choose another --out."
            )
        return cls._reopen(path, scenario)

    def _disorder(self, previous: Tried, record: Tried) -> str | None:
        return None if record.place == previous.place + 1 else f"try {record.place} after {previous.place}"


@dataclass(frozen=True)
class Search(Plotted):
    """Stationary states of a scenario that a search found. tried: every start, in order, with what it led to."""

    outcome: Outcome | None
    scenario: Scenario
    tried: tuple[Tried, ...]
    store: Path | None = None

    @property
    def states(self) -> tuple[Tried, ...]:
        """The tries that found new states."""
        return tuple(one for one in self.tried if one.label)

    @property
    def table(self) -> Table:
        """The states with what tells them apart."""
        shown = [name for name in SHOWN if any(name in one.observables for one in self.states)]
        rows = [("state", *shown, "growing", "leading rate", "mirror")]
        for one in self.states:
            values = [_rounded(one.observables[name]) if name in one.observables else "" for name in shown]
            rate = f"{one.growth_rates[0][0]:.6g}" if len(one.growth_rates) else ""
            growing = "?" if one.n_unstable is None else str(one.n_unstable)
            rows.append((one.label, *values, growing, rate, "other" if one.is_mirrored else "same"))
        return rows

    @property
    def counts(self) -> str:
        """How many starts led to what, in words."""
        counts = Counter("new state" if one.label else one.outcome for one in self.tried)
        return f"{len(self.tried)} starts: {', '.join(f'{count} {name}' for name, count in counts.most_common())}"

    def summary(self) -> Summary:
        """The states found, and what the starts led to."""
        facts = {
            "outcome": f"{self.outcome}: {self.outcome.advice}" if self.outcome else "unfinished",
            "tried": self.counts,
            "store": str(self.store or "in memory"),
        }
        return Summary(f"Stationary states of {self.scenario.name}", facts, {"states": self.table})

    def label_of(self, one: Tried) -> str | None:
        """The label of the state that a try led to, if any."""
        return next((state.label for state in self.states if state.number == one.number), None)

    def __getitem__(self, label: str) -> Tried:
        """The state of a label; InputError lists the labels where there is none."""
        for state in self.states:
            if state.label == label:
                return state
        labels = ", ".join(state.label for state in self.states) or "another store, as it found no state"
        raise InputError(f"{label or 'no label'}: is no state of this search; choose one of {labels}.")


def _rounded(value: float) -> str:
    """Five decimals, and no minus before a zero."""
    return f"{round(value, 5) + 0.0:.5f}"


def open_search(path: str | Path) -> Search:
    """A stored search, finished or not. StoreError where there is none."""
    store = SearchStore.open(path)
    return Search(store.outcome, store.scenario, (*store,), store.path)
