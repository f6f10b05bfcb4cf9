"""Scenarios: everything that defines one run, as typed and immutable records, and the ways to get one.

scenario("guided-division", peclet=300)     a built-in one, with changes
load_scenario("mine.toml")                  one from a file, as `template(name)` shows
s.with_overrides({"elements": "80"})        a changed copy; text is read as on the command line
"""

import difflib
import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Self

from shapespace.base.errors import InputError
from shapespace.base.scales import Scales
from shapespace.base.units import Units
from shapespace.study.keys import (
    MODELS,
    Value,
    check_key,
    convert_keys,
    has_unit,
    in_numbers,
    is_word,
    make_parameters,
    nearest,
    replace_keys,
    twin_values,
)
from shapespace.study.parameters import (
    ClosedSurfaceInitial,
    ClosedSurfaceParameters,
    Numerics,
    OpenMembraneInitial,
    OpenMembraneParameters,
    Record,
    RunSettings,
    VesicleInitial,
    VesicleParameters,
    complaint,
    shown,
)
from shapespace.study.plugins import load_installed
from shapespace.study.presenting import Presented, Summary, quantities_table

# What a resumed run may change: how far it goes, not what it computes.
FREE_ON_RESUME = ("until", "max_steps")

_NAMES = ("guided-division", "ring-slipping", "polar-swimmer", "membrane-protrusion", "vesicle")
TEMPLATES: dict[str, str] = {}
"""The TOML texts of scenarios that users defined, by name."""
LATER = ("parameterization",)
"""Keys that files may leave out, as they came after the first files were written."""
_SECTIONS = ("parameters", "initial", "run", "numerics")


