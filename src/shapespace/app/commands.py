"""What to type to go on from a stored state: commands of the shell, and Python."""

import os
import shlex
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from shapespace.study.keys import MAIN_KEYS, MODELS
from shapespace.study.plugins import VARIABLE
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import Scenario, scenario, scenario_names

_CROSSINGS = ("pitchfork", "transcritical", "branch-point")
FURTHER = 1.25
"""How far a proposed branch goes, relative to the value that it starts at."""


def continuations(
    at: Scenario,
    start: str,
    store: AbstractRecordStore[Any],
    vary: str | None = None,
    stop: float | None = None,
    kind: str = "",
    changes: Mapping[str, float] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """Commands that go on from a stored state of a scenario, each with its words; `{vary}` and `{stop}` stand for choices.

    start: the state as STORE:LABEL. vary, stop: of the branch it lies on. kind: of a special point. changes: values of keys
    here, where the stored state is one nearby.
    """
    base, theirs = _base(at, store)
    # A point of a branch brings its value of the key; a run brings none.
    brought = [vary] if vary is not None else []
    vary = vary if vary in numeric_keys(at) else MAIN_KEYS[at.kind]
    stated = {**differences(at, theirs, changes or brought), **changes}
    words = [base, *(word for key, value in stated.items() for word in ("-s", f"{key}={_text(value)}"))]
    known, begins = shlex.join(words), f"--from {shlex.quote(start)}"
    program = " ".join(["shapespace", *(f"--import {shlex.quote(file)}" for file in _imports())])
    here = float(at.values()[vary])
    if stop is None or stop == here:
        stop = FURTHER * here or 1.0
    choices = {"vary": vary, "stop": stop, "keys": numeric_keys(at)}
    side = " --side 1" if kind in _CROSSINGS else ""
    found: list[dict[str, Any]] = [
        {"name": "steady", "text": f"{program} steady {known} {begins} --out results/here"},
        {"name": "run", "text": f"{program} run {known} {begins} --out results/onwards"},
        {
            "name": "branch",
            "text": f"{program} branch {known} --vary {{vary}} --stop {{stop}} {begins}{side} --out results/branch-onwards",
            **choices,
        },
    ]
    if kind in ("fold", *_CROSSINGS):
        others = [key for key in numeric_keys(at) if key != vary]
        second = "peclet" if "peclet" in others else others[0]
        limit = FURTHER * float(at.values()[second]) or 1.0
        text = f"{program} curve {shlex.quote(start)} --vary {{vary}} --stop {{stop}} --out results/curve-onwards"
        found.append({"name": "curve", "text": text, "vary": second, "stop": limit, "keys": others})
    return found


def python_of(start: str, changes: Mapping[str, float] = MappingProxyType({})) -> str:
    """Python that reads a stored state and computes on from it. changes: as above."""
    lines = ["import shapespace as ss", ""]
    if files := _imports():
        lines[1:1] = [
            "from shapespace.study.plugins import import_file",
            "",
            *(f"import_file({file!r})" for file in files),
        ]
    lines.append(f"start = ss.find_start({start!r})")
    lines.append("scenario = start.scenario" + (f".with_overrides({dict(changes)!r})" if changes else ""))
    lines += [
        "",
        "state = ss.steady(scenario, start=start)  # the state at rest there",
        "print(state.outcome, state.observables)",
        "print(state.rates().values)  # growth rates of small perturbations",
        "",
        "# ss.run(scenario, start=start, out='results/onwards') lets it move from there.",
    ]
    return "\n".join(lines) + "\n"


def differences(at: Scenario, base: Scenario, placed: Iterable[str] = ()) -> dict[str, Any]:
    """Keys to change in another scenario to have this one, but for those that are stated anyway."""
    model, mine, theirs = MODELS[at.model], dict(at.given), dict(base.given)
    # Keys that the other one states and this one leaves to their defaults.
    mine |= {key: at.values()[key] for key in theirs if key not in mine and model.rival_of(key) not in mine}
    brought = {*placed, *(model.rival_of(key) for key in placed)}
    return {key: value for key, value in mine.items() if key not in brought and theirs.get(key) != value}


def numeric_keys(at: Scenario) -> list[str]:
    """Keys of the scenario's parameters that are real numbers, twins included."""
    values = at.sections()["parameters"] | at.twins()
    return [key for key, value in values.items() if type(value) is float]


def _base(at: Scenario, store: AbstractRecordStore[Any]) -> tuple[str, Scenario]:
    """What the commands begin with: the built-in scenario of this name; of one with units or from elsewhere the store."""
    if at.units is None and at.name in scenario_names() and scenario(at.name).model == at.model:
        return at.name, scenario(at.name)
    return str(store.path.resolve()), store.scenario


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _imports() -> list[str]:
    return [file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file]
