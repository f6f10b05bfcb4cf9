"""Stores whose states are records one after another: runs, branches, curves and searches."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from shapespace.app.encoding import exact
from shapespace.app.source import AbstractSource, described, is_marginal, rates_of
from shapespace.app.tables import columns_of, readable, table, telling
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import START, BranchStore
from shapespace.study.curve_store import CurvePoint, CurveStore, outline
from shapespace.study.frame import Array, Frame
from shapespace.study.scenario import Scenario
from shapespace.study.search_store import SearchStore, Tried
from shapespace.study.store import RunStore

if TYPE_CHECKING:
    from shapespace.study.modes import Modes

R = TypeVar("R")


class AbstractRecords(AbstractSource, Generic[R]):
    """A store of numbered records; the place of a state is the number of its record."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._read: tuple[dict[int, R], list[str]] | None = None

    def forget(self) -> None:
        super().forget()
        self._read = None

    def records(self) -> dict[int, R]:
        """All records that are whole, by number."""
        store = self.store()
        if self._read is None:
            self._read = readable(store)
        return self._read[0]

    def damage(self) -> list[str]:
        self.records()
        assert self._read is not None
        return self._read[1]

    def record(self, place: str) -> R:
        """One record. InputError where there is none of this number."""
        store = self.store()
        if not place.isdecimal() or not int(place) < len(store):
            raise InputError(f"{self.path}: has no state {place[:20]!r}; it has {len(store)} {store.folder}.")
        known = self._read[0] if self._read is not None else {}
        return known[int(place)] if int(place) in known else store.read(int(place))

    def places(self) -> Iterator[str]:
        return map(str, self.records())

    def start(self, place: str, label: str = "") -> str:
        """The state as the command line finds it."""
        return f"{self.path.resolve()}:{label or place}"

    def fields(self, at: Scenario, frame: Frame) -> dict[str, Array]:
        """Profiles of a state."""
        # Imported late: the library of derivatives takes a second to load.
        from shapespace.study.dataset import profile_of

        return profile_of(at, frame)

    def modes(self, place: str) -> "Modes | None":
        return None


def _rates_of(point: BranchPoint | Tried) -> dict[str, Any] | None:
    """Growth rates as they are stored, None where none are."""
    if not len(point.growth_rates):
        return None
    return rates_of(point.growth_rates, point.growth_rate_errors, point.parities, point.neutral)


class RunSource(AbstractRecords[Frame]):
    """A run over time, or one state that `steady` stored."""

    noun = "run"
    kind = RunStore

    @property
    def called(self) -> str:
        return "stationary state" if self.store().outcome is Outcome.CONVERGED else self.noun

    def content(self) -> dict[str, Any]:
        at, frames = self.store().scenario, self.records()
        columns = columns_of([{"time": frame.time, **frame.observables} for frame in frames.values()])
        return table(columns, "time", telling(at, columns, ["time"]), [*frames])

    def state(self, place: str) -> dict[str, Any]:
        frame, store = self.record(place), self.store()
        number, at = int(place), store.scenario
        fields = self.fields(at, frame)
        if number == 0 and len(store) > 1:
            from shapespace.study.dataset import make_dataset

            # The first state is given, not solved for: its flow is that of the first step, unknown where that is damaged.
            later = [one for n, one in self.records().items() if n == 1]
            first = make_dataset(at, [frame, *later], None).isel(time=0)
            fields = {name: first[name].to_numpy() for name in fields if name in first}
        modes = self.modes(place)
        rests = number == len(store) - 1 and store.outcome in (Outcome.STATIONARY, Outcome.CONVERGED)
        return described(
            at,
            frame,
            fields,
            self.store(),
            self.start(place),
            place=place,
            title=f"frame {number}" if len(store) > 1 else "stationary state",
            time=frame.time if self.called == self.noun else None,
            rates=rates_of(modes.growth_rates, modes.errors, modes.parities, modes.neutral)
            if modes is not None
            else None,
            can_compute=modes is None and rests,
        )

    def modes(self, place: str) -> "Modes | None":
        from shapespace.study.modes import MODES_FILE, find_modes

        return find_modes(str(self.path)) if (self.path / MODES_FILE).is_file() else None

    def resting(self, place: str) -> tuple[Scenario, Frame]:
        store = self.store()
        if store.outcome not in (Outcome.STATIONARY, Outcome.CONVERGED) or int(place) != len(store) - 1:
            raise InputError("this surface moves: growth rates belong to states at rest, as at the end of a run.")
        from shapespace.study.steady import settled

        return store.scenario, settled(store.scenario, self.record(place))


