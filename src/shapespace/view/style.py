"""Colours, sizes and the typesetting of symbols and units: the only place where a picture's looks are chosen."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import matplotlib as mpl
import matplotlib.style
import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.mathtext import MathTextParser

from shapespace.base.scales import QUANTITIES, Scales
from shapespace.view.typeset import symbol_tex, units_tex

WIDTH_MM = 180.0
MM = 1 / 25.4  # inches

BLUE = "#0067A5"
RED = "#BE1622"
GREEN = "#00A06A"
PURPLE = "#A3668F"
ORANGE = "#E07B00"
INK = "#222222"
FAINT = "#B8BDC4"
MEMBRANE = "#C3CAD3"
COAT = "#F5C518"
GREY = "#A9A9B0"
LINES = (BLUE, ORANGE, PURPLE, GREEN, RED, INK)
"""Of lines, in this order where nothing else tells which; told apart also by those who do not tell red from green."""
REGIMES = ("#C6D9FC", "#EED790", "#8AA18E", "#FBEDC7", "#9CB5F7", "#9C9F5D", "#CAC9CB", "#A395B9")
"""Of regions, so pale that lines show on them; told apart as the lines are."""

_RC: dict[Any, Any] = {
    "font.family": ["sans-serif"],
    "font.size": 7.5,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "mathtext.fontset": "dejavusans",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@contextmanager
def house_style(scale: float = 1.0) -> Iterator[None]:
    """Defaults of new artists inside the block, type `scale` times larger; a user's own pictures keep their looks."""
    type_sizes = {key: value * scale for key, value in _RC.items() if key.endswith("size") and isinstance(value, float)}
    with mpl.style.context(["default", _RC | type_sizes]):
        yield


class Settled(ConstrainedLayoutEngine):
    """Constrained layout that looks twice: axes of another size have other ticks, whose labels need other room."""

    def execute(self, fig: Any) -> None:
        for _ in range(2):
            super().execute(fig)


def new_figure(width: float, height_mm: float) -> Figure:
    """An empty figure that is laid out as it is drawn; width: as a part of the page's."""
    figure = Figure(figsize=(width * WIDTH_MM * MM, height_mm * MM), layout=Settled())
    FigureCanvasAgg(figure)
    return figure


@cache
def regulator_map() -> Colormap:
    """Pale sand over teal to deep blue: lightness falls evenly; no red or green, the colours of the arrows."""
    stops = ["#F7F1DE", "#D3E6CF", "#9CD2C9", "#62B4C4", "#3A90BF", "#2B68AC", "#27408B", "#1D1E5C"]
    return LinearSegmentedColormap.from_list("shapespace_regulator", stops, N=512)


@cache
def signed_map() -> Colormap:
    """Orange over white to blue, equally dark at both ends: told apart by those who do not tell red from green."""
    stops = ["#8A4B00", "#E07B00", "#F6C58A", "#F7F7F7", "#9DC3E0", "#0067A5", "#00395C"]
    return LinearSegmentedColormap.from_list("shapespace_signed", stops, N=512)


@cache
def coat_map() -> Colormap:
    """Bare membrane (grey) to fully coated (yellow)."""
    return LinearSegmentedColormap.from_list("shapespace_coat", [MEMBRANE, COAT], N=256)


@cache
def _is_math(text: str) -> bool:
    """Whether mathtext can set `text`: labels come from files, and a bad one would only fail when drawn."""
    try:
        MathTextParser("path").parse(text)
    except (ValueError, RuntimeError):
        return False
    return True


def math_symbol(symbol: str) -> str:
    """A symbol as stored (`v_u`, `C_phi^phi`, TeX, or a plain word) as mathtext, or as plain text if that fails."""
    bare = symbol.strip().strip("$")
    for text in (f"${symbol_tex(symbol)}$", f"${bare}$"):
        if bare and _is_math(text):
            return text
    return symbol.replace("$", "")


def math_units(units: str) -> str:
    """Units as stored (`R0/tau`, `1/R0`, `um/s`) as mathtext; empty for dimensionless ones."""
    tex = units_tex(units)
    text = f"${tex}$" if tex else ""
    return text if not tex or _is_math(text) else units.replace("$", "")


def symbol_of(variable: xr.DataArray) -> str:
    """The typeset symbol of a variable; its name in words where none is stored."""
    symbol = str(variable.attrs.get("symbol", ""))
    return math_symbol(symbol) if symbol else words_of(str(variable.name))


def units_of(variable: xr.DataArray) -> str:
    """The typeset units of a variable, empty when dimensionless."""
    return math_units(str(variable.attrs.get("units", "")))


def words_of(name: str) -> str:
    """The name of a quantity in words, a name of a person as that."""
    return "Péclet number" if name == "peclet" else name.replace("_", " ")


def axis_label(variable: xr.DataArray) -> str:
    """`words symbol (units)` of a variable; words: its name, or the attribute of that name."""
    units = units_of(variable)
    symbol = math_symbol(str(variable.attrs.get("symbol", "")))
    words = words_of(str(variable.attrs.get("words", variable.name)))
    return " ".join(part for part in (words, symbol, f"({units})" if units else "") if part)


def quantity_label(scales: Scales, name: str) -> str:
    """Words, symbol and unit of a key, an observable or a field in the units of a scenario, for an axis."""
    attributes = {"symbol": QUANTITIES[name].symbol, "units": scales.unit(name)}
    return axis_label(xr.DataArray(0.0, name=name, attrs=attributes))


def quantity_value(scales: Scales, name: str, value: float, form: str = "g") -> str:
    """`symbol = value unit` of such a quantity."""
    return f"{math_symbol(QUANTITIES[name].symbol)} = {value:{form}} {math_units(scales.unit(name))}".rstrip()


def time_stamps(times: Sequence[float], symbol: str, units: str) -> list[str]:
    """`t = 0.23 tau` for each time, with as many decimals as tell all of them apart; `symbol` and `units` typeset."""
    span = max(abs(t) for t in times) or 1.0
    decimals = max(0, 2 - int(np.floor(np.log10(span))))
    while decimals < 12 and len({f"{t:.{decimals}f}" for t in times}) < len(set(times)):
        decimals += 1
    return [f"{symbol} = {t:.{decimals}f} {units}".rstrip() for t in times]


def number(value: float, digits: int = 3) -> str:
    """A number with `digits` significant digits, never in computer notation."""
    text = f"{value:.{digits}g}"
    if "e" not in text:
        return text.replace("-", "\N{MINUS SIGN}")
    mantissa, exponent = text.split("e")
    return rf"${mantissa} \times 10^{{{int(exponent)}}}$"


def fixed(value: float, decimals: int = 2) -> str:
    """A number with a fixed count of decimals and a true minus, never minus zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "\N{MINUS SIGN}")
