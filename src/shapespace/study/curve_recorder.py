"""Points of curves as records, and records as points to go on from; where a curve ends for a physical reason."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shapespace.analysis.bifurcation import parameter_error
from shapespace.analysis.branch import Point
from shapespace.analysis.curves import NotFound, branches_at, is_unfolded, own_parameter, parameters_at, system_of
from shapespace.analysis.singular import SingularProblem
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_store import START
from shapespace.study.curve_store import CurvePoint
from shapespace.study.engine import frame_of, state_of
from shapespace.study.frame import Frame
from shapespace.study.keyed import KeyedProblem
from shapespace.study.landmarks import physical_end
from shapespace.study.scenario import Scenario
from shapespace.study.steady import observables_at


def _state(point: Point) -> Point:
    """The state at a point of a curve by itself."""
    system = system_of(point)
    return Point(system.base, system.state(point.x), parameters_at(point), system.index, np.zeros(0))


class Recorder:
    """Makes records of points and points of records. within: values of the first key; the curve ends where it leaves them."""

    def __init__(
        self,
        scenario: Scenario,
        keys: tuple[str, str],
        of: str,
        done: Sequence[CurvePoint],
        within: tuple[float, float] = (-np.inf, np.inf),
    ) -> None:
        self.scenario, self.keys, self.of = scenario, keys, of
        self.leg = 0
        self._within = within
        self._problem = KeyedProblem.of(scenario, keys)
        self._numbers = Counter(point.kind for point in done if point.label)
        self._missed: list[dict[str, Any]] = []

    def problem_on(self, frame: Frame) -> KeyedProblem:
        """The scenario's problem on the mesh of a frame; the same one as long as the mesh is the same."""
        if not np.array_equal(self._problem.base.mesh, frame.mesh):
            self._problem = replace(self._problem, base=self._problem.base.on_mesh(frame.mesh))
        return self._problem

    def at(self, point: Point) -> Scenario:
        """The scenario of a point; InputError where a key cannot have its value."""
        return self.scenario.with_overrides(dict(zip(self.keys, parameters_at(point).tolist(), strict=True)))

    def end(self, point: Point) -> Outcome | None:
        """Why the curve ends before a point, if so."""
        if is_unfolded(point):
            return Outcome.UNFOLDED
        try:
            self.at(point)
        except InputError:
            return Outcome.OUT_OF_RANGE
        if not self._within[0] <= own_parameter(point) <= self._within[1]:
            return Outcome.REACHED_STOP
        return physical_end(_state(point))

    def miss(self, one: NotFound) -> None:
        """Note a bracket in which nothing was found, for the next record."""
        ends = {"before": one.before, "after": one.after}
        values = {f"parameters_{name}": parameters_at(point).tolist() for name, point in ends.items()}
        self._missed.append({"kind": str(one.kind), **values})

    def record(
        self,
        point: Point,
        kind: str,
        errors: tuple[float, float] | None = None,
        ends: Outcome | None = None,
        is_step: bool = True,
    ) -> CurvePoint:
        """A point with what is known of it; where it has a kind, it has a label and an error of its parameters."""
        system, at = system_of(point), self.at(point)
        state = _state(point)
        assert isinstance(state.problem, KeyedProblem)
        self._numbers[kind] += 1
        label = kind if kind in ("", START) else f"{kind}-{self._numbers[kind]}"
        if errors is None:
            errors = (parameter_error(system, point.x, point.p), 0.0) if kind else (np.nan, np.nan)
        pair = (np.append(system.kernel[0], 0.0),) if system.is_fold else branches_at(point)
        missed, self._missed = tuple(self._missed), []
        return CurvePoint(
            frame=frame_of(state.problem.base, state.x, observables_at(at, state.problem.base, state.x)),
            parameters=state.p,
            parameter_errors=np.array(errors),
            unfolding=0.0 if system.is_fold else float(point.x[-1]),
            of=self.of,
            arclength=point.arclength,
            step=point.step,
            test=point.test,
            tangent=point.tangent,
            kernel=system.kernel,
            across=system.across,
            directions=np.stack(pair),
            leg=self.leg,
            label=label,
            kind=str(kind),
            is_step=is_step,
            ends="" if ends is None else ends.value,
            missed=missed,
        )

    def point(self, record: CurvePoint) -> Point:
        """A stored point as one to go on from."""
        base = self.problem_on(record.frame)
        x = base.base.pack(state_of(record.frame))
        scalars = [record.parameters[0]] if len(record.kernel) == 1 else [record.parameters[0], record.unfolding]
        system = SingularProblem(base, 0, record.kernel, record.across)
        return Point(
            system,
            np.append(x, scalars),
            record.parameters,
            1,
            record.tangent,
            record.arclength,
            record.step,
            record.test,
            label=record.kind,
        )
