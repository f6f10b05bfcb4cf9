"""States to start from: stored ones, and those of any point of a diagram, which are computed again."""

from itertools import pairwise
from pathlib import Path

from shapespace.study.branch_store import open_branch
from shapespace.study.manifests import noun_of
from shapespace.study.scenario import Scenario
from shapespace.study.search_store import open_search
from shapespace.study.stored_starts import Start, parts_of, stored_scenario, stored_start

__all__ = ["Start", "find_start", "find_starts", "stored_scenario"]


def find_start(text: str | Path) -> Start:
    """The state that `STORE` or `STORE:LABEL` names: one that is stored, as of `stored_start`, or a point of a diagram.

    That is `STATE,I,J`: the number of the state, and of the values along x and y, all from zero. InputError where there is none.
    """
    path, label = parts_of(text)
    if "," not in label or noun_of(path) != "diagram":
        return stored_start(text)
    # Imported late, as the others need neither the library of arrays on disk nor that of derivatives.
    from shapespace.study.diagram_state import DiagramStates
    from shapespace.study.diagram_store import DiagramStore

    store = DiagramStore.open(path)
    found = DiagramStates(store).state(store.request.place(label))
    return Start(str(text), found.scenario, found.frame, keys=store.request.grid.keys)


def find_starts(text: str | Path, scenario: Scenario) -> list[Start]:
    """All states that `STORE` or `STORE:LABEL` offers to a scenario; InputError where there is none, or none that fits.

    Of a search without a label all its states; of a branch its labelled points and, of neighbours with the scenario's value
    of the key between them, the nearer one.
    """
    path, label = parts_of(text)
    noun = noun_of(path)
    if label or noun not in ("branch", "search"):
        starts = [find_start(text)]
    elif noun == "search":
        starts = [find_start(f"{path}:{state.label}") for state in open_search(path).states]
    else:
        branch = open_branch(path)
        value = float(scenario.values().get(branch.key, float("nan")))
        chosen = {f"{path}:{point.label}": point for point in branch.points if point.label}
        for pair in pairwise(branch.points):
            if (pair[0].parameter - value) * (pair[1].parameter - value) <= 0.0:
                near = min(pair, key=lambda point: abs(point.parameter - value))
                chosen[f"{path} at {branch.key} = {near.parameter:.8g}, arclength {near.place:.6g}"] = near
        starts = [
            Start(name, branch.scenario_at(point), point.frame, branch.key, point, (branch.key,))
            for name, point in chosen.items()
        ]
    for start in starts:
        start.check_fits(scenario)
        start.check_units(scenario)
    return starts