class BranchSource(AbstractRecords[BranchPoint]):
    """A branch in one key."""

    noun = "branch"
    kind = BranchStore

    def content(self) -> dict[str, Any]:
        points, request = self.records(), self.request
        order = sorted(points, key=lambda number: points[number].place)
        ordered = [points[i] for i in order]
        key, free = request["key"], request.get("free")
        rows = [
            {**one.observables, key: one.parameter, **({free: one.value} if free else {}), "arclength": one.place}
            for one in ordered
        ]
        columns = columns_of([{key: row[key]} | row for row in rows])
        y = free if free in columns else telling(self.store().scenario, columns, (key, "arclength"))
        return table(
            columns,
            key,
            y,
            order,
            labels=[one.label if one.label != START else "" for one in ordered],
            kinds=[one.kind if one.label != START else "" for one in ordered],
            unstable=[one.n_unstable for one in ordered],
            marginal=[is_marginal(one.neutral) for one in ordered],
            segments=[_between(one, other) for one, other in pairwise(ordered)],
        )

    @property
    def over(self) -> str:
        return f" in {self.request['key']}"

    @property
    def request(self) -> dict[str, Any]:
        """What was followed."""
        store = self.store()
        assert isinstance(store, BranchStore)
        return store.request

    def scenario_at(self, point: BranchPoint) -> Scenario:
        """The scenario whose state a point is."""
        request = self.request
        return self.store().scenario.with_overrides({request.get("free") or request["key"]: point.value})

    def state(self, place: str) -> dict[str, Any]:
        point, request = self.record(place), self.request
        at, free = self.scenario_at(point), request.get("free")
        label = point.label if point.label != START else ""
        return described(
            at,
            point.frame,
            self.fields(at, point.frame),
            self.store(),
            self.start(place, label),
            vary=free or request["key"],
            stop=None if free else float(request["stop"]),
            kind=point.kind,
            place=place,
            title=label or f"point {place}",
            parameters={request["key"]: point.parameter, **({free: point.value} if free else {})},
            parameter_error=point.parameter_error if label else None,
            rates=_rates_of(point),
            unstable=point.n_unstable,
            can_compute=not len(point.modes) and free is None,
        )

    def stored_rates(self, place: str) -> Array | None:
        point = self.record(place)
        return point.growth_rates if len(point.growth_rates) else None

    def modes(self, place: str) -> "Modes | None":
        point = self.record(place)
        if not len(point.modes):
            return None
        from shapespace.study.modes import Modes

        rates, errors = point.growth_rates, point.growth_rate_errors
        return Modes(
            self.scenario_at(point), point.frame, rates, errors, point.modes, tuple(point.parities), point.neutral
        )

    def resting(self, place: str) -> tuple[Scenario, Frame]:
        if self.request.get("free"):
            raise InputError("this state rests under a control; its modes are stored at labelled points only.")
        point = self.record(place)
        return self.scenario_at(point), point.frame


def _between(one: BranchPoint, other: BranchPoint) -> int | None:
    """How many modes grow between neighbours on a branch: as at the end that is a step of it, not a located point."""
    if other.is_step or not one.is_step:
        return other.n_unstable if other.is_step else one.n_unstable_after
    return one.n_unstable


