"""Two laws written with the public interface, against closed forms: area elasticity, and drag along the normal.

The tension K (c0/c - 1) is a passive one of slope z = -K/c0 in c (`closed_forms`). Drag along the normal opposes the force F
on a mode: da/dt = M (F - Gamma_n da/dt), so that its mobility M becomes M/(1 + Gamma_n M).
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import StoreError
from shapespace.cli import main
from shapespace.modelling import Parameter, define_model, define_scenario, dissipation, energy
from shapespace.study.keys import MODELS
from shapespace.study.plugins import import_file
from shapespace.study.scenario import Scenario, load_scenario

pytestmark = pytest.mark.usefixtures("own_models")

LAWS = """
from shapespace.modelling import Parameter, define_model, define_scenario, dissipation, energy


@energy
def area_elasticity(concentration, area_modulus, reference_concentration):
    stretch = reference_concentration / concentration
    return 0.5 * area_modulus * (stretch - 1) ** 2 / stretch


@dissipation("friction")
def normal_drag(normal_velocity, normal_friction):
    return normal_friction * normal_velocity**2


define_model(
    "elastic-cortex",
    like="closed-surface",
    laws=[area_elasticity, normal_drag],
    parameters={
        "area_modulus": Parameter("K", "area modulus", "E/L^2", default=2.0, least=0.0),
        "normal_friction": Parameter("Gamma_n", "friction along the normal", "E T/L^4", default=0.0, least=0.0),
    },
)
define_scenario("elastic-swimmer", "A swimmer with an elastic cortex", "elastic-cortex", like="polar-swimmer", peclet=0.0)
"""


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    path = tmp_path / "elastic.py"
    path.write_text(LAWS)
    return path


def resting(**keys: float) -> Scenario:
    return ss.scenario("elastic-swimmer", **{"peclet": 0.0, "elements": 20, "shear_viscosity": 0.8, **keys})


def shape_mobility(v: dict[str, float], l: int) -> tuple[float, float]:
    """M with Gamma_n = 0, and the stiffness s of the tension gamma: da/dt = -M s a."""
    g = l * (l + 1) / ((l - 1) * (l + 2) * v["shear_viscosity"] + v["friction"])
    return 0.25 * (1.0 / v["bulk_viscosity"] + g), (l - 1) * (l + 2) * (v["tension"] + l * (l + 1))


def test_growth_rates_of_the_elastic_sphere(plugin: Path):
    """Both eigenvalues of each l, coupled by the elasticity, to 1e-6."""
    assert main(["--import", str(plugin), "scenarios"]) == 0
    case = resting(area_modulus=3.0, turnover_rate=2.0)
    v, z = case.values(), -3.0
    expected = [-v["turnover_rate"], z - 2.0 - v["turnover_rate"]]
    for l in (2, 3):
        mobility, s = shape_mobility(v, l)
        q = l * (l + 1) + v["turnover_rate"]
        matrix = np.array([[-mobility * s, -0.5 * z], [0.5 * s, z - q]])
        expected += np.linalg.eigvals(matrix).real.tolist()
    rates = [real for real, _ in ss.steady(case, state="trivial").rates(4).values]
    np.testing.assert_allclose(rates, sorted(expected, reverse=True)[:4], rtol=1e-6)


def test_growth_rates_with_drag_along_the_normal(plugin: Path):
    main(["--import", str(plugin), "scenarios"])
    case = resting(area_modulus=0.0, normal_friction=30.0, turnover_rate=40.0)
    v = case.values()
    expected = []
    for l in (2, 3, 4):
        mobility, s = shape_mobility(v, l)
        expected.append(-mobility * s / (1.0 + 30.0 * mobility))
    rates = [real for real, _ in ss.steady(case, state="trivial").rates(4).values]
    np.testing.assert_allclose(rates[:3], expected, rtol=1e-6)


def test_dynamics_of_a_law_keep_the_energy_law_and_come_from_a_file(plugin: Path, tmp_path: Path):
    """run, config, a scenario file, plot and a missing --import, from the command line."""
    out, file = tmp_path / "out", tmp_path / "mine.toml"
    load = ["--import", str(plugin)]
    assert main([*load, "config", "elastic-swimmer", "--out", str(file)]) == 0
    assert load_scenario(file).values()["area_modulus"] == 2.0
    keys = ["-s", "peclet=60", "seed_amplitude=0.3", "normal_friction=0.5", "elements=20", "time_tolerance=1e-5"]
    assert main(["run", str(file), *load, *keys, "--until", "0.02", "--out", str(out)]) == 0
    late = ss.open_dataset(out).isel(time=slice(-5, None))
    assert float(np.abs(late["energy_residual"] / late["dissipation"]).max()) < 1e-2
    assert float(np.abs(late["energy_rate"] / late["dissipation"]).min()) > 1e-2, (
        "no energy is stored: nothing is tested"
    )
    assert main([*load, "plot", str(out)]) == 0
    del MODELS["elastic-cortex"]
    with pytest.raises(StoreError, match=r"model = 'elastic-cortex': is unknown.* needs --import FILE"):
        ss.open_dataset(out)
    assert main(["--import", str(tmp_path / "none.py"), "scenarios"]) == 2


def test_branch_in_a_parameter_of_ones_own(plugin: Path):
    """The sphere polarizes where c0 (z_active - K/c0)/eta_b = 2 D/R^2 + k: its pitchfork in K, to the error given."""
    main(["--import", str(plugin), "scenarios"])
    found = ss.branch(
        resting(peclet=24.0, area_modulus=0.2), "area_modulus", 2.0, start=0.2, state="trivial", stability=False
    )
    forks = [point.parameter for point in found.special_points if point.kind == "pitchfork"]
    np.testing.assert_allclose(forks, [24.0 * 0.5 - 2.0 - 9.0], rtol=1e-7)


def test_a_process_of_its_own_knows_what_was_imported(plugin: Path):
    """As the workers of a diagram do, by the environment."""
    import_file(plugin)
    code = "import shapespace as ss; print(ss.scenario('elastic-swimmer').values()['area_modulus'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "2.0"


def test_bad_definitions_are_named():
    @energy
    def law(radius, modulus):
        return modulus + 0.0 * radius

    one = {"modulus": Parameter("m", "modulus", "E/L^2", 1.0)}
    with pytest.raises(ValueError, match="'cell': is no shipped model"):
        define_model("mine", like="cell", laws=[law], parameters=one)
    with pytest.raises(ValueError, match="'vesicle': is a shipped model; choose another name"):
        define_model("vesicle", like="vesicle", laws=[law], parameters=one)
    with pytest.raises(ValueError, match="tension: is a parameter of closed-surface already"):
        define_model("mine", "closed-surface", [law], {"tension": Parameter("g", "tension", "E/L^2", 1.0)})
    with pytest.raises(ValueError, match="area: is area elsewhere, of another unit"):
        define_model("mine", "closed-surface", [law], {"area": Parameter("a", "area", "E", 1.0)})
    with pytest.raises(ValueError, match="'Activity': the model has no such term; it has HelfrichBending"):
        define_model("mine", "closed-surface", [law], one, without=["Activity"])
    with pytest.raises(ValueError, match="surplus"):
        define_model("mine", "closed-surface", [law], one, ends={"w": (None, None)})
    with pytest.raises(ValueError, match="is no law; make it one with @energy"):
        define_model("mine", "closed-surface", [law.function], one)
    with pytest.raises(ValueError, match="'mine': is not defined"):
        define_scenario("s", "S", "mine", "polar-swimmer")

    @dissipation("friction")
    def push(normal_velocity, modulus):
        return modulus * normal_velocity**2

    with pytest.raises(ValueError, match="push: its unit is not"):
        define_model("mine", "closed-surface", [push], one)
