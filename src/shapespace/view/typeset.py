"""Symbols and units as they are stored, ASCII such as `kappa/R0^2`, as TeX and as HTML: no picture is made here."""

import re
from html import escape

from shapespace.base.units import with_micro

_GREEK = (
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|phi|chi|psi|omega|"
    "Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Phi|Psi|Omega"
)
_LETTERS = dict(zip(_GREEK.split("|"), "αβγδεζηθκλμνξπρστφχψωΓΔΘΛΞΠΣΦΨΩ", strict=True))
_GREEK_WORD = re.compile(rf"(?<![A-Za-z\\])({_GREEK})(?![A-Za-z])")
_NUMBERED = re.compile(rf"(?<![A-Za-z0-9_^{{\\])({_GREEK}|[A-Za-z])(\d+)(?!\d)")
_WORD = re.compile(r"(?<![A-Za-z\\_^{])(?!d[A-Za-z](?![A-Za-z]))([A-Za-z]{2,})")
"""Two letters or more on the line, as in `max c`; `dF` is none."""
_UNIT_TOKEN = re.compile(r"(?P<name>[^\W\d_]+)(?P<index>_\w+|\d+)?(?:(?:\*\*|\^)?(?P<power>[-+]?\d+))?|(?P<other>\S)")
_TEX_TOKEN = re.compile(
    r"\\mathrm\{(?P<word>[^{}]*)\}|\\(?P<command>[A-Za-z]+) ?|(?P<blank>\\,)"
    r"|(?P<script>[_^])(?P<inside>\{[^{}]*\}|\\[A-Za-z]+|[^{}\\])|(?P<letters>[A-Za-z]+)|(?P<other>[^{}\\])"
)


def symbol_tex(symbol: str) -> str:
    """A symbol (`v_u`, `C_phi^phi`, `max c`) as TeX without dollars."""
    bare = symbol.strip().strip("$")
    numbered = _NUMBERED.sub(r"\1_{\2}", bare)
    words = _WORD.sub(lambda match: match[0] if match[0] in _LETTERS else rf"\mathrm{{{match[0]}}}", numbered)
    braced = re.sub(r"([_^])([A-Za-z0-9]{2,})", r"\1{\2}", words)
    # TeX drops blanks, which between Greek letters should not be seen.
    return _greek(re.sub(r"(?<=[\d}]) (?=\S)", r"\\,", braced))


def units_tex(units: str) -> str:
    """Units (`R0/tau`, `1/R0`, `um/s`) as TeX without dollars; empty for dimensionless ones."""
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

    # TeX drops blanks.
    return _UNIT_TOKEN.sub(token, re.sub(r"(?<=\w) (?=\w)", "*", with_micro(units)))


def html_of(tex: str) -> str:
    """Such TeX as HTML; what is not understood as it stands."""
    parts, place = [], 0
    while place < len(tex):
        match = _TEX_TOKEN.match(tex, place)
        if match is None or (match["command"] and match["command"] not in _LETTERS):
            return escape(tex)
        place = match.end()
        if match["script"]:
            tag = "sub" if match["script"] == "_" else "sup"
            parts.append(f"<{tag}>{html_of(match['inside'].strip('{}'))}</{tag}>")
        elif match["blank"]:
            parts.append("\N{THIN SPACE}")
        elif italic := _LETTERS.get(match["command"] or "") or match["letters"]:
            parts.append(f"<i>{italic}</i>")
        else:
            parts.append(escape(match["word"] or match["other"]))
    return "".join(parts)


def _greek(text: str) -> str:
    return _GREEK_WORD.sub(r"\\\1", text)
