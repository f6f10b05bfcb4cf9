"""The flat key space of scenarios: sections, twins, the reading of `key=value` text, and the nearest valid key.

A key names one thing wherever it is written, so `-s key=value` needs no section. A twin is a second way to state a key:

    peclet                       active_tension = peclet diffusivity bulk_viscosity / sphere_radius^2
    inverse_hydrodynamic_length  friction = bulk_viscosity (inverse_hydrodynamic_length / sphere_radius)^2
    enclosed_volume              4 pi sphere_radius^3 / 3 = enclosed_volume

and for all models those of the other way to write the Helfrich energy, kappa_H (H - C)^2 for kappa/2 (2H - C0)^2:

    mean_curvature_rigidity      bending_rigidity = mean_curvature_rigidity / 2
    spontaneous_mean_curvature   spontaneous_curvature = 2 spontaneous_mean_curvature
"""

import difflib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from typing import Any, Literal, NamedTuple, cast, get_origin

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES
from shapespace.base.units import Dimension, Units
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

MAIN_KEYS = {"closed-surface": "peclet", "open-membrane": "spontaneous_curvature", "vesicle": "reduced_volume"}
"""By kind of model, the key of a problem that need not vary any, and in which a branch is proposed."""

Value = float | int | bool | str
Keys = Mapping[str, Value]
Formula = Callable[[Mapping[str, float]], float]


class Twin(NamedTuple):
    """An alternative key: the key it sets and the formulas both ways, on the parameters."""

    sets: str
    to_key: Formula
    from_key: Formula
    least: float = -math.inf
    is_open: bool = False


_HELFRICH_TWINS = {
    "mean_curvature_rigidity": Twin(
        "bending_rigidity",
        lambda p: 0.5 * p["mean_curvature_rigidity"],
        lambda p: 2.0 * p["bending_rigidity"],
        least=0.0,
        is_open=True,
    ),
    "spontaneous_mean_curvature": Twin(
        "spontaneous_curvature",
        lambda p: 2.0 * p["spontaneous_mean_curvature"],
        lambda p: 0.5 * p["spontaneous_curvature"],
    ),
}
# In the order in which they are resolved: the later formulas need the radius.
_CLOSED_TWINS = {
    "enclosed_volume": Twin(
        "sphere_radius",
        lambda p: math.cbrt(p["enclosed_volume"] / (4.0 * math.pi / 3.0)),
        lambda p: 4.0 * math.pi / 3.0 * p["sphere_radius"] ** 3,
        least=0.0,
        is_open=True,
    ),
    "peclet": Twin(
        "active_tension",
        lambda p: p["peclet"] * p["diffusivity"] * p["bulk_viscosity"] / p["sphere_radius"] ** 2,
        lambda p: p["active_tension"] * p["sphere_radius"] ** 2 / (p["diffusivity"] * p["bulk_viscosity"]),
    ),
    "inverse_hydrodynamic_length": Twin(
        "friction",
        lambda p: p["bulk_viscosity"] * (p["inverse_hydrodynamic_length"] / p["sphere_radius"]) ** 2,
        lambda p: p["sphere_radius"] * math.sqrt(p["friction"] / p["bulk_viscosity"]),
        least=0.0,
    ),
    **_HELFRICH_TWINS,
}


class Model(NamedTuple):
    """The records that a model needs, by section, and its twins.

    kind: the shipped model that it is, or is made from. recipe: what a user's model is made of (`models.recipe`); of
    shipped ones the engine knows it, as names are looked up before the array library is loaded.
    """

    sections: dict[str, type[Record]]
    twins: dict[str, Twin]
    kind: str
    recipe: Any = None

    @property
    def section_of(self) -> dict[str, str]:
        """The section of every key, twins included, in the order of the records."""
        keys = {key: section for section, record in self.sections.items() for key in record.model_fields}
        return keys | dict.fromkeys(self.twins, "parameters")

    def type_of(self, key: str) -> type:
        """float, int or bool."""
        if key in self.twins:
            return float
        return cast("type", self.sections[self.section_of[key]].model_fields[key].annotation)

    def rival_of(self, key: str) -> str | None:
        """The key that states the same thing: of a twin the key it sets, of that key the twin."""
        if key in self.twins:
            return self.twins[key].sets
        return next((name for name, twin in self.twins.items() if twin.sets == key), None)


def _model(kind: str, parameters: type[Record], initial: type[Record], twins: dict[str, Twin]) -> Model:
    return Model({"parameters": parameters, "initial": initial, "run": RunSettings, "numerics": Numerics}, twins, kind)


MODELS = {
    "closed-surface": _model("closed-surface", ClosedSurfaceParameters, ClosedSurfaceInitial, _CLOSED_TWINS),
    "open-membrane": _model("open-membrane", OpenMembraneParameters, OpenMembraneInitial, _HELFRICH_TWINS),
    "vesicle": _model("vesicle", VesicleParameters, VesicleInitial, _HELFRICH_TWINS),
}


def nearest(name: str, candidates: Iterable[str]) -> str:
    """The candidate most like a name; a symbol from the formulas (kappa, Pe) finds its key."""
    candidates = list(candidates)
    for key in candidates:
        if key in QUANTITIES and QUANTITIES[key].symbol.lower() == name.lower():
            return key
    return difflib.get_close_matches(name.lower(), candidates, n=1, cutoff=0.0)[0]


def check_key(key: str, value: object, model: str) -> None:
    """Raise InputError unless the model has this key, naming the nearest one that it has."""
    keys = MODELS[model].section_of
    if key not in keys:
        others = [name for name, other in MODELS.items() if key in other.section_of]
        known = f" (it belongs to {others[0]})" if others else ""
        raise InputError(
            f"{key} = {shown(value)}: unknown key in a {model} scenario{known}; the nearest valid one is "
            f"{nearest(key, keys)}."
        )


