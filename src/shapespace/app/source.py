"""What the explorer shows of one store: an overview of all its states, one state at a time, and modes of a state."""

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from shapespace.app.commands import continuations, python_of
from shapespace.app.encoding import drawn, finite, number
from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES, Quantity
from shapespace.base.units import with_micro
from shapespace.study.frame import Array, Frame
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import Scenario

if TYPE_CHECKING:
    from shapespace.study.modes import Modes

KEPT = 32
"""States whose computed modes are kept."""
POINTS = 241
"""Of a mode's profiles, as many as of a state's."""
AT_REST = 1e-5
"""Flows below this, in units of length over time of the scenario's scales, are what is left where a run counts as stationary."""
ROUND_OFF = 1e-8
"""Changes of other numbers below this, in units of the scales, are round-off, and drawn as none."""
_DRAWN_AS_THEY_ARE = ("time", "discretisation_error", "boundary_residual")
"""Numbers that are small by nature, as are keys."""


class AbstractSource(ABC):
    """One store, read anew whenever it has changed. Everything returned is for JSON; places of states are text."""

    noun: ClassVar[str]
    kind: ClassVar[type[AbstractRecordStore[Any]]]

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stamp: tuple[int, ...] = ()
        self._open: AbstractRecordStore[Any] | None = None
        self._computed: OrderedDict[str, Modes] = OrderedDict()
        self.computing = RLock()
        """Held by what computes: the page asks several things at once, and each would compile the same."""

    def store(self) -> AbstractRecordStore[Any]:
        """The store, to read, as it is now, whatever records of it are damaged. StoreError where none can be read."""
        stamp = tuple(
            file.stat().st_mtime_ns if file.exists() else 0
            for file in (self.path / "store.json", self.path / self.kind.folder)
        )
        if self._open is None or stamp != self._stamp:
            self._open = self.kind.open_damaged(self.path)
            self._stamp = stamp
            self.forget()
        return self._open

    def forget(self) -> None:
        """What was read of the store before it changed."""
        self._computed.clear()

    @property
    def called(self) -> str:
        """What the store holds, in a word or two."""
        return self.noun

    @property
    def over(self) -> str:
        """Over which keys, in words; empty where none changes."""
        return ""

    @abstractmethod
    def damage(self) -> list[str]:
        """What cannot be read of the store, each with its file, after everything that the overview needs was read."""

    @abstractmethod
    def content(self) -> dict[str, Any]:
        """What is special to this kind of store in the overview: a `table` of states, or a `map`."""

    @abstractmethod
    def places(self) -> Iterator[str]:
        """Places that may be looked at; of very many, those that a file has."""

    @abstractmethod
    def state(self, place: str) -> dict[str, Any]:
        """Everything about one state. InputError where there is none."""

    @abstractmethod
    def modes(self, place: str) -> "Modes | None":
        """Stored modes of a state; None where none are."""

    @abstractmethod
    def resting(self, place: str) -> tuple[Scenario, Frame]:
        """A solution whose modes may be computed. InputError where the state does not rest, or rests under a control."""

    def warm(self) -> None:
        """Load what showing a state needs. InputError, StopIteration where there is none."""
        self.state(next(self.places()))

    def questions(self) -> Iterator[tuple[str, dict[str, str]]]:
        """Questions that a file of this store must answer, beside the overview: of every state, and its stored modes."""
        for place in self.places():
            yield "state", {"place": place}
            modes = self.modes(place)
            for index in range(len(modes.modes)) if modes is not None else ():
                yield "mode", {"place": place, "index": str(index)}

    def overview(self) -> dict[str, Any]:
        """What the store holds and how it came about."""
        store, content = self.store(), self.content()
        at = store.scenario
        return {
            "noun": self.noun,
            "words": f"{at.name}: {self.called}{self.over}, {store.outcome or 'unfinished'}",
            "name": self.path.resolve().name,
            "path": str(self.path.resolve()),
            "scenario": at.name,
            "model": at.model,
            "kind": at.kind,
            "parameters": {key: value for key, value in at.values().items() if isinstance(value, float)},
            "created": store.created,
            "version": store.versions.get("shapespace", ""),
            "outcome": store.outcome,
            "advice": store.outcome.advice if store.outcome else f"The {self.noun} is not finished.",
            "quantities": quantities(at),
            "at_rest": AT_REST * at.scales.factor("velocity"),
            "damage": self.damage(),
            **content,
        }

    def spectrum(self, place: str) -> dict[str, Any]:
        """Leading growth rates of a state, computed where they are not stored; that may take seconds."""
        modes = self._modes(place)
        growing = [i for i, rate in enumerate(modes.growth_rates[:, 0]) if rate > 0.0 and i not in modes.neutral]
        # Where all that are known grow there may be more.
        unstable = len(growing) if len(growing) < len(modes.growth_rates) else None
        return rates_of(modes.growth_rates, modes.errors, modes.parities, modes.neutral) | {"unstable": unstable}

    def mode(self, place: str, index: int) -> dict[str, Any]:
        """The mode of a growth rate, by the number that it has in the state's own list."""
        modes, stored = self._modes(place), self.stored_rates(place)
        if not 0 <= index < len(modes.growth_rates if stored is None else stored):
            raise InputError(f"mode {index}: there is none; choose a growth rate of this state.")
        nearest = index
        if stored is not None:
            # Modes that were computed again may come in another order.
            nearest = int(np.argmin(np.linalg.norm(modes.growth_rates - stored[index], axis=1)))
        return mode_of(modes, nearest) | {"index": index}

    def stored_rates(self, place: str) -> Array | None:
        """Growth rates (m, 2) that are stored with a state, None where none are."""
        return None

    def _modes(self, place: str) -> "Modes":
        stored = self.modes(place)
        if stored is not None:
            return stored
        with self.computing:
            return self._computed_modes(place)

    def _computed_modes(self, place: str) -> "Modes":
        if place not in self._computed:
            # Imported late: solvers take seconds to load, and most states are only looked at.
            from shapespace.study.steady import modes_at

            self._computed[place] = modes_at(*self.resting(place))
            if len(self._computed) > KEPT:
                self._computed.popitem(last=False)
        return self._computed[place]


