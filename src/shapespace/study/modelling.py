"""Models that users make: a shipped surface with terms, parameters, ends or a species law of their own, and their scenarios.

What is defined here goes the way of the shipped models: `run`, `steady`, `branch`, `curve` and `search` know it by name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Any

import tomlkit
from pydantic import Field, create_model

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES, Quantity
from shapespace.base.units import read_dimension
from shapespace.models.recipe import Recipe
from shapespace.physics.admission import check_law
from shapespace.physics.laws import Law
from shapespace.physics.term import AbstractTerm
from shapespace.study.engine import recipe_of
from shapespace.study.keys import MODELS, Model, nearest, replace_keys
from shapespace.study.scenario import TEMPLATES, scenario_names, template
from shapespace.variational.ends import Ends

_ALLOWED = ("energy", "dissipation", "power", "linear_laws")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a user's model: symbol for formulas, meaning in words, unit as in the glossary (`E T/L^2`), lower bound.

    default: its value in scenarios that do not state it, in units in which the scales are one.
    """

    symbol: str
    meaning: str
    unit: str
    default: float
    least: float | None = None


def define_model(
    name: str,
    like: str,
    laws: Sequence[Law | Sequence[Law]],
    parameters: Mapping[str, Parameter] | None = None,
    *,
    without: Sequence[str] = (),
    ends: Ends | None = None,
    species: Any = None,
    terms: Any = None,
    **choices: Any,
) -> None:
    """Add a model: the shipped one that it is like, with more laws and parameters; or the same again, to change it.

    without: classes of the shipped terms to leave out, e.g. "ActiveTension". ends, species: in place of those of the
    shipped model (`variational.ends`, `physics.species`). terms: of the parameters by name, further terms of the package
    (`physics`). choices: incompressible, fixed_area, storages, turning, species_count as in `models.recipe`.
    ValueError where a law is not admissible (`physics.admission`), InputError where a name is taken or unknown.
    """
    parameters = dict(parameters or {})
    laws = _flat(laws)
    if like not in _shipped():
        raise InputError(f"like = {like!r}: is no shipped model; the nearest is {nearest(like, _shipped())}.")
    if name in _shipped():
        raise InputError(f"name = {name!r}: is a shipped model; choose another name.")
    shipped, recipe = MODELS[like], recipe_of(like)
    taken = [key for key in parameters if key in shipped.section_of]
    if taken:
        raise InputError(f"{taken[0]}: is a parameter of {like} already; use it, or choose another name.")
    for key, one in parameters.items():
        if key in QUANTITIES and QUANTITIES[key].dimension != read_dimension(one.unit):
            raise InputError(f"{key}: is {QUANTITIES[key].meaning} elsewhere, of another unit; choose another name.")
    dimensions = {key: read_dimension(one.unit) for key, one in parameters.items()}
    _check_terms(recipe, tuple(without))
    known = {key: QUANTITIES[key].dimension for key in recipe.parameters if key in QUANTITIES}
    for law in laws:
        # Any numbers do: the tests are of form, at parameters of one; the user's own ones at their defaults.
        values = dict.fromkeys(known, 1.0) | {key: one.default for key, one in parameters.items()}
        check_law(law, values, known | dimensions)
    fields: dict[str, Any] = {
        key: (Annotated[float, Field(ge=one.least)] if one.least is not None else float, one.default)
        for key, one in parameters.items()
    }
    record = create_model(f"{name}-parameters", __base__=shipped.sections["parameters"], **fields)

    def all_terms(p: Any) -> tuple[AbstractTerm, ...]:
        return (*(law.term(p) for law in laws), *(terms(p) if terms else ()))

    made = recipe.extended(tuple(parameters), all_terms, tuple(without), ends, species, laws=laws, **choices)
    # Conditions and unknowns are counted now, not at the first run.
    made.system()
    for key, one in parameters.items():
        QUANTITIES.setdefault(key, Quantity(one.symbol, one.meaning, dimensions[key]))
    MODELS[name] = Model({**shipped.sections, "parameters": record}, shipped.twins, like, made)


def define_scenario(name: str, title: str, model: str, like: str, **changes: float | bool) -> None:
    """Add a scenario: a shipped one under another model, with some keys changed. InputError names a bad key."""
    if MODELS[_known(model)].kind != MODELS[_model_of(like)].kind:
        raise InputError(f"like = {like!r}: is of another kind of surface than {model}.")
    if name in scenario_names() and name not in TEMPLATES:
        raise InputError(f"name = {name!r}: is a built-in scenario; choose another name.")
    text = template(like)
    body = tomlkit.parse(text[text.index("\nname =") :])
    body["name"], body["model"] = name, model
    sections: dict[str, Any] = {section: body[section] for section in ("parameters", "initial", "run", "numerics")}
    given = {key: value for section in sections.values() for key, value in section.items()}
    wanted = replace_keys(given, changes, model)
    for section in sections.values():
        for key in [key for key in section if key not in wanted]:
            del section[key]
    own = {
        key: one.default for key, one in MODELS[model].sections["parameters"].model_fields.items() if key not in given
    }
    rivals = {key for key in own if MODELS[model].rival_of(key) in wanted}
    for key, value in {**{k: v for k, v in own.items() if k not in rivals}, **wanted}.items():
        section = sections[MODELS[model].section_of[key]]
        is_new = key not in section
        section[key] = value
        if is_new and key in QUANTITIES:
            section[key].comment(f"{QUANTITIES[key].symbol}: {QUANTITIES[key].meaning}")
    TEMPLATES[name] = (
        f"# {title}\n#\n# The model {model}; all that is not stated here is as in {like}.\n{tomlkit.dumps(body)}"
    )


def _flat(laws: Sequence[Law | Sequence[Law]]) -> tuple[Law, ...]:
    """All laws; a matrix of linear laws makes two."""
    found: list[Law] = []
    for one in laws:
        for law in one if isinstance(one, list | tuple) else (one,):
            if not isinstance(law, Law):
                raise InputError(f"{law!r}: is no law; make it one with @{', @'.join(_ALLOWED)}.")
            found.append(law)
    names = [law.name for law in found]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"{twice[0]}: is given twice; leave one out, or give the functions different names.")
    return tuple(found)


def _shipped() -> list[str]:
    return [name for name, model in MODELS.items() if model.kind == name]


def _known(model: str) -> str:
    if model not in MODELS:
        raise InputError(
            f"model = {model!r}: is not defined; define_model comes first. Defined are {', '.join(MODELS)}."
        )
    return model


def _model_of(scenario: str) -> str:
    return str(tomlkit.parse(template(scenario))["model"])


def _check_terms(recipe: Recipe, without: tuple[str, ...]) -> None:
    ones = SimpleNamespace(**dict.fromkeys(recipe.parameters, 1.0))
    names = [type(term).__name__ for term in recipe.terms(ones)]
    for name in without:
        if name not in names:
            raise InputError(f"without = {name!r}: the model has no such term; it has {', '.join(names)}.")
