"""A verification as one self-contained HTML page: no script, nothing loaded from elsewhere."""

import math
from html import escape

from shapespace.study.verification.record import Result, Row, Verification

_STYLE = """
:root { color-scheme: light dark; --ink: #222; --faint: #6b7280; --line: #d6d9de; --ground: #fff;
  --good: #00713f; --bad: #c4152a; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8e8e8; --faint: #9aa3af; --line: #3b4048; --ground: #17191d; --good: #4ccf8d; --bad: #ff6b78; }
}
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--ground);
  margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: 0; }
.faint { color: var(--faint); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; padding: .25rem .75rem .25rem 0; vertical-align: top; border-bottom: 1px solid var(--line); }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.group th { padding-top: 1.2rem; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; }
"""

_HEADINGS = ("", "what", "value", "reference", "error", "tolerance", "source")
_NUMBERS = ("value", "reference", "error", "tolerance")


def verification_html(verification: Verification) -> str:
    """The page."""
    versions = ", ".join(f"{name} {version}" for name, version in verification.versions.items())
    kind = "quick benchmarks" if verification.is_quick else "all benchmarks"
    about = f"{versions}; {verification.machine}. Errors are relative, and absolute where the reference is zero."
    head = "".join(f'<th class="n">{name}</th>' if name in _NUMBERS else f"<th>{name}</th>" for name in _HEADINGS)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>shapespace verify</title><style>{_STYLE}</style></head><body>
<h1>What shapespace computes, beside what is known</h1>
<p class="{"good" if verification.passed else "bad"}">{escape(verification.verdict)} ({kind}).</p>
<p class="faint">{escape(about)}</p>
<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>
{"".join(_group(result) for result in verification.results)}</tbody></table></div></body></html>
"""


def shown(number: float) -> str:
    """A number to ten digits, a dash where there is none."""
    return f"{number:.10g}" if math.isfinite(number) else "-"


def small(number: float) -> str:
    """An error or a tolerance to one digit."""
    return "0" if number == 0.0 else f"{number:.0e}" if math.isfinite(number) else "-"


def _group(result: Result) -> str:
    time = f'<span class="faint">{result.seconds:.1f} s</span>'
    return f'<tr class="group"><th colspan="7">{escape(result.title)} {time}</th></tr>\n' + "".join(
        _line(row) for row in result.rows
    )


def _line(row: Row) -> str:
    mark = '<td class="good">✓</td>' if row.passed else '<td class="bad">✗ failed</td>'
    numbers = "".join(
        f'<td class="n">{text}</td>'
        for text in (shown(row.value), shown(row.reference), small(row.error), small(row.tolerance))
    )
    source = escape(row.note or row.source)
    return f'<tr>{mark}<td>{escape(row.name)}</td>{numbers}<td class="faint">{source}</td></tr>\n'
