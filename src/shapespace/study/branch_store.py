"""Branches as results: in memory, or in a directory whose `points/NNNNNN.npz` hold one state each; see `records`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint, decode_point, encode_point
from shapespace.study.manifests import read_manifest, scenario_of
from shapespace.study.presenting import Plotted, Summary
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import Scenario

START = "start"
"""Label of the first point."""


class HasPlace(Protocol):
    """A point of a branch or a curve."""

    @property
    def leg(self) -> int:
        """0 on the way to the stop, 1 on the way back."""

    @property
    def arclength(self) -> float:
        """From the start."""


P = TypeVar("P", bound=HasPlace)


class AbstractPathStore(AbstractRecordStore[P]):
    """The points of one path through states. The manifest's entry named as the store says what was asked for."""

    folder = "points"

    @classmethod
    def create(cls, path: str | Path, scenario: Scenario, request: Mapping[str, Any]) -> Self:
        """A new store in a directory that is empty or does not exist; StoreError, and nothing written, otherwise."""
        return cls._create(path, scenario, {cls.noun: dict(request)})

    @classmethod
    def resume(cls, path: str | Path, scenario: Scenario, request: Mapping[str, Any]) -> Self:
        """A stored path to continue. Checks every point; scenario and request must be the same."""
        path = Path(path)
        manifest = read_manifest(path, cls.noun, cls.folder)
        stored, wanted = manifest.get(cls.noun), dict(request)
        difference = scenario_of(path, cls.noun, manifest).difference(scenario)
        if not isinstance(stored, dict):
            raise StoreError(f"{path / 'store.json'}: is damaged (no {cls.noun}); restore it, or choose another --out.")
        for name, value in wanted.items():
            if stored.get(name) != value:
                difference = difference or f"{name} is {stored.get(name)!r}, not {value!r}"
        if difference:
            raise StoreError(
                f"{path}: holds a {cls.noun} whose {difference}; resume with the same value or choose another --out."
            )
        return cls._reopen(path, scenario)

    @property
    def request(self) -> dict[str, Any]:
        """What was asked for."""
        return dict(self.manifest[self.noun])

    def _disorder(self, previous: P, record: P) -> str | None:
        if (record.leg, record.arclength) >= (previous.leg, previous.arclength):
            return None
        return f"arclength {record.arclength:g} after {previous.arclength:g}"


class BranchStore(AbstractPathStore[BranchPoint]):
    """The points of one branch. `create` and `resume` give a store to write, `open` one to read.

    The manifest's entry `branch` says which branch: key, free, start, stop, at, and how it was begun.
    """

    noun = "branch"
    note = (
        "arrays of states and modes are dimensionless, in units of the scales; parameters, observables and growth rates are in "
        "the scenario's units"
    )

    encode = staticmethod(encode_point)
    decode = staticmethod(decode_point)


@dataclass(frozen=True)
class Branch(Plotted):
    """Stationary states of a scenario along a change of one key, or of an observable while a key `free` answers.

    points: in the order of the branch, special ones included.
    detail: of a start that failed in this session, how near to a solution it came.
    """

    outcome: Outcome | None
    scenario: Scenario
    key: str
    points: tuple[BranchPoint, ...]
    store: Path | None = None
    detail: str = ""
    free: str | None = None

    @property
    def special_points(self) -> tuple[BranchPoint, ...]:
        """Folds, branch points, Hopf points, user points and ends, in the order of the branch."""
        return tuple(point for point in self.points if point.label and point.label != START)

    def summary(self) -> Summary:
        """Key and range, counts of points and of stable ones, special points, and the diagram."""
        values = [point.parameter for point in self.points]
        known = [point.n_unstable for point in self.points if point.is_step and point.n_unstable is not None]
        facts = {
            "along": f"{self.key} from {values[0]:.6g} to {values[-1]:.6g}" if values else self.key,
            "outcome": str(self.outcome or "unfinished"),
            "points": f"{len(self.points)}, {known.count(0)} of {len(known)} with known growth rates stable",
            "store": str(self.store or "in memory"),
        }
        rows = [("label", self.key, "error", "growing modes before, after")]
        for point in self.special_points:
            counts = (point.n_unstable_before, point.n_unstable_after)
            told = "" if None in counts else f"{counts[0]}, {counts[1]}"
            rows.append((point.label, f"{point.parameter:.8g}", f"{point.parameter_error:.1g}", told))
        title = f"Branch of {self.scenario.name} in {self.key}"
        return Summary(title, facts, {"special points": rows}, is_drawn=len(values) > 1)

    @property
    def began(self) -> str:
        """What the branch began at: the name of a state, or a stored one as `STORE:LABEL`; empty where it did not begin."""
        return next((point.began for point in self.points if point.label == START), "")

    @property
    def missed(self) -> tuple[dict[str, Any], ...]:
        """Brackets between neighbours in which something lies that was not found."""
        return tuple(one for point in self.points for one in point.missed)

    def __getitem__(self, label: str) -> BranchPoint:
        """The point of a label; InputError lists the labels where there is none."""
        for point in self.points:
            if label and point.label == label:
                return point
        labels = ", ".join(point.label for point in self.points if point.label)
        raise InputError(f"{label}: is no label of this branch; choose one of {labels}.")

    def scenario_at(self, point: BranchPoint) -> Scenario:
        """The scenario whose stationary state a point is."""
        return self.scenario.with_overrides({self.free or self.key: point.value})


def open_branch(path: str | Path) -> Branch:
    """A stored branch, finished or not. StoreError where there is none, or nothing in it yet."""
    store = BranchStore.open(path)
    if not len(store):
        raise StoreError(f"{path}: holds no point yet; continue the branch with --resume.")
    request = store.request
    return collected(store.scenario, request["key"], request.get("free"), [*store], store.outcome, store.path)


def collected(
    scenario: Scenario,
    key: str,
    free: str | None,
    points: Sequence[BranchPoint],
    outcome: Outcome | None,
    store: Path | None,
) -> Branch:
    """A branch from its points in the order in which they were computed."""
    return Branch(outcome, scenario, key, tuple(sorted(points, key=lambda point: point.place)), store, free=free)
