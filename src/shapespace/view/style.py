"""Colours, sizes and the typesetting of symbols and units: the only place where a picture's looks are chosen."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import matplotlib as mpl
import matplotlib.style
import numpy as np
import xarray as xr
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.mathtext import MathTextParser

from shapespace.base.units import with_micro

WIDTH_MM = 180.0
MM = 1 / 25.4  # inches

BLUE = "#0067A5"
RED = "#D81E2C"
GREEN = "#00894F"
PURPLE = "#6A3D9A"
ORANGE = "#E07B00"
INK = "#222222"
FAINT = "#B8BDC4"
MEMBRANE = "#C3CAD3"
COAT = "#F5C518"
GREY = "#A9A9B0"
REGIMES = ("#BFD9EC", "#F6D5A6", GREY, "#CDE5C4", "#DCCBE8", "#F2C4C0", "#F3EBAE", "#93C7C2")
"""Of regions, so pale that lines show on them, and of different lightness."""

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

_GREEK = (
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|phi|chi|psi|omega|"
    "Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Phi|Psi|Omega"
)
_GREEK_WORD = re.compile(rf"(?<![A-Za-z\\])({_GREEK})(?![A-Za-z])")
_UNIT_TOKEN = re.compile(r"(?P<name>[^\W\d_]+)(?P<index>_\w+|\d+)?(?:(?:\*\*|\^)?(?P<power>[-+]?\d+))?|(?P<other>\S)")


@contextmanager
def house_style(scale: float = 1.0) -> Iterator[None]:
    """Defaults of new artists inside the block, type `scale` times larger; a user's own pictures keep their looks."""
    type_sizes = {key: value * scale for key, value in _RC.items() if key.endswith("size") and isinstance(value, float)}
    with mpl.style.context(["default", _RC | type_sizes]):
        yield


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


def _greek(text: str) -> str:
    return _GREEK_WORD.sub(r"\\\1", text)


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
    indexed = re.sub(r"(?<![A-Za-z0-9_^{\\])([A-Za-z])(\d+)", r"\1_{\2}", bare)
    braced = re.sub(r"([_^])([A-Za-z0-9]{2,})", r"\1{\2}", indexed)
    for text in (f"${_greek(braced)}$", f"${bare}$"):
        if bare and _is_math(text):
            return text
    return symbol.replace("$", "")


def math_units(units: str) -> str:
    """Units as stored (`R0/tau`, `1/R0`, `um/s`) as mathtext; empty for dimensionless ones."""
    if units.strip() in ("", "1", "dimensionless"):
        return ""

    def token(match: re.Match[str]) -> str:
        if match["other"]:
            return {"*": r"\,"}.get(match["other"], match["other"])
        name, index = match["name"], (match["index"] or "").lstrip("_")
        if name == "Rb":
            name, index = "R", "b"
        is_greek = _GREEK_WORD.fullmatch(name) is not None
        text = f"\\{name}" if is_greek else name if index else rf"\mathrm{{{name}}}"
        return text + (f"_{{{_greek(index)}}}" if index else "") + (f"^{{{match['power']}}}" if match["power"] else "")

    # Mathtext drops blanks.
    apart = re.sub(r"(?<=\w) (?=\w)", "*", with_micro(units))
    text = "$" + _UNIT_TOKEN.sub(token, apart) + "$"
    return text if _is_math(text) else units.replace("$", "")


def symbol_of(variable: xr.DataArray) -> str:
    """The typeset symbol of a variable; its name in words where none is stored."""
    symbol = str(variable.attrs.get("symbol", ""))
    return math_symbol(symbol) if symbol else str(variable.name).replace("_", " ")


def units_of(variable: xr.DataArray) -> str:
    """The typeset units of a variable, empty when dimensionless."""
    return math_units(str(variable.attrs.get("units", "")))


def axis_label(*variables: xr.DataArray, words: str = "") -> str:
    """`words symbols (units)` of variables that share one axis."""
    symbols = ", ".join(symbol_of(v) for v in variables if v.attrs.get("symbol") or not words)
    units = units_of(variables[0])
    return " ".join(part for part in (words, symbols, f"({units})" if units else "") if part)


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
