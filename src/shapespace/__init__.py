"""Dynamics, stationary shapes and shape spaces of axisymmetric active fluid surfaces.

import shapespace as ss

run = ss.run(ss.scenario("guided-division"), out="results/division")
run.dataset["neck_radius"]
ss.plot(run)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapespace.app.beside import explore as explore
    from shapespace.base.errors import InputError as InputError
    from shapespace.base.errors import StoreError as StoreError
    from shapespace.base.outcome import Outcome as Outcome
    from shapespace.study.branch_store import Branch as Branch
    from shapespace.study.branch_store import open_branch as open_branch
    from shapespace.study.branching import branch as branch
    from shapespace.study.curve_store import Curve as Curve
    from shapespace.study.curve_store import open_curve as open_curve
    from shapespace.study.curves import curve as curve
    from shapespace.study.dataset import open_dataset as open_dataset
    from shapespace.study.diagram_points import state_at as state_at
    from shapespace.study.diagram_store import Diagram as Diagram
    from shapespace.study.diagram_store import open_diagram as open_diagram
    from shapespace.study.diagrams import diagram as diagram
    from shapespace.study.run import Run as Run
    from shapespace.study.run import open_run as open_run
    from shapespace.study.run import run as run
    from shapespace.study.scenario import Scenario as Scenario
    from shapespace.study.scenario import load_scenario as load_scenario
    from shapespace.study.scenario import scenario as scenario
    from shapespace.study.scenario import scenario_names as scenario_names
    from shapespace.study.search_store import Search as Search
    from shapespace.study.search_store import open_search as open_search
    from shapespace.study.searching import search_states as search_states
    from shapespace.study.starts import find_start as find_start
    from shapespace.study.steady import Steady as Steady
    from shapespace.study.steady import steady as steady
    from shapespace.study.tables import stored_dataset as stored_dataset
    from shapespace.study.verification.table import verify as verify
    from shapespace.view.export import export as export
    from shapespace.view.show import movie as movie
    from shapespace.view.show import plot as plot

__version__ = "0.1.0"

_HOMES = {
    "InputError": "base.errors",
    "StoreError": "base.errors",
    "Outcome": "base.outcome",
    "Branch": "study.branch_store",
    "open_branch": "study.branch_store",
    "Curve": "study.curve_store",
    "open_curve": "study.curve_store",
    "curve": "study.curves",
    "branch": "study.branching",
    "Diagram": "study.diagram_store",
    "diagram": "study.diagrams",
    "open_diagram": "study.diagram_store",
    "state_at": "study.diagram_points",
    "open_dataset": "study.dataset",
    "Run": "study.run",
    "open_run": "study.run",
    "run": "study.run",
    "Scenario": "study.scenario",
    "load_scenario": "study.scenario",
    "scenario": "study.scenario",
    "scenario_names": "study.scenario",
    "Search": "study.search_store",
    "open_search": "study.search_store",
    "search_states": "study.searching",
    "find_start": "study.starts",
    "Steady": "study.steady",
    "steady": "study.steady",
    "verify": "study.verification.table",
    "explore": "app.beside",
    "export": "view.export",
    "stored_dataset": "study.tables",
    "movie": "view.show",
    "plot": "view.show",
}
__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """Public names, loaded on first use: `shapespace --help` should not wait for the array library."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # What comes through this door shows itself in notebooks.
    import_module(f"{__name__}.view.notebook")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
