"""How results show themselves in notebooks: they say what they are, and a presenter from above makes a page of it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from shapespace.base.scales import QUANTITIES, Scales

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Table = Sequence[Sequence[str]]
"""Rows of text, the first one the headings."""


@dataclass(frozen=True)
class Summary:
    """What there is to say of a result. tables: by title; meridian: (r, z) of a state; is_drawn: whether it has a figure."""

    title: str
    facts: Mapping[str, str]
    tables: Mapping[str, Table] = field(default_factory=dict)
    meridian: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    is_drawn: bool = False


class AbstractAnimation(ABC):
    """A movie that a notebook plays."""

    @abstractmethod
    def save(self, path: str | Path) -> Path:
        """Write it to a file with the movie's own ending; returns the path written."""


class AbstractPresenter(ABC):
    """Makes pages and pictures of results."""

    @abstractmethod
    def html(self, thing: "Presented") -> str:
        """A piece of HTML that says what a result is."""

    @abstractmethod
    def figure(self, thing: "Presented", observable: str | None) -> "Figure":
        """The figure of a result; observable: of branches and diagrams, what to draw."""

    @abstractmethod
    def animation(self, thing: "Presented", seconds: float) -> AbstractAnimation:
        """The movie of a run."""


class Presented(ABC):
    """What a notebook shows richly, once `shapespace` is imported."""

    presenter: ClassVar[AbstractPresenter | None] = None

    @abstractmethod
    def summary(self) -> Summary:
        """What there is to say of it."""

    def _repr_html_(self) -> str | None:
        return Presented.presenter.html(self) if Presented.presenter else None


class Plotted(Presented):
    """What has a figure."""

    def plot(self, observable: str | None = None) -> "Figure":
        """The figure, as `shapespace.plot` draws it. observable: of a branch or a diagram, what to draw."""
        return the_presenter().figure(self, observable)


def the_presenter() -> AbstractPresenter:
    """The presenter that was supplied; RuntimeError where the package's front door was not used."""
    if Presented.presenter is None:
        raise RuntimeError("there is no presenter; import shapespace first.")
    return Presented.presenter


def quantities_table(scales: Scales, values: Mapping[str, object]) -> Table:
    """Observables or parameters with symbols and units."""
    rows = [("", "symbol", "value", "unit")]
    for name, value in values.items():
        quantity = QUANTITIES.get(name)
        unit = scales.unit(name) if quantity else ""
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        rows.append((name, quantity.symbol if quantity else "", shown, "" if unit == "1" else unit))
    return rows
