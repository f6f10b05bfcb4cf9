"""Stored states to start from: a frame of a run, a point of a branch or curve, a state of a search or of a diagram's tiles."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from shapespace.base.errors import InputError, StoreError
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import BranchStore, open_branch
from shapespace.study.curve_store import CurveStore, open_curve
from shapespace.study.frame import Frame
from shapespace.study.keys import MODELS
from shapespace.study.manifests import noun_of
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import Scenario
from shapespace.study.search_store import SearchStore, open_search
from shapespace.study.store import RunStore

R = TypeVar("R")


@dataclass(frozen=True)
class Start:
    """A stored state, and the scenario whose state it is.

    key, point: of a branch; a point of a curve as one of the branch in its first key. keys: of the scenario that
    change there; where the key is an observable that the branch prescribes, the one that answers.
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
        self.check_units(scenario)
        values = self.scenario.values()
        return scenario.with_overrides({key: values[key] for key in kept})

    def check_units(self, scenario: Scenario) -> None:
        """InputError where values of keys would change their meaning; a scenario without units takes those of the state."""
        if scenario.units is not None and scenario.units != self.scenario.units:
            raise InputError(
                f"--from {self.text}: was computed in other units than {scenario.name} declares; give one in the same."
            )

    def check_fits(self, scenario: Scenario) -> None:
        """InputError unless the state has the fields that the scenario computes with."""
        for name, mine, wanted in (
            ("model", self.scenario.model, scenario.model),
            ("azimuthal_flow", self.scenario.numerics.azimuthal_flow, scenario.numerics.azimuthal_flow),
        ):
            if mine != wanted:
                raise InputError(f"--from {self.text}: its {name} is {mine}, not {wanted}; choose another start.")


def stored_start(text: str | Path) -> Start:
    """The state that `STORE` or `STORE:LABEL` names; without a label the last one, but of a search and a diagram none.

    A number as label is that of the record, from zero: a frame of a run, a point of a branch or a curve. In a diagram
    `STATE-N`, with the name of the state, is one in the middle of tile N. InputError where there is none.
    """
    path, label = parts_of(text)
    if not path.is_dir():
        raise StoreError(
            f"--from {text}: is not a directory with stored states; give one that a command made, or STORE:LABEL."
        )
    noun = noun_of(path)
    if noun == "diagram":
        return _of_diagram(str(text), path, label)
    if noun == "search":
        search = open_search(path)
        frame = search[label].frame
        assert frame is not None
        return Start(str(text), search.scenario, frame)
    if noun == "branch":
        branch = open_branch(path)
        point = _numbered(BranchStore, path, label) or (branch[label] if label else branch.points[-1])
        return Start(str(text), branch.scenario_at(point), point.frame, branch.key, point, (branch.free or branch.key,))
    if noun == "curve":
        curve = open_curve(path)
        place = _numbered(CurveStore, path, label) or (curve[label] if label else curve.points[-1])
        return Start(str(text), curve.scenario_at(place), place.frame, curve.keys[0], place.on_branch, curve.keys)
    run = RunStore.open(path)
    if label and not label.isdecimal():
        raise InputError(
            f"--from {text}: a run has no labels; give the number of a frame, or leave :{label} away to start from the last one."
        )
    if not len(run):
        raise StoreError(f"{path}: holds no time step yet; continue the run with --resume.")
    return Start(str(text), run.scenario, _numbered(RunStore, path, label) or run.read(-1))


def _numbered(kind: type[AbstractRecordStore[R]], path: Path, label: str) -> R | None:
    """The record whose number the label is; None where it is no number."""
    if not label.isdecimal():
        return None
    try:
        return kind.open(path).read(int(label))
    except IndexError as error:
        raise InputError(f"--from {path}:{label}: {error}") from None


def _of_diagram(text: str, path: Path, label: str) -> Start:
    """The state in the middle of a tile of a diagram, with the scenario there."""
    # Imported late, as the others need neither the library of arrays on disk nor that of derivatives.
    from shapespace.study.diagram_store import DiagramStore
    from shapespace.study.engine import Engine, frame_of

    store = DiagramStore.open(path)
    grid = store.request.grid
    if "," in label:
        raise InputError(
            f"{text}: is not stored but computed again; store it by `shapespace steady {path} --from {text} --out DIR`."
        )
    known = {f"{anchors.state}-{i}": (anchors, i) for anchors in store for i, x in enumerate(anchors.xs) if len(x)}
    if label not in known:
        raise InputError(
            f"--from {text}: is no state of this diagram; give a point of it as STATE,I,J, e.g. 0,0,0, or one of its tiles: "
            f"{', '.join(known) or 'none has a state'}."
        )
    anchors, i = known[label]
    x, y = grid.values(*store.request.places[i]).ravel().tolist()
    scenario = store.scenario.with_overrides({grid.x.key: x, grid.y.key: y})
    problem = Engine.of(scenario).problem.on_mesh(anchors.meshes[i])
    return Start(text, scenario, frame_of(problem, anchors.xs[i], {}), keys=grid.keys)


def stored_scenario(path: str | Path) -> Scenario:
    """The scenario that a store was computed with; of a branch, a curve and a diagram without the values that vary."""
    # Imported late, as above.
    from shapespace.study.diagram_store import DiagramStore

    noun = noun_of(Path(path))
    kinds = (RunStore, BranchStore, CurveStore, SearchStore, DiagramStore)
    # What cannot be told is opened as a run, which says in a line what is wrong with it.
    kind = next((one for one in kinds if one.noun == noun), RunStore)
    return kind.open(path).scenario


def parts_of(text: str | Path) -> tuple[Path, str]:
    """The directory and the label."""
    path = Path(text)
    if ":" in str(text) and not path.is_dir():
        store, _, label = str(text).rpartition(":")
        return Path(store), label
    return path, ""
