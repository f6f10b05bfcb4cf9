"""Scenarios: the paper's values, templates, twins, overrides, and one line for every bad input."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES
from shapespace.study.keys import MODELS
from shapespace.study.parameters import ClosedSurfaceParameters, Numerics
from shapespace.study.scenario import Scenario, load_scenario, scenario, scenario_names, template

NAMES = scenario_names()
_LETTERS = {"length": "L", "energy": "E", "time": "T", "concentration": "C"}


def unit_in_templates(key: str) -> str:
    """The unit of a key as the templates write it, e.g. `E T/L^2`."""
    parts: dict[bool, list[str]] = {True: [], False: []}
    dimension = QUANTITIES[key].dimension
    for base in ("energy", "length", "time", "concentration"):
        if power := getattr(dimension, base):
            parts[power > 0].append(_LETTERS[base] + (f"^{abs(power)}" if abs(power) > 1 else ""))
    above = " ".join(parts[True]) or "1"
    return f"{above}/{' '.join(parts[False])}" if parts[False] else above


def rejected(**overrides: object) -> str:
    """The message about a bad override of ring-slipping; it must be one line."""
    with pytest.raises(InputError) as caught:
        scenario("ring-slipping", **overrides)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", NAMES)
def test_template_states_every_key_with_symbol_and_unit(name: str):
    text = template(name)
    model = MODELS[scenario(name).model]
    lines = dict(re.findall(r"^(\w+) = .*?(#.*)$", text, flags=re.MULTILINE))
    for key, comment in lines.items():
        assert comment.startswith(f"# {QUANTITIES[key].symbol}") or key == "spontaneous_curvature"
        assert f"[{unit_in_templates(key)}]" in comment, key
    stated = {model.twins[key].sets if key in model.twins else key for key in lines}
    assert stated == set(model.section_of) - set(model.twins)


@pytest.mark.parametrize("name", NAMES)
def test_template_opens_as_a_short_paper(name: str):
    head = template(name).partition("\nname = ")[0]
    assert all(line.startswith("#") for line in head.strip().splitlines())
    for heading in (
        "Fig. ",
        "Model.",
        "Units.",
        "Assumed where the paper is silent.",
        "Expect.",
        "Run: shapespace run",
    ):
        assert heading in head
    assert max(map(len, template(name).splitlines())) <= 120


def test_guided_division_has_the_values_of_the_paper():
    values = scenario("guided-division").values()
    expected = {
        "active_tension": 450, "peclet": 450, "friction": 0.09, "tension": 9, "turnover_rate": 45, "ring_amplitude": 4,
        "saturation_concentration": 10, "ring_width": 0.02**0.5, "enclosed_volume": 4 * np.pi / 3, "until": 2,
    }  # fmt: skip
    assert_allclose([values[key] for key in expected], [*expected.values()], rtol=1e-15)


def test_other_scenarios_have_the_values_of_the_paper():
    slipping, swimmer, membrane = (scenario(name).values() for name in NAMES[1:4])
    assert (slipping["turnover_rate"], slipping["saturation_concentration"], slipping["ring_amplitude"]) == (9, 1, 0)
    assert (slipping["initial_background"], slipping["initial_ring_amplitude"]) == (0.2, 2)
    assert slipping["seed_amplitude"] != 0
    assert (swimmer["peclet"], swimmer["friction"]) == (100, 1)
    assert (membrane["spontaneous_curvature"], membrane["boundary_tension"], membrane["friction"]) == (9, 12.5, 0.25)
    assert (membrane["coat_area"], membrane["coat_sharpness"]) == (0.08, 25)


@pytest.mark.parametrize("name", NAMES)
def test_scenario_survives_json_bit_for_bit(name: str):
    original = scenario(name, bending_rigidity=1 / 3, until=0.1 + 0.2)
    copy = Scenario.from_dict(json.loads(json.dumps(original.as_dict())))
    assert copy == original
    assert hash(copy) == hash(original)
    assert copy.as_dict() == original.as_dict()


def test_scenario_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        scenario("guided-division").run.until = 3.0


def test_a_given_twin_is_what_stays_constant():
    s = scenario("guided-division").with_overrides({"sphere_radius": 2.0, "diffusivity": 3.0})
    assert s.twins()["peclet"] == 450
    assert_allclose(s.parameters.active_tension, 450 * 3 / 4)
    assert_allclose(s.parameters.friction, 0.09 / 4)
    assert_allclose(s.twins()["enclosed_volume"], 4 / 3 * np.pi * 8)


@pytest.mark.parametrize(
    ("key", "value", "twin", "expected"),
    [
        ("active_tension", 100.0, "peclet", 100.0),
        ("friction", 4.0, "inverse_hydrodynamic_length", 2.0),
        ("peclet", 33.0, "active_tension", 33.0),
        ("inverse_hydrodynamic_length", 3.0, "friction", 9.0),
        ("enclosed_volume", 36 * np.pi, "sphere_radius", 3.0),
        ("sphere_radius", 3.0, "enclosed_volume", 36 * np.pi),
    ],
)
def test_a_key_replaces_its_twin(key: str, value: float, twin: str, expected: float):
    assert_allclose(scenario("guided-division", **{key: value}).values()[twin], expected)


def test_text_is_read_by_the_type_of_the_key():
    s = scenario("guided-division").with_overrides({"elements": "80", "azimuthal_flow": "true", "until": " 1e-1 "})
    assert (s.numerics.elements, s.numerics.azimuthal_flow, s.run.until) == (80, True, 0.1)


def test_numbers_of_numpy_are_numbers():
    s = scenario("guided-division", elements=np.int64(80), until=np.float64(1), peclet=np.float32(2))
    assert (s.numerics.elements, s.run.until, s.parameters.active_tension) == (80, 1.0, 2.0)
    assert type(s.run.until) is float
    assert "true or false" in rejected(azimuthal_flow=np.int64(1))


@given(st.tuples(*[st.floats(1e-3, 1e3)] * 4))
def test_scenario_in_other_units_is_the_same_computation(factors: tuple[float, float, float, float]):
    units = dict(zip(("length", "energy", "time", "concentration"), factors, strict=True))
    original = scenario("ring-slipping", spontaneous_curvature=0.3, dt=1e-3)
    values = {key: value for key, value in original.values().items() if type(value) is float}
    for twin in original.twins():
        del values[twin]
    dimensions = {key: QUANTITIES[key].dimension._asdict() for key in values}
    other = {
        key: value * np.prod([units[base] ** power for base, power in dimensions[key].items()])
        for key, value in values.items()
    }
    expected, found = original.dimensionless(), original.with_overrides(other).dimensionless()
    assert_allclose([found[key] for key in expected], [*expected.values()], rtol=1e-13)


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("shear_viscosity", -1.0, "= -1: must be > 0"),
        ("bulk_viscosity", 0.0, "= 0: must be > 0"),
        ("diffusivity", -2.0, "= -2: must be > 0"),
        ("bending_rigidity", 0, "must be > 0"),
        ("enclosed_volume", 0.0, "= 0: must be > 0"),
        ("enclosed_volume", -1.0, "= -1: must be > 0"),
        ("sphere_radius", 0.0, "must be > 0"),
        ("friction", -1e-9, "must be >= 0"),
        ("inverse_hydrodynamic_length", -0.1, "must be >= 0"),
        ("turnover_rate", -1, "must be >= 0"),
        ("ring_amplitude", -1.1, "must be >= -1"),
        ("seed_amplitude", 1.5, "must be <= 1"),
        ("initial_background", 0.0, "must be > 0"),
        ("initial_ring_amplitude", -0.3, "must be >= -initial_background"),
        ("tension", float("nan"), "= nan: must be a finite number"),
        ("tension", "-inf", "= -inf: must be a finite number"),
        ("peclet", float("inf"), "= inf: must be a finite number"),
        ("peclet", "nan", "must be a finite number"),
        ("peclet", "many", "= 'many': must be a number"),
        ("peclet", True, "= True: must be a number"),
        ("tension", True, "= True: must be a number"),
        ("tension", [9.0], "must be a number"),
        ("tension", None, "= None: must be a number"),
        ("tension", 10**400, "must fit into a double"),
        ("peclet", 10**400, "must fit into a double"),
        ("elements", 61, "= 61: must be one of 20, 40"),
        ("elements", 60.0, "must be a whole number"),
        ("elements", "60.0", "must be a whole number"),
        ("elements", True, "must be a whole number"),
        ("degree", 7, "must be <= 6"),
        ("max_steps", 0, "must be >= 1"),
        ("azimuthal_flow", 1, "must be true or false"),
        ("azimuthal_flow", "yes", "must be true or false"),
        ("until", 0.0, "must be > 0"),
        ("dt", -1e-3, "must be >= 0"),
        ("dt", 6.0, "must not exceed until = 5"),
        ("sphere_radius", 1e-200, "range of double precision"),
        ("sphere_radius", 1e100, "choose units"),
    ],
)
def test_bad_value_is_named_with_what_must_hold(key: str, value: object, must: str):
    message = rejected(**{key: value})
    assert must in message
    assert key in message or key == "sphere_radius"


@pytest.mark.parametrize(
    ("key", "near"),
    [("pecle", "peclet"), ("Peclet", "peclet"), ("kappa", "bending_rigidity"), ("Pe", "peclet"), ("zzz", "")],
)
def test_unknown_key_names_the_nearest(key: str, near: str):
    message = rejected(**{key: 3.0})
    assert message.startswith(f"{key} = 3: unknown key")
    assert f"the nearest valid one is {near}" in message


def test_key_of_the_other_model_is_told_apart():
    assert "belongs to open-membrane" in rejected(coat_area=1.0)


def test_both_of_a_pair_are_one_too_many():
    assert "give only one" in rejected(peclet=1.0, active_tension=2.0)


def test_unknown_scenario_names_the_nearest():
    with pytest.raises(InputError, match="nearest is guided-division"):
        scenario("guided-divison")


def test_records_made_by_hand_are_checked_in_one_line_too():
    with pytest.raises(InputError, match=r"^elements = 7: must be one of"):
        Numerics(elements=7)
    with pytest.raises(InputError, match=r"^bending_rigidity: is missing"):
        ClosedSurfaceParameters()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(template("guided-division"), encoding="utf-8")
    return path


def broken(path: Path, old: str, new: str) -> str:
    """The message about a file after an edit; it must be one line that names the file."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return message_about(path)


