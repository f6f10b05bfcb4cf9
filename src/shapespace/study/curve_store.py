"""Curves of special points in two keys: in memory, or in a directory like that of a branch."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import START, AbstractPathStore
from shapespace.study.frame import Array, Frame, Layout
from shapespace.study.presenting import Plotted, Summary
from shapespace.study.scenario import Scenario

PIECES = 16
"""Straight pieces between neighbours of a drawn curve."""


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A fold or branch point on its curve in two keys of a scenario.

    frame: the state, at time zero, with its observables. parameters (2,): values of the keys, with estimated errors, NaN where
    they are not known. unfolding: of a branch point, zero where branches cross. of: what the curve consists of. arclength, step,
    sign: as on a branch. tangent (n + 2,) or (n + 3,): of (state, first key, unfolding of a branch point, second key).
    kernel (1, n) or (2, n + 1), across: of the defining system. directions (1, n + 1) or (2, n + 1): tangents of the branches in
    the first key, the one along it first. label, kind: of special points, else empty. is_step, ends, missed: as on a branch.
    """

    frame: Frame
    parameters: Array
    parameter_errors: Array
    unfolding: float
    of: str
    arclength: float
    step: float
    test: float
    tangent: Array
    kernel: Array
    across: Array
    directions: Array
    leg: int = 0
    label: str = ""
    kind: str = ""
    is_step: bool = True
    ends: str = ""
    missed: tuple[dict[str, Any], ...] = field(default=())

    @property
    def observables(self) -> dict[str, float]:
        """In the scenario's units."""
        return self.frame.observables

    @property
    def place(self) -> float:
        """Arclength, negative on the leg that goes back."""
        return -self.arclength if self.leg else self.arclength

    @property
    def slope(self) -> Array:
        """Change of both keys (2,) per length in the order of the curve."""
        first = self.kernel.shape[1] - (len(self.kernel) - 1)
        return np.array([self.tangent[first], self.tangent[-1]]) * (-1.0 if self.leg else 1.0)

    @property
    def on_branch(self) -> BranchPoint:
        """The same as a point of the branch in the first key."""
        return BranchPoint(
            frame=self.frame,
            parameter=float(self.parameters[0]),
            parameter_error=float(self.parameter_errors[0]),
            arclength=0.0,
            step=self.step,
            test=np.nan,
            tangent=self.directions[0],
            directions=self.directions if len(self.directions) == 2 else np.zeros((0, 0)),
            growth_rates=np.zeros((0, 2)),
            growth_rate_errors=np.zeros(0),
            next_shift=0.0,
            label=self.label,
            kind=self.of,
        )


_LAYOUT = Layout(
    block="curve",
    numbers=("unfolding", "arclength", "step", "test"),
    arrays=("parameters", "parameter_errors", "tangent", "kernel", "across", "directions"),
    words=("of", "leg", "label", "kind", "is_step", "ends", "missed"),
)


def _decode(data: bytes) -> CurvePoint:
    values = _LAYOUT.decode(data)
    return CurvePoint(**{**values, "missed": tuple(values["missed"])})


class CurveStore(AbstractPathStore[CurvePoint]):
    """The points of one curve. `create` and `resume` give a store to write, `open` one to read.

    The manifest's entry `curve` says which curve: keys, of (what it consists of), origin, start, stop, at.
    """

    noun = "curve"
    note = "arrays of states are dimensionless, in units of the scales; parameters and observables are in the scenario's units"

    encode = staticmethod(_LAYOUT.encode)
    decode = staticmethod(_decode)


@dataclass(frozen=True)
class Curve(Plotted):
    """Folds or branch points of a scenario along a change of two keys, in the order of the curve, special ones included.

    of: fold, pitchfork, transcritical or branch-point. detail: of a curve that could not be begun, why.
    """

    outcome: Outcome | None
    scenario: Scenario
    keys: tuple[str, str]
    of: str
    points: tuple[CurvePoint, ...]
    store: Path | None = None
    detail: str = ""

    @property
    def special_points(self) -> tuple[CurvePoint, ...]:
        """Cusps and other special points, user points and ends, in the order of the curve."""
        return tuple(point for point in self.points if point.label and point.label != START)

    def summary(self) -> Summary:
        """Keys, special points, and the plane."""
        facts = {
            "of": f"{self.of} in the plane of {' and '.join(self.keys)}",
            "outcome": str(self.outcome or "unfinished"),
            "points": str(len(self.points)),
            "store": str(self.store or "in memory"),
        }
        rows: list[tuple[str, ...]] = [("label", *self.keys)]
        rows += [(point.label, *(f"{value:.8g}" for value in point.parameters)) for point in self.special_points]
        title = f"Curve of {self.scenario.name}"
        return Summary(title, facts, {"special points": rows}, is_drawn=len(self.points) > 1)

    @property
    def missed(self) -> tuple[dict[str, Any], ...]:
        """Brackets between neighbours in which something lies that was not found."""
        return tuple(one for point in self.points for one in point.missed)

    def __getitem__(self, label: str) -> CurvePoint:
        """The point of a label; InputError lists the labels where there is none."""
        for point in self.points:
            if label and point.label == label:
                return point
        labels = ", ".join(point.label for point in self.points if point.label)
        raise InputError(f"{label}: is no label of this curve; choose one of {labels}.")

    def scenario_at(self, point: CurvePoint) -> Scenario:
        """The scenario whose stationary state a point is."""
        return self.scenario.with_overrides(dict(zip(self.keys, point.parameters.tolist(), strict=True)))


def open_curve(path: str | Path) -> Curve:
    """A stored curve, finished or not. StoreError where there is none, or nothing in it yet."""
    store = CurveStore.open(path)
    if not len(store):
        raise StoreError(f"{path}: holds no point yet; continue the curve with --resume.")
    first, second = store.request["keys"]
    return collected(store.scenario, (first, second), [*store], store.outcome, store.path)


def collected(
    scenario: Scenario,
    keys: tuple[str, str],
    points: Sequence[CurvePoint],
    outcome: Outcome | None,
    store: Path | None,
    detail: str = "",
) -> Curve:
    """A curve from its points in the order in which they were computed."""
    ordered = tuple(sorted(points, key=lambda point: point.place))
    return Curve(outcome, scenario, keys, points[0].of if points else "", ordered, store, detail)


def outline(points: Sequence[CurvePoint]) -> Array:
    """The keys (2, m) along a curve, by cubics through neighbours with their tangents, so that a cusp looks like one."""
    # Imported late: most readers of curves draw none.
    from scipy.interpolate import CubicHermiteSpline

    kept = [one for one, other in pairwise(points) if other.place > one.place] + [points[-1]]
    if len(kept) == 1:
        return kept[0].parameters[:, None]
    places = np.array([point.place for point in kept])
    spline = CubicHermiteSpline(places, [point.parameters for point in kept], [point.slope for point in kept])
    fine = np.interp(np.arange(PIECES * (len(kept) - 1) + 1) / PIECES, np.arange(len(kept)), places)
    return np.asarray(spline(fine).T)