class Scenario(Record, Presented):
    """One run, fully stated. Make it with `scenario`, `load_scenario` or `Scenario.from_keys`.

    `given` holds the keys as they were written, twins included: a scenario that states `peclet` keeps its Peclet number
    when `with_overrides` changes the diffusivity. `parameters` is resolved: every physical key has its value there.
    `units`: what all numbers are in; without them in any one consistent set.
    """

    name: str
    model: str
    parameters: ClosedSurfaceParameters | OpenMembraneParameters | VesicleParameters
    initial: ClosedSurfaceInitial | OpenMembraneInitial | VesicleInitial
    run: RunSettings
    numerics: Numerics
    given: tuple[tuple[str, Value], ...]
    units: Units | None = None

    @classmethod
    def from_keys(cls, name: Any, model: Any, keys: Mapping[str, object], units: Units | None = None) -> Self:
        """A scenario from keys in any order (run and numerics have defaults). InputError names the first bad key."""
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}", name):
            raise InputError(f"name = {name!r}: must be of letters, digits, '.', '_' and '-', as it names a directory.")
        _check_model(model)
        given = replace_keys({}, in_numbers(keys, model, units), model)
        sections = MODELS[model].sections
        by_section: dict[str, dict[str, Value]] = {section: {} for section in sections}
        for key, section in MODELS[model].section_of.items():
            if key in given:
                by_section[section][key] = given[key]
        records: dict[str, Any] = {section: sections[section](**by_section[section]) for section in _SECTIONS[1:]}
        records["parameters"] = make_parameters(by_section["parameters"], model)
        # In the order of the records, so that equal scenarios compare equal however they came about.
        ordered = tuple((key, given[key]) for key in MODELS[model].section_of if key in given)
        made = cls(name=name, model=model, given=ordered, units=units, **records)
        made.dimensionless()
        made.twins()
        return made

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """The scenario that `as_dict` described, bit for bit."""
        units = Units(**stored["units"]) if "units" in stored else None
        return cls.from_keys(stored["name"], stored["model"], stored["given"], units)

    def with_overrides(self, overrides: Mapping[str, object]) -> Self:
        """A copy with some keys changed; a value may be text, read as the key's type, with a unit where there are units."""
        if not overrides:
            return self
        changes = in_numbers(overrides, self.model, self.units)
        return type(self).from_keys(
            self.name, self.model, replace_keys(dict(self.given), changes, self.model), self.units
        )

    def in_units(self, **units: str) -> Self:
        """The same experiment in other units, e.g. `in_units(length="nm", energy="pN nm", time="s")`.

        Of a scenario without units a number says how large its present unit is: `in_units(length="10 um", ...)`.
        """
        return type(self).from_keys(self.name, self.model, *convert_keys(dict(self.given), self.units, units))

    def summary(self) -> Summary:
        """Model and keys with values, by section."""
        sections = self.sections()
        sections["parameters"] |= self.twins()
        return Summary(
            f"Scenario {self.name}",
            {"model": self.model},
            {section: quantities_table(self.scales, values) for section, values in sections.items()},
        )

    @property
    def kind(self) -> str:
        """The shipped model that the scenario's model is, or is made from."""
        return MODELS[self.model].kind

    @property
    def scales(self) -> Scales:
        """The scales that make this scenario dimensionless."""
        return Scales.of(self.parameters.model_dump(), self.units)

    def dimensionless(self) -> dict[str, float]:
        """All real-valued keys, times included, in units of the scales: what the solver works with."""
        values = self.sections()
        reals = {key: value for section in values.values() for key, value in section.items() if type(value) is float}
        return self.scales.to_dimensionless(reals)

    def twins(self) -> dict[str, float]:
        """The alternative keys with their values (peclet, inverse_hydrodynamic_length, enclosed_volume)."""
        return twin_values(self.parameters.model_dump(), dict(self.given), self.model)

    def values(self) -> dict[str, Value]:
        """Every key with its value, over all sections, twins included."""
        sections = self.sections()
        return sections["parameters"] | self.twins() | sections["initial"] | sections["run"] | sections["numerics"]

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON: the keys as given, and the resolved values by section with the twins among them."""
        sections = self.sections()
        sections["parameters"] |= self.twins()
        units = {"units": self.units.as_dict()} if self.units else {}
        return {"name": self.name, "model": self.model, **units, "given": dict(self.given), **sections}

    def difference(self, other: "Scenario") -> str | None:
        """What keeps `other` from being a continuation of this run: one phrase naming the key, as it was given, or None."""
        if self.model != other.model:
            return f"model is {self.model}, not {other.model}"
        if self.units != other.units:
            return f"units are {_stated(self.units)}, not {_stated(other.units)}"
        sections, theirs = self.sections(), other.sections()
        differing = [
            key
            for section in _SECTIONS
            for key, value in sections[section].items()
            if key not in FREE_ON_RESUME and theirs[section][key] != value
        ]
        if not differing:
            return None
        mine, others = self.values(), other.values()
        given = (key for key in dict(other.given) if key not in FREE_ON_RESUME and mine[key] != others[key])
        key = next(given, differing[0])
        return f"{key} is {mine[key]!r}, not {others[key]!r}"

    def sections(self) -> dict[str, dict[str, Any]]:
        return {section: getattr(self, section).model_dump() for section in _SECTIONS}


def scenario_names() -> tuple[str, ...]:
    """The built-in scenarios, and those that users defined."""
    return (*_NAMES, *TEMPLATES)


def template(name: str, units: Mapping[str, str] | None = None) -> str:
    """The commented TOML text of a scenario by name; units: as for `Scenario.in_units`."""
    if units:
        return _converted(template(name), units)
    if name not in scenario_names():
        load_installed()
    if name in TEMPLATES:
        return TEMPLATES[name]
    if name not in _NAMES:
        close = difflib.get_close_matches(str(name).lower(), scenario_names(), n=1, cutoff=0.0)[0]
        raise InputError(
            f"scenario {name!r}: there is none of this name; the nearest is {close}, all: {', '.join(scenario_names())}."
        )
    return resources.files("shapespace.study").joinpath("scenarios", f"{name}.toml").read_text(encoding="utf-8")


def _converted(text: str, units: Mapping[str, str]) -> str:
    """A scenario's text in other units: with a section of them, and the numbers that mean the same."""
    made = _from_text(text).in_units(**units)
    assert made.units is not None
    for key, value in made.given:
        if type(value) is float:
            # Twelve digits, so that no number ends in the round-off of a conversion.
            number = repr(float(f"{value:.12g}"))
            text = re.sub(rf"^{key} = \S+ *", f"{key} = {number}".ljust(42), text, count=1, flags=re.MULTILINE)
    stated = "".join(f'{name} = "{unit}"\n' for name, unit in made.units.as_dict().items())
    text = text.replace("\n[parameters]\n", f"\n[units]\n{stated}\n[parameters]\n", 1)
    about = (
        "# Units. Plain numbers are in those of the section [units]; others have their own and are in quotes, as in\n"
        '# tension = "0.01 pN/nm". In brackets below: L length, E energy, T time, C concentration; [1] a pure number.'
    )
    return re.sub(r"# Units\..*?(?=\n#\n)", about, text, count=1, flags=re.DOTALL)