def message_about(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def test_template_file_loads_as_the_scenario(file: Path):
    assert load_scenario(file) == scenario("guided-division")
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n"))
    assert load_scenario(str(file)) == scenario("guided-division")


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("tension = 9.0", "tension = -", "line 3"),
        ("tension = 9.0", "tension = 9.0 9.0", "is not valid TOML"),
        ("tension = 9.0", 'tension = "9.0"', "tension = '9.0': must be a number, without quotes"),
        ("tension = 9.0", "tension = nan", "tension = nan: must be a finite number"),
        ("tension = 9.0", "tension = 1979-05-27", "must be a number"),
        ("tension = 9.0", "tension = true", "must be a number"),
        ("tension = 9.0", "tension = 9.0\ntension = 8.0", "line"),
        ("tension = 9.0", "tenson = 9.0", "nearest valid one is tension"),
        ("tension = 9.0", "", "tension: is missing from [parameters]"),
        ("peclet = 450.0", "", "active_tension (or peclet): is missing"),
        ("peclet = 450.0", "peclet = 450.0\nactive_tension = 1.0", "give only one"),
        ("degree = 4", "degree = 4.0", "must be a whole number"),
        ("degree = 4", "until = 4", "stands in [numerics]; move it under [run]"),
        ("[parameters]", "peclet = 3\n[parameters]", "has no section"),
        ("[initial]", "[inital]", "nearest valid section is [initial]"),
        ('model = "closed-surface"', "", "model: is missing"),
        ('model = "closed-surface"', 'model = "closed"', "nearest valid one is closed-surface"),
        ('model = "closed-surface"', "model = 3", "model = 3: is unknown"),
        ('name = "guided-division"', 'name = "../x"', "names a directory"),
        ('name = "guided-division"', "name = 3", "names a directory"),
    ],
)
def test_bad_file_is_named_with_line_or_key(file: Path, old: str, new: str, part: str):
    assert part in broken(file, old, new)


