"""Modes as results: how small perturbations of a state at rest look, which of them are neutral and why; stored, found again."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapespace.base.arrays import Array
from shapespace.base.errors import InputError, StoreError
from shapespace.numerics.state import State
from shapespace.study.branch_point import ComplexArray
from shapespace.study.engine import Engine, even_points, state_of
from shapespace.study.files import storage, write_atomically
from shapespace.study.frame import DAMAGE, Frame, read_arrays, write_arrays
from shapespace.study.scenario import Scenario
from shapespace.study.stored_starts import stored_start

MODES_FILE = "modes.npz"
"""In the directory of a state that `steady` stored."""
SAMPLES = 600
"""Points of a mode's profiles, unless others are asked for."""
CRITICAL = "critical"
"""Name of a neutral mode that no symmetry and no conservation law brings: the state is where stability changes."""


def neutral_modes(scenario: Scenario, neutral: Mapping[int, str]) -> list[dict[str, object]]:
    """Name, and place among the leading rates, of each neutral mode; no place where a condition of the problem holds it.

    neutral: name by place, empty where none is known.
    """
    held = Engine.of(scenario).system.held_symmetries
    found: list[dict[str, object]] = [{"name": name, "index": None} for name in held]
    return found + [{"name": name or CRITICAL, "index": place} for place, name in sorted(neutral.items())]


@dataclass(frozen=True, eq=False)
class ModeProfiles:
    """A mode along u (m,) of its state: amplitudes a of changes Re(a exp(s t)), s the growth rate; dimensionless.

    r, z, angle: of the state. displacement: x.n along the outward normal n = (sin psi, cos psi), in the moving frame.
    tangential, normal: velocities in the lab frame, the normal one s x.n + v0 n_z. regulator: concentration, if there is one.
    """

    u: Array
    r: Array
    z: Array
    angle: Array
    displacement: ComplexArray
    tangential: ComplexArray
    normal: ComplexArray
    regulator: ComplexArray | None


@dataclass(frozen=True, eq=False)
class Modes:
    """Leading modes (m, n) of a state of a scenario, with growth_rates (m, 2) and errors (m,) in its units.

    parities: symmetric, antisymmetric or None; neutral: names by place, empty where none is known.
    """

    scenario: Scenario
    frame: Frame
    growth_rates: Array
    errors: Array
    modes: ComplexArray
    parities: tuple[str | None, ...]
    neutral: dict[int, str]

    def mode(self, index: int) -> tuple[State, State]:
        """Real and imaginary part of a mode, as changes of all unknowns. InputError where there is none of this number."""
        if not 0 <= index < len(self.modes):
            last = f"0 to {len(self.modes) - 1}" if len(self.modes) else "one with growth rates"
            raise InputError(f"--mode {index}: is not stored; choose {last}.")
        base = Engine.of(self.scenario).problem.on_mesh(self.frame.mesh)
        return base.unpack(self.modes[index].real.copy()), base.unpack(self.modes[index].imag.copy())

    def profiles(self, index: int, points: int = SAMPLES) -> ModeProfiles:
        """A mode along the curve of its state, on points spread evenly over the elements. InputError as of `mode`."""
        real, imaginary = self.mode(index)
        engine, state = Engine.of(self.scenario), state_of(self.frame)
        column = {name: i for i, name in enumerate(engine.system.fields)}
        u = even_points(state.mesh, points)
        base, change = state.values(u), real.values(u) + 1j * imaginary.values(u)
        sin, cos = np.sin(base[:, column["psi"]]), np.cos(base[:, column["psi"]])
        displacement = change[:, column["r"]] * sin + change[:, column["z"]] * cos
        rate = complex(*self.growth_rates[index]) * self.scenario.scales.factor("time")
        scalars = engine.system.scalars
        i = scalars.index("v0") if "v0" in scalars else None
        swim = 0.0 if i is None else complex(real.scalars[i], imaginary.scalars[i])
        return ModeProfiles(
            u=u,
            r=base[:, column["r"]],
            z=base[:, column["z"]],
            angle=base[:, column["psi"]],
            displacement=displacement,
            tangential=change[:, column["v"]],
            normal=rate * displacement + swim * cos,
            regulator=change[:, column["c"]] if "c" in column else None,
        )


def store_modes(path: Path, modes: Modes) -> None:
    """Write modes beside the state in the directory of a store."""
    words = {"parities": modes.parities, "neutral": modes.neutral}
    arrays: dict[str, NDArray[Any]] = {
        "growth_rates": modes.growth_rates,
        "growth_rate_errors": modes.errors,
        "modes": modes.modes,
        "about": np.frombuffer(json.dumps(words).encode(), dtype=np.uint8),
    }
    with storage(path):
        write_atomically(path / MODES_FILE, write_arrays(arrays))


def find_modes(text: str) -> Modes:
    """The modes of a labelled point of a branch (`STORE:LABEL`), or of a state that `steady` stored (`STORE`)."""
    start = stored_start(text)
    point = start.point
    if point is not None:
        if not len(point.modes):
            raise InputError(f"{text}: has no modes; choose a labelled point of a branch followed with growth rates.")
        rates, errors, neutral = point.growth_rates, point.growth_rate_errors, point.neutral
        return Modes(start.scenario, start.frame, rates, errors, point.modes, point.parities, neutral)
    file = Path(text) / MODES_FILE
    if not file.is_file():
        raise InputError(f"{text}: has no modes; `shapespace steady --from {text} --out DIR` finds and stores them.")
    with storage(file):
        data = file.read_bytes()
    try:
        stored = read_arrays(data)
        about = json.loads(stored["about"].tobytes())
        neutral = {int(place): name for place, name in about["neutral"].items()}
        rates, errors, modes = (stored[name] for name in ("growth_rates", "growth_rate_errors", "modes"))
        return Modes(start.scenario, start.frame, rates, errors, modes, tuple(about["parities"]), neutral)
    except DAMAGE as error:
        raise StoreError(f"{file}: is damaged ({error}); store the state again with `shapespace steady`.") from None