class CurveSource(AbstractRecords[CurvePoint]):
    """A curve of folds or branch points in the plane of two keys."""

    noun = "curve"
    kind = CurveStore

    @property
    def over(self) -> str:
        return f"{f' of {self._of}s' if self._of else ''} in {' and '.join(self.keys)}"

    @property
    def _of(self) -> str:
        """What the curve consists of, empty where nothing is stored yet."""
        return next((one.of for one in self.records().values()), "")

    @property
    def keys(self) -> tuple[str, str]:
        """Of the plane."""
        store = self.store()
        assert isinstance(store, CurveStore)
        first, second = store.request["keys"]
        return first, second

    def content(self) -> dict[str, Any]:
        points, (x, y) = self.records(), self.keys
        order = sorted(points, key=lambda number: points[number].place)
        ordered = [points[i] for i in order]
        rows = [
            {x: float(one.parameters[0]), y: float(one.parameters[1]), **one.observables, "arclength": one.place}
            for one in ordered
        ]
        line = outline(ordered) if ordered else np.zeros((2, 0))
        return table(
            columns_of(rows),
            x,
            y,
            order,
            labels=[one.label if one.label != START else "" for one in ordered],
            kinds=[one.kind if one.label != START else "" for one in ordered],
            outline={"x": exact(line[0]), "y": exact(line[1])},
            of=self._of,
        )

    def scenario_at(self, point: CurvePoint) -> Scenario:
        """The scenario whose state a point is."""
        return self.store().scenario.with_overrides(dict(zip(self.keys, point.parameters.tolist(), strict=True)))

    def state(self, place: str) -> dict[str, Any]:
        point = self.record(place)
        at = self.scenario_at(point)
        label = point.label if point.label != START else ""
        return described(
            at,
            point.frame,
            self.fields(at, point.frame),
            self.store(),
            self.start(place, label),
            vary=self.keys[0],
            kind=point.of,
            place=place,
            title=label or f"{point.of} {place}",
            parameters=dict(zip(self.keys, point.parameters.tolist(), strict=True)),
            rates=None,
            can_compute=True,
        )

    def resting(self, place: str) -> tuple[Scenario, Frame]:
        point = self.record(place)
        return self.scenario_at(point), point.frame


class SearchSource(AbstractRecords[Tried]):
    """The states that a search found."""

    noun = "search"
    kind = SearchStore

    def places(self) -> Iterator[str]:
        return (str(number) for number, one in self.records().items() if one.label)

    def content(self) -> dict[str, Any]:
        found = [(number, one) for number, one in self.records().items() if one.label]
        rows: list[dict[str, float]] = [{"state": i + 1.0, **one.observables} for i, (_, one) in enumerate(found)]
        columns = columns_of(rows)
        y = telling(self.store().scenario, columns, ("state",)) if rows else "state"
        return table(
            columns,
            "state",
            y,
            [number for number, _ in found],
            line=False,
            labels=[one.label for _, one in found],
            kinds=["state" for _ in found],
            unstable=[one.n_unstable for _, one in found],
            marginal=[is_marginal(one.neutral) for _, one in found],
        ) | {"tried": len(self.store())}

    def state(self, place: str) -> dict[str, Any]:
        one, at = self.record(place), self.store().scenario
        if one.frame is None or not one.label:
            raise InputError(f"{self.path}: try {place} found no new state; choose another one.")
        return described(
            at,
            one.frame,
            self.fields(at, one.frame),
            self.store(),
            self.start(place, one.label),
            place=place,
            title=one.label,
            rates=_rates_of(one),
            unstable=one.n_unstable,
            can_compute=True,
        )

    def stored_rates(self, place: str) -> Array | None:
        one = self.record(place)
        return one.growth_rates if len(one.growth_rates) else None

    def resting(self, place: str) -> tuple[Scenario, Frame]:
        one = self.record(place)
        if one.frame is None:
            raise InputError(f"{self.path}: try {place} found no new state; choose another one.")
        return self.store().scenario, one.frame