def test_absurd_nesting_is_no_crash(file: Path):
    assert "`shapespace config NAME`" in broken(file, "azimuthal_flow = false", "azimuthal_flow = " + "[" * 5000)


def test_syntax_error_names_its_line(file: Path):
    line = file.read_text().splitlines().index("[initial]") + 1
    assert f"{file}, line {line}:" in broken(file, "[initial]", "[initial")


def test_bytes_that_are_no_text_name_their_line(file: Path):
    file.write_bytes(b"# one\n# two\n\xff\xfe" + file.read_bytes())
    assert f"{file}, line 3: is not UTF-8 text" in message_about(file)


def test_missing_file_directory_and_empty_file(tmp_path: Path):
    assert "there is no such file" in message_about(tmp_path / "absent.toml")
    assert "is a directory" in message_about(tmp_path)
    (empty := tmp_path / "empty.toml").touch()
    assert "name: is missing" in message_about(empty)
    with pytest.raises(InputError, match="cannot be read"):
        load_scenario("a\0b.toml")


def test_unreadable_file_is_named(file: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert "Permission denied" in message_about(file)


def test_a_file_cut_short_anywhere_is_never_taken_for_a_whole_one(file: Path):
    text = file.read_text()
    whole = scenario("guided-division")
    start, end = text.index("[parameters]"), text.index("azimuthal_flow = false") + len("azimuthal_flow = false")
    for length in [*range(0, start, 101), *range(start, end, 7), *range(end - 30, end)]:
        file.write_text(text[:length])
        message_about(file)
    file.write_text(text[:end])
    assert load_scenario(file) == whole
