"""Physical units: values with units, two unit systems and one result, what is refused, both Helfrich conventions."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.shell import Shell, one_complaint

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES, Scales
from shapespace.base.units import Dimension, Units, read_factors, with_micro
from shapespace.study.run import Run
from shapespace.study.scenario import Scenario, load_scenario, template

CELLS = {"length": "10 um", "energy": "85 pN nm", "time": "3 s", "concentration": "200/um^2"}
OTHER = {"length": "nm", "energy": "zJ", "time": "ms", "concentration": "1/nm^2"}
# Everything that a scenario leaves at zero, so that each unit counts.
ALIVE = {
    "guided-division": {"spontaneous_curvature": 0.3, "seed_amplitude": 0.1, "initial_ring_amplitude": 0.2},
    "membrane-protrusion": {"pulling_force": 20.0},
    "vesicle": {"spontaneous_curvature": 0.3, "friction": 0.5, "normal_friction": 0.5},
}


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def physical(name: str) -> Scenario:
    return ss.scenario(name, dt=1e-3, until=4e-3, elements=20, **ALIVE[name]).in_units(**CELLS)


def dimension(key: str) -> Dimension:
    return QUANTITIES[key].dimension


def real_keys(case: Scenario) -> dict[str, float]:
    return {key: value for key, value in case.values().items() if type(value) is float}


def written(case: Scenario, path: Path, values: dict[str, str]) -> Path:
    """The file of a scenario in its units with some values given as text."""
    text = template(case.name, CELLS)
    sections: dict[str, dict[str, object]] = {section: {} for section in ("parameters", "initial", "run", "numerics")}
    from shapespace.study.keys import MODELS

    for key, value in case.given:
        sections[MODELS[case.model].section_of[key]][key] = values.get(key, value)
    head = text[: text.index("\n[parameters]")]
    body = "\n".join(
        "\n".join([f"\n[{section}]", *(f"{key} = {json.dumps(value)}" for key, value in entries.items())])
        for section, entries in sections.items()
    )
    path.write_text(head + body + "\n")
    return path


@pytest.mark.parametrize("name", ALIVE)
def test_every_key_may_have_a_unit_of_its_own(name: str, tmp_path: Path):
    """Each value written with a unit of another system, in a file that declares the first: the same scenario."""
    case = physical(name)
    other = case.in_units(**OTHER)
    assert other.units is not None
    texts = {
        key: f"{value!r} {label}".removesuffix(" 1")
        for key, value in other.given
        if type(value) is float and (label := other.units.label(dimension(key)))
    }
    with_units = {key: text for key, text in texts.items() if " " in text}
    assert len(with_units) >= 9
    read = load_scenario(written(case, tmp_path / "mixed.toml", with_units))
    assert read.units == case.units
    found, expected = read.dimensionless(), case.dimensionless()
    assert_allclose([found[key] for key in expected], [*expected.values()], rtol=1e-12)
    for key, text in texts.items():
        assert case.with_overrides({key: text}).values()[key] == pytest.approx(case.values()[key], rel=1e-12), key


@pytest.mark.parametrize("name", ALIVE)
def test_every_key_refuses_a_wrong_unit(name: str):
    case = physical(name)
    assert case.units is not None
    for key in real_keys(case):
        right = case.units.label(dimension(key))
        wrong = case.units.label(dimension(key)._replace(length=dimension(key).length + 1))
        with pytest.raises(InputError) as caught:
            case.with_overrides({key: f"2.5 {wrong if wrong != '1' else 'um'}"})
        message = str(caught.value)
        assert message.startswith(f"{key} = '2.5 ")
        assert f"in {right}" in message or (right == "1" and "a pure number" in message)
        assert message.endswith(f"change {key}.")
        assert "\n" not in message


def raw(case: Scenario, monkeypatch: pytest.MonkeyPatch) -> Run:
    """A run that works with the numbers as they are, not with those in units of the scales."""
    with monkeypatch.context() as patch:
        patch.setattr(Scales, "of", lambda parameters, units=None: Scales(1.0, 1.0, 1.0))
        return ss.run(case)


@pytest.mark.parametrize(
    ("name", "elements"),
    [("guided-division", 20), ("membrane-protrusion", 20), pytest.param("vesicle", 40, marks=pytest.mark.slow)],
)
def test_declared_dimensions_are_those_of_the_equations(name: str, elements: int, monkeypatch: pytest.MonkeyPatch):
    """Solved in two sets of units without any scales in between, every observable changes as its dimension says."""
    sizes = {"length": 1.25, "energy": 0.8, "time": 0.9, "concentration": 1.1}
    case = ss.scenario(name, dt=1e-3, until=2e-3, elements=elements, **ALIVE[name])
    other = case.in_units(
        length="1.25 um", energy="0.8 pN um", time="0.9 s", concentration="1.1/um^2"
    )  # fmt: skip
    keys = {key for key in real_keys(case) if any(dimension(key)) and case.values()[key] != 0.0}
    assert {"spontaneous_curvature", "friction", "shear_viscosity", "dt", "until"} < keys
    one, two = (raw(each, monkeypatch).observables for each in (case, other))
    assert one.keys() == two.keys()
    assert one["dissipation"] > 0.0
    for key, value in one.items():
        factor = np.prod([sizes[base] ** power for base, power in dimension(key)._asdict().items()])
        if key not in ("discretisation_error", "boundary_residual", "energy_residual"):
            scale = abs(one["dissipation"]) if dimension(key) == dimension("dissipation") else 1.0
            assert two[key] == pytest.approx(factor * value, rel=1e-5, abs=1e-7 * scale), key


def test_results_come_in_the_units_of_the_file(tmp_path: Path):
    """Observables, data, store: the same experiment in two systems; labels, and what any reader can convert."""
    one = physical("guided-division")
    runs = [ss.run(case, out=tmp_path / str(n)) for n, case in enumerate((one, one.in_units(**OTHER)))]
    from pint import UnitRegistry

    registry = UnitRegistry()
    for key in ("height", "pressure", "tension_pole", "max_concentration", "energy_rate", "time", "bending_energy"):
        a, b = (registry.Quantity(float(run.dataset[key][-1]), run.dataset[key].attrs["units"]) for run in runs)
        assert a.to(b.units).magnitude == pytest.approx(b.magnitude, rel=1e-9), key
    assert runs[0].dataset["tangential_velocity"].attrs["units"] == "um/s"
    assert runs[0].dataset["pressure"].attrs["units"] == "pN nm/um^3"
    manifest = json.loads((tmp_path / "0" / "store.json").read_text())
    assert manifest["units"]["active_tension"] == "pN nm/um^2"
    assert manifest["scenario"]["units"] == {"length": "um", "energy": "pN nm", "time": "s", "concentration": "1/um^2"}
    with pytest.raises(ss.StoreError, match=r"units are um, pN nm, s, 1/um.2, not nm, zJ, ms, 1/nm.2"):
        ss.run(one.in_units(**OTHER), out=tmp_path / "0", resume=True)


def test_the_command_line(shell: Shell, tmp_path: Path):
    file, out = tmp_path / "cell.toml", tmp_path / "out"
    units = [word for name, size in CELLS.items() for word in ("--units", f"{name}={size}")]
    assert shell("config", "guided-division", "--out", str(file), *units)[0] == 0
    assert_allclose(
        [*load_scenario(file).dimensionless().values()], [*ss.scenario("guided-division").dimensionless().values()], rtol=1e-11
    )  # fmt: skip
    run = ["run", str(file), "--out", str(out), "-s", "elements=20"]
    for bad, complaint in (
        ("tension=9 pN", "tension = '9 pN': must be in pN nm/um^2, or in a unit of the same kind"),
        ("until=3 um", "until = '3 um': must be in s"),
        ("tension=9 furz", "tension = '9 furz': 'furz' is no unit"),
    ):
        assert complaint in one_complaint(shell(*run, "-s", bad))
        assert not out.exists()
    status, printed, _ = shell(*run, "-s", "tension=0.8 nN/m", "--until", "30 ms", "--json")
    assert status == 0
    observables = json.loads(printed)["observables"]
    assert observables["time"] == pytest.approx(0.03)
    assert observables["volume"] == pytest.approx(4.0 / 3.0 * np.pi * 1e3, rel=1e-6)
    assert "um" in shell(*run, "--until", "30 ms", "-s", "tension=0.8 nN/m", "--resume")[1]


DECLARATIONS = [
    ({}, "length: is missing from"),
    ({"length": "um", "energy": "pN", "time": "s"}, "energy = 'pN': is no unit of energy"),
    ({"length": "um", "energy": "pN nm", "time": "s", "mass": "kg"}, "mass = 'kg': is no unit that a file declares"),
    ({"length": "10 um", "energy": "pN nm", "time": "s"}, r"length = '10 um': .*10 is no unit with a power"),
    ({"length": 1.0, "energy": "pN nm", "time": "s"}, "length = 1.0: must be a unit as text"),
    ({"length": "um", "energy": "pN/nm/s", "time": "s"}, "energy = 'pN/nm/s': "),
]


@pytest.mark.parametrize(("stated", "message"), DECLARATIONS)
def test_bad_declarations_are_named(stated: dict[str, object], message: str):
    with pytest.raises(InputError, match=message) as caught:
        Units.declare(stated)
    assert "\n" not in str(caught.value)


def test_values_with_units_need_units():
    with pytest.raises(InputError, match=r"tension = '9 pN/um': must be a number, as this scenario declares no units"):
        ss.scenario("guided-division", tension="9 pN/um")
    without = ss.scenario("guided-division").in_units(length="um", energy="pN um", time="s")
    with pytest.raises(InputError, match=r"reference_concentration = '3 nM': .* declares no unit"):
        without.with_overrides({"reference_concentration": "3 nM"})
    assert without.scales.unit("max_concentration") == "concentration"


def test_texts_of_units():
    for text in ("pN s/(nm um)", "pN*s/(nm*um)", "pN·s/(nm·um)", "pN s nm^-1 um**-1"):
        assert read_factors(text) == {"pN": 1, "s": 1, "nm": -1, "um": -1}
    assert read_factors("1/um²") == read_factors("/um^2") == {"um": -2}
    units = Units.declare({"length": "um", "energy": "pN*um", "time": "s"})
    assert units.label(Dimension(-2, 1, 1)) == "pN s/um"
    for text, value in (("20 kT", 0.0823), ("2e-3 pN um", 2e-3), (".5pN*um", 0.5), ("-1 aJ", -1.0)):
        assert units.read("bending_rigidity", text, Dimension(energy=1)) == pytest.approx(value, rel=1e-3)
    for text, printed in (("pN nm/um**2", "pN nm/μm^2"), ("uN/um", "μN/μm"), ("tau/fum", "tau/fum"), ("µs", "μs")):
        assert with_micro(text) == printed
    for text in ("9^9^9^9 pN", "2 pN um)", "2 um^999", "5 pN/(um", "2 3 pN um"):
        with pytest.raises(InputError, match=r"^bending_rigidity = "):
            units.read("bending_rigidity", text, Dimension(energy=1))


@pytest.mark.parametrize("name", ALIVE)
def test_both_ways_to_write_the_bending_energy(name: str, tmp_path: Path):
    """kappa_H (H - C)^2 is kappa/2 (2H - C0)^2 with kappa_H = 2 kappa and C = C0/2; the store says so."""
    case = ss.scenario(name, bending_rigidity=1.7, spontaneous_curvature=0.6, elements=20, dt=1e-3, until=1e-3)
    other = case.with_overrides({"mean_curvature_rigidity": 3.4, "spontaneous_mean_curvature": 0.3})
    assert "bending_rigidity" not in dict(other.given)
    assert other.dimensionless() == case.dimensionless()
    assert other.values() == case.values()
    ss.run(other, out=tmp_path / "run")
    manifest = json.loads((tmp_path / "run" / "store.json").read_text())
    assert "kappa_H (H - C)^2" in manifest["conventions"]
    stored = manifest["scenario"]["parameters"]
    assert (stored["bending_rigidity"], stored["mean_curvature_rigidity"]) == (1.7, 3.4)
    with pytest.raises(InputError, match="state one thing twice"):
        case.with_overrides({"mean_curvature_rigidity": 3.4, "bending_rigidity": 1.0})


def test_units_cost_nothing_where_there_are_none():
    code = "import sys, shapespace as ss; ss.scenario('vesicle').scales.unit('area'); assert 'pint' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