def quantities(at: Scenario) -> dict[str, list[str | float]]:
    """Symbol, meaning, unit, and the least change that is drawn as one, of every quantity by its name."""
    as_they_are = {*at.values(), *_DRAWN_AS_THEY_ARE}

    def least(name: str, quantity: Quantity) -> float:
        small = AT_REST if quantity.dimension == QUANTITIES["velocity"].dimension else ROUND_OFF
        return 0.0 if name in as_they_are else small * at.scales.factor(name)

    return {
        name: [quantity.symbol, quantity.meaning, with_micro(at.scales.unit(name)), least(name, quantity)]
        for name, quantity in QUANTITIES.items()
    }


def described(
    at: Scenario,
    frame: Frame,
    fields: Mapping[str, Array],
    store: AbstractRecordStore[Any],
    start: str,
    *,
    vary: str | None = None,
    **more: Any,
) -> dict[str, Any]:
    """A state for the page. fields: profiles along u (m,) by name; start: where in its store the command line finds it."""
    proposals = {name: more.pop(name) for name in ("stop", "kind", "changes") if name in more}
    return {
        "observables": finite(frame.observables),
        "velocity": number(frame.observables.get("velocity", 0.0)),
        "fields": {name: drawn(values) for name, values in fields.items() if np.isfinite(values).all()},
        "start": start,
        "python": python_of(start, proposals.get("changes", {})),
        "commands": continuations(at, start, store, vary, **proposals),
        **more,
    }


def rates_of(rates: Array, errors: Array, parities: Sequence[str | None], neutral: Mapping[int, str]) -> dict[str, Any]:
    """Growth rates (m, 2) with what is known of them."""
    # Imported late, as all that needs the library of derivatives: an overview is there sooner.
    from shapespace.study.modes import CRITICAL

    return {
        "values": rates.reshape(-1, 2).tolist(),
        "errors": [number(error) for error in errors.tolist()],
        "parities": list(parities),
        "neutral": {str(i): name or CRITICAL for i, name in neutral.items()},
        "marginal": is_marginal(neutral),
    }


def is_marginal(neutral: Mapping[int, str]) -> bool:
    """Whether stability changes at a state: a rate vanishes within its error, and no symmetry or conservation law is why."""
    return "" in neutral.values()


def mode_of(modes: "Modes", index: int) -> dict[str, Any]:
    """A mode's profiles, in units of the length and the concentration that its size 1 stands for."""
    found = modes.profiles(index, POINTS)
    unit = modes.scenario.scales.factor("length")
    parts: dict[str, Array] = {"u": found.u}
    for name, values in (("displacement", unit * found.displacement), ("tangential", found.tangential)):
        parts |= {f"{name}_real": values.real, f"{name}_imaginary": values.imag}
    if found.regulator is not None:
        regulator = found.regulator * modes.scenario.scales.factor("concentration")
        parts |= {"regulator_real": regulator.real, "regulator_imaginary": regulator.imag}
    return {
        "index": index,
        "rate": list(modes.growth_rates[index]),
        **{name: drawn(one) for name, one in parts.items()},
    }