def scenario(name: str, **overrides: object) -> Scenario:
    """A built-in scenario with some keys changed, e.g. `scenario("guided-division", peclet=300, until=1)`."""
    made = _shipped(name) if name in _NAMES else _from_text(template(name))
    return made.with_overrides(overrides)


@cache
def _shipped(name: str) -> Scenario:
    """A scenario of the package, which does not change."""
    return _from_text(template(name))


def load_scenario(path: str | Path) -> Scenario:
    """The scenario in a TOML file. InputError names the file, and the line or the key."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; `shapespace config NAME --out {path}` writes one.") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; give the scenario's TOML file.") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{str(path)!r}: cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, line {line}: is not UTF-8 text; save the scenario as UTF-8.") from None
    try:
        return _from_text(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"line (\d+)", str(error))
        line = int(found[1]) if found else text.count("\n") + 1
        raise InputError(
            f"{path}, line {line}: is not valid TOML ({error}); correct the line, or write the file anew with "
            "`shapespace config NAME`."
        ) from None
    except RecursionError:
        raise InputError(
            f"{path}: is nested too deeply for a scenario; write it anew with `shapespace config NAME`."
        ) from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _from_text(text: str) -> Scenario:
    """A scenario from TOML that must state every key, so that a file cut short is never taken for a whole one."""
    document = tomllib.loads(text)
    for entry in ("name", "model"):
        if entry not in document:
            raise InputError(
                f'{entry}: is missing at the top; the file is cut short or no scenario: add {entry} = "...".'
            )
    name, model, stated = document.pop("name"), document.pop("model"), document.pop("units", None)
    _check_model(model)
    if not isinstance(stated, dict | None):
        raise InputError(f"units = {shown(stated)}: must be a section [units] with length, energy and time.")
    units = None if stated is None else Units.declare(stated)
    keys: dict[str, object] = {}
    for section, entries in document.items():
        _check_section(section, entries, model)
        keys |= entries
    known = MODELS[model]
    for key, section in known.section_of.items():
        rival = known.rival_of(key)
        if key not in (*known.twins, *LATER, *keys) and rival not in keys:
            either = f"{key} (or {rival})" if rival else key
            raise InputError(f"{either}: is missing from [{section}]; the file is cut short or incomplete: add it.")
    return Scenario.from_keys(name, model, keys, units)


def _stated(units: Units | None) -> str:
    return ", ".join(units.as_dict().values()) if units else "not declared"


def _check_model(model: object) -> None:
    if isinstance(model, str) and model not in MODELS:
        load_installed()
    if not isinstance(model, str) or model not in MODELS:
        own = "; a model of your own needs --import FILE" if isinstance(model, str) else ""
        raise InputError(
            f"model = {shown(model)}: is unknown; the nearest valid one is {nearest(str(model), MODELS)}{own}."
        )


def _check_section(section: str, entries: object, model: str) -> None:
    """Raise InputError unless this is a section that holds its own keys, none of them a number in quotes."""
    section_of = MODELS[model].section_of
    if section in section_of:
        raise InputError(f"{section} = {shown(entries)}: has no section; move it under [{section_of[section]}].")
    if section not in _SECTIONS or not isinstance(entries, dict):
        raise InputError(f"[{section}]: is unknown; the nearest valid section is [{nearest(section, _SECTIONS)}].")
    for key, value in entries.items():
        check_key(key, value, model)
        if section_of[key] != section:
            raise InputError(f"{key} = {shown(value)}: stands in [{section}]; move it under [{section_of[key]}].")
        # Text in a file is a slip (`peclet = "450"`); only the command line's text is read as a number.
        if isinstance(value, str) and not is_word(key, model) and not has_unit(key, value, model):
            must = {float: "a number", int: "a whole number", bool: "true or false"}[MODELS[model].type_of(key)]
            raise InputError(complaint(key, value, f"must be {must}, without quotes"))
