"""States and special points that a benchmark needs, or why there is none."""

from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import Branch
from shapespace.study.steady import Steady


class Absent(Exception):
    """What a benchmark measures was not found."""


def found_state(state: Steady) -> Steady:
    """The state, which must have been found."""
    if state.outcome is not Outcome.CONVERGED:
        raise Absent(f"{state.outcome}: {state.nearest}")
    return state


def special_point(branch: Branch, kind: str, number: int = 0) -> BranchPoint:
    """A special point of a branch by its kind and its place among those."""
    points = [point for point in branch.special_points if point.kind == kind]
    if len(points) <= number:
        raise Absent(f"the branch has {len(points)} points of the kind {kind}; it ended so: {branch.outcome}.")
    return points[number]
