"""The records of a scenario: every key with its type and the bounds it must meet, checked where the record is made."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]

ELEMENT_COUNTS = (20, 40, 60, 80, 120, 160, 240, 320)


def _is_element_count(value: int) -> int:
    """Few sizes only: each is compiled once and then found in the cache."""
    if value not in ELEMENT_COUNTS:
        raise ValueError(f"must be one of {', '.join(map(str, ELEMENT_COUNTS))}")
    return value


class Record(BaseModel):
    """A frozen record of keys; unknown keys, wrong types, NaN and infinity raise InputError."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise InputError(_one_line(error, values)) from None


class ClosedSurfaceParameters(Record):
    """Material constants of a closed active surface, in the user's units."""

    bending_rigidity: Positive
    spontaneous_curvature: float = 0.0
    shear_viscosity: Positive
    bulk_viscosity: Positive
    friction: NonNegative
    tension: float
    active_tension: float
    diffusivity: Positive
    turnover_rate: NonNegative
    reference_concentration: Positive
    saturation_concentration: Positive
    ring_amplitude: Annotated[float, Field(ge=-1)]
    ring_width: Positive
    sphere_radius: Positive


class OpenMembraneParameters(Record):
    """Material constants of a clamped incompressible membrane with a coat, in the user's units."""

    bending_rigidity: Positive
    spontaneous_curvature: float
    shear_viscosity: Positive
    friction: NonNegative
    boundary_tension: float
    coat_area: NonNegative
    coat_sharpness: Positive
    pulling_force: float = 0.0
    pulled_area: Positive
    pulled_sharpness: Positive
    base_radius: Positive


class VesicleParameters(Record):
    """Material constants of a membrane of fixed area around a fixed volume, in the user's units."""

    bending_rigidity: Positive
    spontaneous_curvature: float = 0.0
    shear_viscosity: Positive
    bulk_viscosity: Positive
    friction: NonNegative
    normal_friction: NonNegative
    reduced_volume: Annotated[float, Field(gt=0, lt=1)]
    area_radius: Positive


class ClosedSurfaceInitial(Record):
    """c(u, 0) = c0 (initial_background + initial_ring_amplitude exp(-(u-1/2)^2/w^2)) (1 + seed_amplitude cos(pi u))."""

    initial_background: Positive
    initial_ring_amplitude: float
    seed_amplitude: Annotated[float, Field(ge=-1, le=1)]

    @model_validator(mode="after")
    def _is_concentration(self) -> Self:
        if self.initial_ring_amplitude < -self.initial_background:
            raise ValueError(
                f"initial_ring_amplitude = {self.initial_ring_amplitude:g}: must be >= -initial_background "
                f"= {-self.initial_background:g}, or the concentration is negative; raise one of them."
            )
        return self


class OpenMembraneInitial(Record):
    """The membrane starts as a flat disc: nothing to choose."""


class VesicleInitial(Record):
    """r = a sin t (1 + e cos t), z = c cos t, long or flat, with e = initial_leaning sqrt(1 - reduced_volume)."""

    initial_oblate: bool = False
    initial_leaning: Annotated[float, Field(gt=-1, lt=1)] = 0.0


class RunSettings(Record):
    """How far and how a run goes in time."""

    until: Positive
    dt: NonNegative = 0.0
    time_tolerance: Positive = 1e-4
    stationary_rate: NonNegative = 1e-6
    max_steps: Annotated[int, Field(ge=1)] = 20000

    @model_validator(mode="after")
    def _has_a_step(self) -> Self:
        if self.dt > self.until:
            raise ValueError(
                f"dt = {self.dt:g}: must not exceed until = {self.until:g}; lower dt (0: adaptive) or raise until."
            )
        return self


class Numerics(Record):
    """The discretisation."""

    elements: Annotated[int, AfterValidator(_is_element_count)] = 40
    degree: Annotated[int, Field(ge=2, le=6)] = 4
    mesh_tolerance: Positive = 1e-5
    parameterization: Literal["sle", "eulerian", "lagrangian"] = "sle"
    azimuthal_flow: bool = False


_MUST = {
    "greater_than": "must be > {gt:g}",
    "greater_than_equal": "must be >= {ge:g}",
    "less_than": "must be < {lt:g}",
    "less_than_equal": "must be <= {le:g}",
    "finite_number": "must be a finite number",
    "float_type": "must be a number (and not quoted)",
    "int_type": "must be a whole number",
    "bool_type": "must be true or false",
    "literal_error": "must be {expected}",
    "extra_forbidden": "is not a key of this record",
}


def complaint(key: str, value: object, must: str) -> str:
    """One line: key, value, what must hold and what to change."""
    meaning = f", the {QUANTITIES[key].meaning}" if key in QUANTITIES else ""
    return f"{key} = {shown(value)}: {must}; change {key}{meaning}."


def shown(value: object) -> str:
    """A value in a message: short, on one line, text in quotes."""
    text = f"{value:g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _one_line(error: ValidationError, values: Mapping[str, Any]) -> str:
    """The first of pydantic's findings, in this project's form."""
    finding = error.errors(include_url=False)[0]
    key = str(finding["loc"][0]) if finding["loc"] else ""
    context = finding.get("ctx", {})
    if finding["type"] == "missing":
        return f"{key}: is missing; add a line `{key} = ...`, as in what `shapespace config NAME` writes."
    if finding["type"] == "value_error":
        must = str(context["error"])
        return complaint(key, values[key], must) if key else must
    must = _MUST.get(finding["type"], finding["msg"]).format(**context)
    if isinstance(value := values.get(key), int) and finding["type"] == "float_type" and not isinstance(value, bool):
        must = "must fit into a double-precision number"
    return complaint(key, value, must)