def is_word(key: str, model: str) -> bool:
    """Whether a key's values are words."""
    return get_origin(MODELS[model].type_of(key)) is Literal


def typed(key: str, value: object, model: str) -> Value:
    """A value as plain Python number, bool or word; text is read as the key's type. InputError where it cannot be."""
    if isinstance(value, str):
        if is_word(key, model):
            return value.strip()
        return _read_text(key, value, MODELS[model].type_of(key))
    # NumPy's numbers are numbers; its bool_ has no place in numbers.Real and is left to fail the check.
    if isinstance(value, bool) or not isinstance(value, Real):
        # What is of no such type goes on as it is, because the record that it is for says best what it takes.
        return value  # type: ignore[return-value]
    if isinstance(value, Integral) and MODELS[model].type_of(key) is not float:
        return int(value)
    try:
        return float(value)
    except OverflowError:
        raise InputError(complaint(key, value, "must fit into a double-precision number")) from None


def _read_text(key: str, text: str, kind: type) -> Value:
    if kind is bool:
        if text.strip().lower() not in ("true", "false"):
            raise InputError(complaint(key, text, "must be true or false"))
        return text.strip().lower() == "true"
    try:
        return int(text) if kind is int else float(text)
    except ValueError:
        must = "must be a whole number" if kind is int else "must be a number"
        raise InputError(complaint(key, text, must)) from None


def in_numbers(keys: Mapping[str, object], model: str, units: Units | None) -> dict[str, object]:
    """The keys with every value with a unit, `20 pN nm`, as the number that it is in the declared units."""
    return {key: _number(key, value, units) if has_unit(key, value, model) else value for key, value in keys.items()}


def convert_keys(keys: Keys, units: Units | None, stated: Mapping[str, str]) -> tuple[dict[str, Value], Units]:
    """The keys in other units, and those; of keys without units each text says how large the present unit is, `10 um`."""
    if units is None:
        new, sizes = Units.with_sizes(stated)

        def factor(dimension: Dimension) -> float:
            return math.prod(sizes.get(base, 1.0) ** power for base, power in dimension._asdict().items())
    else:
        new = Units.declare({**units.as_dict(), **stated})

        def factor(dimension: Dimension) -> float:
            return units.factor_to(new, dimension)

    converted = {
        key: value * factor(QUANTITIES[key].dimension) if isinstance(value, float) else value
        for key, value in keys.items()
    }
    return converted, new


def has_unit(key: str, value: object, model: str) -> bool:
    """Whether a value is the text of a number and more, where a real number is due."""
    check_key(key, value, model)
    if not isinstance(value, str) or MODELS[model].type_of(key) is not float:
        return False
    return re.match(r"\s*[-+]?\.?\d", value) is not None and not _is_number(value)


def _number(key: str, value: object, units: Units | None) -> float:
    if units is None:
        raise InputError(
            complaint(
                key,
                value,
                "must be a number, as this scenario declares no units; with a section [units] it may have one",
            )
        )
    return units.read(key, str(value), QUANTITIES[key].dimension)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def replace_keys(given: Keys, changes: Mapping[str, object], model: str) -> dict[str, Value]:
    """The given keys with changes; a changed key replaces its twin, and changing both of a pair is an error."""
    result = dict(given)
    for key, value in changes.items():
        check_key(key, value, model)
        rival = MODELS[model].rival_of(key)
        if rival is not None and rival in changes:
            raise InputError(
                f"{key} = {shown(value)} and {rival} = {shown(changes[rival])}: state one thing twice; give only one."
            )
        result.pop(rival or key, None)
        result[key] = typed(key, value, model)
    return result


def make_parameters(given: Mapping[str, Any], model: str) -> Record:
    """The parameters record with every twin replaced by the key it sets; InputError names the key as it was given."""
    record, twins = MODELS[model].sections["parameters"], MODELS[model].twins
    used = {name: twin for name, twin in twins.items() if name in given}
    for name, twin in used.items():
        _check_twin(name, given[name], twin)
    plain = {key: value for key, value in given.items() if key not in used}
    # First with any number in place of what the twins set, so that a bad key is named before a formula meets it.
    values = record(**plain, **{twin.sets: 1.0 for twin in used.values()}).model_dump()
    for name, twin in used.items():
        values[twin.sets] = _finite(name, given[name], twin.to_key, values | {name: given[name]})
    return record(**values)


def twin_values(parameters: Mapping[str, float], given: Keys, model: str) -> dict[str, float]:
    """The value of every twin: as given, or from the parameters."""
    return {
        name: float(given[name])
        if name in given
        else _finite(twin.sets, parameters[twin.sets], twin.from_key, parameters)
        for name, twin in MODELS[model].twins.items()
    }


def _check_twin(name: str, value: object, twin: Twin) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(complaint(name, value, "must be a number (and not quoted)"))
    if not math.isfinite(value):
        raise InputError(complaint(name, value, "must be a finite number"))
    if value < twin.least or (twin.is_open and value == twin.least):
        raise InputError(complaint(name, value, f"must be {'>' if twin.is_open else '>='} {twin.least:g}"))


def _finite(key: str, value: object, formula: Formula, parameters: Mapping[str, float]) -> float:
    try:
        result = formula(parameters)
    except (OverflowError, ZeroDivisionError):
        result = math.inf
    if not math.isfinite(result):
        raise InputError(complaint(key, value, "is out of the range of double precision beside the other parameters"))
    return result
