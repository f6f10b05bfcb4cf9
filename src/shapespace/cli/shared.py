"""What the commands share: the application, exit statuses, options, and how scenarios and settings are read."""

import math
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter, Token

from shapespace.base.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from shapespace.base.outcome import Outcome
    from shapespace.study.scenario import Scenario

BAD_INPUT, GAVE_UP, INTERRUPTED = 2, 3, 130
MOST_MISSED = 3
"""Lines about one kind of trouble."""


def examples(*lines: str) -> str:
    """The end of a command's help."""
    return "\n  ".join(["Examples:", *lines])


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("shapespace")
    except PackageNotFoundError:
        return "0 (not installed)"


app = App(
    name="shapespace",
    help="Dynamics and stationary shapes of axisymmetric active fluid surfaces. "
    "With every command: --import FILE.py, which defines models of your own.",
    help_epilogue=examples(
        "shapespace run guided-division",
        "shapespace plot results/guided-division",
        "shapespace config ring-slipping --out my.toml",
        "shapespace run my.toml -s peclet=300",
    ),
    help_format="plaintext",
    version=_version,
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative=(), show_default=False),
)

Store = Annotated[Path, Parameter(name="DIR", help="Directory of a run or a branch, as `shapespace` made it.")]
StoreOrLabel = Annotated[
    str,
    Parameter(name="DIR[:LABEL]", help="Directory of any store, or one state of it by its label or number."),
]
NameOrFile = Annotated[
    str, Parameter(name="NAME_OR_FILE", help="A built-in scenario, a TOML file, or a store for its scenario.")
]
Settings = Annotated[
    tuple[str, ...],
    Parameter(name=["--set", "-s"], metavar="KEY=VALUE", help="Change a key of the scenario; may be repeated."),
]
AsJson = Annotated[bool, Parameter(name="--json", help="End with one line of JSON on stdout.")]
StartFrom = Annotated[
    str | None,
    Parameter(
        name="--from",
        metavar="STORE[:LABEL]",
        help="Start from the last state of a stored run, a labelled one of a branch, a curve or a search, or that at a point "
        "STATE,I,J of a diagram.",
    ),
]


def tell(text: str) -> None:
    """A line on stderr."""
    print(f"shapespace: {text}", file=sys.stderr, flush=True)


def read_settings(settings: Sequence[str], option: str = "-s", example: str = "peclet=300") -> dict[str, str]:
    """The key=value texts of an option; InputError where one is none, or a key is given twice."""
    changes: dict[str, str] = {}
    for text in settings:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise InputError(
                f"{option} {text}: must be KEY=VALUE without blanks, e.g. {option} {shlex.quote(example)}."
            )
        if key in changes:
            raise InputError(f"{key} = {value}: is given twice, also as {changes[key]}; give it once.")
        changes[key] = value
    return changes


def read_values(text: str | None) -> list[float]:
    """The numbers of --at."""
    try:
        return [float(part) for part in text.split(",")] if text else []
    except ValueError:
        raise InputError(f"--at {text}: must be numbers with commas between them, e.g. --at 1.5,2.") from None


def whole(_: object, tokens: Sequence[Token]) -> int:
    """Converter of an option that is a whole number: others are refused, not rounded."""
    text = tokens[0].value
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{text} must be a whole number; give one.") from None


def again(path: Path, without: str | None = None) -> str:
    """The command that goes on with what was interrupted: the same one, with where and how.

    without: an option whose value is good no more.
    """
    words = [word for word in sys.argv[1:] if word != "--resume"]
    if without is not None:
        places = [i for i, word in enumerate(words) if word == without]
        words = [
            word
            for i, word in enumerate(words)
            if not (i in places or i - 1 in places or word.startswith(f"{without}="))
        ]
    return shlex.join(["shapespace", *words, *([] if "--out" in words else ["--out", str(path)]), "--resume"])


def find_scenario(name_or_file: str) -> "Scenario":
    """The built-in scenario of this name, or that of a file or of a store."""
    from shapespace.study.manifests import holds_store
    from shapespace.study.scenario import load_scenario, scenario, scenario_names

    # Names first: runs are stored in folders named as their scenarios.
    is_file = name_or_file.endswith(".toml") or os.sep in name_or_file or Path(name_or_file).exists()
    if name_or_file in scenario_names() or not is_file:
        return scenario(name_or_file)
    if name_or_file.endswith(".toml") or not holds_store(name_or_file):
        return load_scenario(name_or_file)
    from shapespace.study.starts import stored_scenario

    return stored_scenario(name_or_file)


def chosen_scenario(name_or_file: str, changes: Mapping[str, str], start: str | None) -> "Scenario":
    """The scenario with the changes of -s; at a branch point given by --from with its value of the key that is varied."""
    chosen = find_scenario(name_or_file).with_overrides(changes)
    if start is None:
        return chosen
    from shapespace.study.starts import find_start

    return find_start(start).placing(chosen, changes)


def stored(store: Path | None) -> str:
    """Where results are, for the end of a summary."""
    return f"stored in {store}" if store else "nothing stored"


def kept(store: Path | None) -> str:
    """Where results are that ended early."""
    return f"What there is is in {store}." if store else "Nothing was stored."


def tell_missed(lines: Sequence[str]) -> None:
    """Say what was not located: the first few, and how many more there are."""
    for line in lines[:MOST_MISSED]:
        tell(line)
    if len(lines) > MOST_MISSED:
        tell(f"and {len(lines) - MOST_MISSED} more; all are in the JSON and in the store.")


def described(outcome: "Outcome", scenario: "Scenario", observables: Mapping[str, float]) -> dict[str, object]:
    """What --json prints of any computation: numbers as numbers, and only those that there are."""
    return {
        "outcome": outcome.value,
        "advice": outcome.advice,
        "scenario": scenario.name,
        "parameters": scenario.values(),
        "observables": finite(observables),
    }


def finite(values: Mapping[str, float]) -> dict[str, float]:
    """The values that are numbers."""
    return {name: value for name, value in values.items() if math.isfinite(value)}


def print_lines(*lines: "Table | str") -> None:
    """Text and tables on stdout."""
    from rich.console import Console

    for line in lines:
        # A table wider than the terminal is wrapped by it, which loses nothing; Rich would cut off words.
        wide = Console(highlight=False, soft_wrap=True, markup=False, width=10_000)
        needed = wide.measure(line).maximum
        Console(highlight=False, soft_wrap=True, markup=False, width=max(needed, 1)).print(line)


def print_observables(scenario: "Scenario", observables: Mapping[str, float]) -> None:
    """A table with symbols and units on stdout."""
    from rich.table import Table

    from shapespace.base.scales import QUANTITIES

    table = Table("observable", "symbol", "value", "unit", box=None, header_style="bold")
    for name, value in observables.items():
        symbol = QUANTITIES[name].symbol if name in QUANTITIES else ""
        unit = scenario.scales.unit(name) if name in QUANTITIES else ""
        table.add_row(name, symbol, f"{value:.8g}", "" if unit == "1" else unit)
    print_lines(table)
