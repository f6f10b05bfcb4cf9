"""PyCont-Lite on Bratu's problem, as its own README states it: second differences, no Jacobian, tolerance 1e-10.

It is not among the project's dependencies; to compare: .venv/bin/pip install pycont-lite
"""

import time
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from shapespace.base.arrays import Array

MISSING = "PyCont-Lite is not installed: no comparison. To have it: pip install pycont-lite"
CELLS = 100


class PyContRun(NamedTuple):
    """points met, and the fold as far as it was located; seconds of processor time."""

    points: int
    fold: float
    seconds: float


def bratu_residual(u: Array, parameter: float) -> Array:
    """u'' + lambda exp(u) at the inner points (CELLS - 1,), u vanishing at both ends."""
    full = np.pad(u, 1)
    return np.asarray((full[:-2] - 2.0 * u + full[2:]) * CELLS**2 + parameter * np.exp(u))


def run_pycont(steps: int, longest: float) -> PyContRun | None:
    """So many steps each side of the fold, upwards from zero, nothing else detected; None where PyCont-Lite is absent."""
    if find_spec("pycont") is None:
        return None
    import pycont

    settings = {"initial_directions": "increase_p", "bifurcation_detection": False, "analyze_stability": False}
    start = time.process_time()
    found = pycont.arclengthContinuation(
        bratu_residual, np.zeros(CELLS - 1), 0.0, 1e-6, longest, 0.05, steps, settings, verbosity="off"
    )
    seconds = time.process_time() - start
    (fold,) = (event.p for event in found.events if event.kind == "LP")
    return PyContRun(sum(len(branch.p_path) for branch in found.branches), float(fold), seconds)
