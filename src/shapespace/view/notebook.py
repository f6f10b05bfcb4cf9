"""Results in notebooks: a page of what they say of themselves, their figure, and movies. Importing it makes it the presenter."""

from base64 import b64encode
from collections.abc import Callable
from html import escape
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from shapespace.base.errors import InputError
from shapespace.study.files import storage, write_atomically
from shapespace.study.presenting import AbstractAnimation, AbstractPresenter, Presented, Summary, Table
from shapespace.view.typeset import html_of, symbol_tex, units_tex

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BOX = "display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start"
_CELL = "text-align:left;padding:0 1em 0 0"
_DPI = 110
_HEIGHT = 160.0
"""Of an outline on the page, in pixels; the stroke is of the text's colour, so that it shows on light and dark."""
_LINES = 12
"""Rows of a table beside a picture that are shown at once."""


class Animation(AbstractAnimation):
    """A movie as bytes, with the ending that it has."""

    def __init__(self, data: bytes, ending: str) -> None:
        self.data, self.ending = data, ending

    def save(self, path: str | Path) -> Path:
        target = Path(path)
        if target.suffix != self.ending:
            raise InputError(f"{target}: this movie is a {self.ending}; end the name so.")
        with storage(target):
            write_atomically(target, self.data)
        return target

    def _repr_html_(self) -> str:
        text = b64encode(self.data).decode()
        if self.ending == ".gif":
            return f'<img alt="movie of the run" src="data:image/gif;base64,{text}">'
        return f'<video controls loop style="max-width:100%" src="data:video/mp4;base64,{text}"></video>'


class Notebook(AbstractPresenter):
    """The presenter: figures and movies are those of `shapespace.plot` and `shapespace.movie`."""

    def html(self, thing: Presented) -> str:
        said = thing.summary()
        facts = _table([("", ""), *said.facts.items()])
        picture = self._picture(thing, said)
        filled = {title: table for title, table in said.tables.items() if len(table) > 1}
        tables = "".join(
            _folded(title, table, number == 0 and (not picture or len(table) <= _LINES))
            for number, (title, table) in enumerate(filled.items())
        )
        return f"<div><b>{escape(said.title)}</b><div style='{_BOX}'>{picture}<div>{facts}{tables}</div></div></div>"

    def figure(self, thing: Presented, observable: str | None) -> "Figure":
        # Imported late: the library of pictures takes longer to load than most questions to answer.
        from shapespace.view.show import plot

        return plot(cast(Any, thing), observable=observable)

    def animation(self, thing: Presented, seconds: float) -> Animation:
        from shapespace.view.movie import save_movie

        with TemporaryDirectory() as folder:
            path = save_movie(cast(Any, thing).dataset, Path(folder) / "movie.mp4", seconds=seconds)
            return Animation(path.read_bytes(), path.suffix)

    def _picture(self, thing: Presented, said: Summary) -> str:
        if said.is_drawn:
            data = BytesIO()
            self.figure(thing, None).savefig(data, format="png", dpi=_DPI)
            source = f"data:image/png;base64,{b64encode(data.getvalue()).decode()}"
            return f'<img alt="{escape(said.title)}" style="max-width:32em" src="{source}">'
        return outline_svg(*said.meridian) if said.meridian else ""


def outline_svg(r: NDArray[np.float64], z: NDArray[np.float64]) -> str:
    """The section of a surface through its axis as a picture that scales."""
    tall, wide = float(z.max() - z.min()) or 1.0, 2.0 * float(r.max())
    scale = _HEIGHT / max(tall, wide)
    down = scale * (z.max() - z)
    across = (scale * (0.5 * wide + side * r) for side in (1.0, -1.0))
    paths = ("M" + " L".join(f"{a:.2f} {b:.2f}" for a, b in zip(one, down, strict=True)) for one in across)
    lines = "".join(f'<path d="{path}" fill="none" stroke="currentColor" stroke-width="1.5"/>' for path in paths)
    box = f"-4 -4 {scale * wide + 8:.1f} {scale * tall + 8:.1f}"
    size = f'width="{scale * wide + 8:.0f}" height="{scale * tall + 8:.0f}"'
    return f'<svg role="img" aria-label="outline" viewBox="{box}" {size}>{lines}</svg>'


def _folded(title: str, table: Table, is_open: bool) -> str:
    """A table that opens and closes on a click."""
    return f"<details{' open' if is_open else ''}><summary>{escape(title)}</summary>{_table(table)}</details>"


def _table(table: Table) -> str:
    """Columns of symbols and units are typeset, as in figures."""
    typeset = [_TYPESET.get(text, escape) for text in table[0]]
    head = "".join(f"<th style='{_CELL}'>{escape(text)}</th>" for text in table[0]) if any(table[0]) else ""
    lines = (
        "".join(f"<td style='{_CELL}'>{cell(text)}</td>" for cell, text in zip(typeset, row, strict=True))
        for row in table[1:]
    )
    return f"<table>{f'<tr>{head}</tr>' if head else ''}{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


_TYPESET: dict[str, Callable[[str], str]] = {
    "symbol": lambda text: html_of(symbol_tex(text)),
    "unit": lambda text: html_of(units_tex(text)),
}
"""How the cells below a heading are written."""

Presented.presenter = Notebook()
