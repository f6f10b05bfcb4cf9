"""States to start from: the last frame of a stored run, or a labelled point of a stored branch or curve."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from shapespace.base.errors import InputError, StoreError
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import open_branch
from shapespace.study.curve_store import open_curve
from shapespace.study.frame import Frame
from shapespace.study.keys import MODELS
from shapespace.study.records import noun_of
from shapespace.study.scenario import Scenario
from shapespace.study.store import RunStore


@dataclass(frozen=True)
class Start:
    """A stored state, and the scenario whose state it is.

    key, point: of a branch; a point of a curve as one of the branch in its first key. keys: that vary there.
    """

    text: str
    scenario: Scenario
    frame: Frame
    key: str | None = None
    point: BranchPoint | None = None
    keys: tuple[str, ...] = ()

    def placing(self, scenario: Scenario, changed: Collection[str]) -> Scenario:
        """The scenario at the point's values of the keys that vary along its branch or curve, but for those changed by hand."""
        rivals = {key: MODELS[self.scenario.model].rival_of(key) for key in self.keys}
        kept = [key for key in self.keys if key not in changed and rivals[key] not in changed]
        if not kept:
            return scenario
        self.check_fits(scenario)
        values = self.scenario.values()
        return scenario.with_overrides({key: values[key] for key in kept})

    def check_fits(self, scenario: Scenario) -> None:
        """InputError unless the state has the fields that the scenario computes with."""
        for name, mine, wanted in (
            ("model", self.scenario.model, scenario.model),
            ("azimuthal_flow", self.scenario.numerics.azimuthal_flow, scenario.numerics.azimuthal_flow),
        ):
            if mine != wanted:
                raise InputError(f"--from {self.text}: its {name} is {mine}, not {wanted}; choose another start.")


def find_start(text: str | Path) -> Start:
    """The state that `STORE` or `STORE:LABEL` names; without a label the last one. InputError where there is none."""
    path, label = Path(text), ""
    if ":" in str(text) and not path.is_dir():
        store, _, label = str(text).rpartition(":")
        path = Path(store)
    noun = noun_of(path)
    if noun == "branch":
        branch = open_branch(path)
        point = branch[label] if label else branch.points[-1]
        return Start(str(text), branch.scenario_at(point), point.frame, branch.key, point, (branch.key,))
    if noun == "curve":
        curve = open_curve(path)
        place = curve[label] if label else curve.points[-1]
        return Start(str(text), curve.scenario_at(place), place.frame, curve.keys[0], place.on_branch, curve.keys)
    run = RunStore.open(path)
    if label:
        raise InputError(f"--from {text}: a run has no labels; leave :{label} away to start from its last state.")
    if not len(run):
        raise StoreError(f"{path}: holds no time step yet; continue the run with --resume.")
    return Start(str(text), run.scenario, run.read(-1))
