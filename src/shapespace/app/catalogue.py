"""The stores that were given, and the questions that may be asked about them."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Event, Lock
from typing import TYPE_CHECKING, Any

from shapespace.base.errors import InputError, StoreError
from shapespace.study.manifests import holds_store, noun_of

if TYPE_CHECKING:
    from shapespace.app.source import AbstractSource

Answer = dict[str, Any]


class Catalogue:
    """Stores by number. A question is a name and a few short texts; it cannot name a file."""

    def __init__(self, paths: Sequence[Path]) -> None:
        if not paths:
            raise InputError("no store: give the directory of a run, a branch, a curve, a search or a diagram.")
        self.paths = [*paths]
        self._sources: list[AbstractSource | None] = [None for _ in paths]
        self._opening = Lock()
        self.is_shown = Event()
        """Whether a page has all that it shows first, but for the shape."""

    def source(self, number: int) -> "AbstractSource":
        """A store by number. StoreError where it is none, or of a kind that is not known."""
        with self._opening:
            known = self._sources[number]
            if known is None:
                known = self._sources[number] = _source(self.paths[number])
            return known

    def answer(self, name: str, asked: Mapping[str, str]) -> Answer:
        """The answer to a question. InputError where there is none."""
        questions: dict[str, Callable[[Mapping[str, str]], Answer]] = {
            "stores": lambda _: self.stores(),
            "overview": lambda asked: self._asked(asked).overview(),
            "state": lambda asked: self._asked(asked).state(_text(asked, "place")),
            "spectrum": lambda asked: self._asked(asked).spectrum(_text(asked, "place")),
            "mode": lambda asked: self._asked(asked).mode(_text(asked, "place"), _number(asked, "index")),
            "values": self._values,
            "shape": self._shape,
        }
        if name not in questions:
            raise InputError(f"{name[:20]!r}: is no question; ask one of {', '.join(questions)}.")
        answer = questions[name](asked)
        if name == "state":
            self.is_shown.set()
        return answer

    def stores(self) -> Answer:
        """All stores by name; of one that cannot be read, why."""
        return {"stores": [self._summary(number) for number in range(len(self.paths))]}

    def _summary(self, number: int) -> Answer:
        path = self.paths[number]
        about = {"name": path.resolve().name, "path": str(path.resolve())}
        try:
            source = self.source(number)
            return {**about, "noun": source.called, "scenario": source.store().scenario.name}
        except InputError as error:
            return {**about, "error": str(error)}

    def _asked(self, asked: Mapping[str, str]) -> "AbstractSource":
        number = _number(asked, "store")
        if not number < len(self.paths):
            raise InputError(f"store {number}: there are {len(self.paths)}.")
        return self.source(number)

    def _values(self, asked: Mapping[str, str]) -> Answer:
        return self._diagram(asked).values(_text(asked, "name"))

    def _shape(self, asked: Mapping[str, str]) -> Answer:
        return self._diagram(asked).shape(_text(asked, "place"))

    def _diagram(self, asked: Mapping[str, str]) -> Any:
        source = self._asked(asked)
        if source.noun != "diagram":
            raise InputError(f"store {asked['store']}: is a {source.noun}, no diagram.")
        return source


def _source(path: Path) -> "AbstractSource":
    noun = noun_of(path)
    if noun is None:
        raise StoreError(
            f"{path / 'store.json'}: is {'damaged or foreign' if holds_store(path) else 'missing'}; give the directory of a run, "
            "a branch, a curve, a search or a diagram."
        )
    if noun == "diagram":
        # Imported late, as the library of arrays on disk loads slowly.
        from shapespace.app.maps import DiagramSource

        return DiagramSource(path)
    from shapespace.app.records import BranchSource, CurveSource, RunSource, SearchSource

    kinds = {kind.noun: kind for kind in (RunSource, BranchSource, CurveSource, SearchSource)}
    if noun not in kinds:
        raise StoreError(
            f"{path}: holds a {noun}, which the explorer does not know; give one of {', '.join(kinds)}, diagram."
        )
    return kinds[noun](path)


def _text(asked: Mapping[str, str], name: str) -> str:
    if name not in asked:
        raise InputError(f"{name}: is missing from the question.")
    return asked[name]


def _number(asked: Mapping[str, str], name: str) -> int:
    text = _text(asked, name)
    if not (text.isdecimal()):
        raise InputError(f"{name} = {text[:20]!r}: must be a whole number.")
    return int(text)
