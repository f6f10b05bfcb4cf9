"""What is worth knowing along a branch: stability at every point, special points between them, and physical ends."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from shapespace.analysis.beside import AT_POINT, AWAY
from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.branch import Point, metric
from shapespace.analysis.passage import Hopf, growing_pairs, locate_hopf, point_between
from shapespace.analysis.stability import Disc, Spectrum
from shapespace.analysis.tracing import Located, Missed, singular_points
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.study.branch_point import BranchPoint
from shapespace.study.branch_store import START
from shapespace.study.course import Course
from shapespace.study.engine import frame_of
from shapespace.study.keyed import HeldProblem, KeyedProblem
from shapespace.study.observables import shape_end
from shapespace.study.scenario import Scenario
from shapespace.study.spectra import spectrum_at
from shapespace.study.steady import Rates, observables_at

HOPF, CHANGE = "hopf", "stability-change"
"""Kinds besides those of singular points: a pair of rates crosses the axis; the count of growing modes is not explained."""
AT_START = 1e-6
"""A special point on the first step whose key differs less from that of the start, relative to it (or one), is the start."""


def physical_end(point: Point) -> Outcome | None:
    """Why no physical shape lies beyond a point, if so."""
    assert isinstance(point.problem, KeyedProblem | HeldProblem)
    return shape_end(point.problem.base, point.problem.surface(point.x))


class Surveyor:
    """Makes the records of a branch: each point with its growth rates, and the special points on the way to it."""

    def __init__(self, scenario: Scenario, course: Course, stability: bool, done: Sequence[BranchPoint]) -> None:
        self.scenario, self.course, self.stability = scenario, course, stability
        self.outcome = Outcome.MAX_STEPS
        self._leg = 0
        self._numbers = Counter(point.kind for point in done if point.label)
        self._near: Spectrum | None = None
        self._last: Spectrum | None = None
        self._ahead: tuple[Point, Spectrum | None] | None = None
        self._missed: list[dict[str, Any]] = []
        self._stored = 0
        self._beyond: int | None = None

    def begin(self, leg: int, done: Sequence[BranchPoint]) -> None:
        """Go on with a leg after the points that are there."""
        self._leg = leg
        steps = [i for i, point in enumerate(done) if point.is_step and (point.leg == leg or point.label == START)]
        last = done[steps[-1]]
        self._near = self._spectrum_of(last)
        met = done[steps[-1] - 1]
        beyond = met.n_unstable_before if leg else met.n_unstable_after
        is_met = not met.is_step and met.kind in {*Kind} and _is_at(met.parameter, last.parameter)
        self._last = _counting(self._near, beyond if is_met else None)
        self._stored = len([point for point in done[steps[-1] + 1 :] if point.leg == leg])

    def start(self, point: Point, began: str) -> BranchPoint:
        """The record of the first point."""
        return self._record(point, self._spectrum(point), label=START, kind=START, began=began)

    def end_of(self, point: Point) -> Outcome | None:
        """Why the branch ends before a point, if so."""
        assert isinstance(point.problem, KeyedProblem | HeldProblem)
        try:
            self.course.scenario_at(self.scenario, point.problem.key_value(point.x, point.p))
        except InputError:
            return Outcome.OUT_OF_RANGE
        return physical_end(point)

    def step(self, point: Point, ends: Outcome | None) -> BranchPoint:
        """The record of a point that continuation came to. ends: the outcome if it is the last."""
        spectrum = self._spectrum(point)
        self._last = _counting(spectrum, self._beyond)
        self._beyond = None
        missed, self._missed = tuple(self._missed), []
        label = self._label(point.label) if point.label else ""
        count = None if spectrum is None else spectrum.n_unstable
        around = {"n_unstable_before": count, "n_unstable_after": count} if label else {}
        return self._record(point, spectrum, label=label, kind=point.label, ends=ends or "", missed=missed, **around)

    def end(self, inside: Point, outside: Point, outcome: Outcome) -> BranchPoint:
        """The record of where a leg ends for another reason than its stop."""
        spectrum = self._spectrum(inside)
        count = None if spectrum is None else spectrum.n_unstable
        missed, self._missed = tuple(self._missed), []
        return self._record(
            inside,
            spectrum,
            label=self._label(outcome.value),
            kind=outcome.value,
            ends=outcome.value,
            missed=missed,
            is_step=False,
            parameter_error=abs(outside.parameter - inside.parameter),
            n_unstable_before=count,
            n_unstable_after=count,
        )

    def between(self, before: Point, after: Point, until: float = np.inf) -> list[BranchPoint]:
        """Records of the special points between two neighbours, as far as this arclength, that are not stored yet."""
        found: list[Located | Hopf] = []
        for one in singular_points(before, after):
            if isinstance(one, Missed):
                self._miss(one.bracket.kind, before, after, one.outcome)
            else:
                found.append(one)
        spectrum = self._spectrum(after)
        if self._last is not None and spectrum is not None:
            found += self._hopf(before, after, self._last, spectrum)
            self._explain(before, after, spectrum, found)
        placed = sorted(((_arclength(one, before, after), one) for one in found), key=lambda pair: pair[0])
        placed = [(place, one) for place, one in placed if place <= until and not _is_start(one, before)]
        counts = self._counts(before, after, placed, spectrum)
        records = [
            self._special(place, one, counts[i : i + 2]) for i, (place, one) in enumerate(placed) if i >= self._stored
        ]
        self._stored = 0
        return records

    def _counts(
        self, before: Point, after: Point, placed: Sequence[tuple[float, Located | Hopf]], spectrum: Spectrum | None
    ) -> list[int | None]:
        """Numbers of growing modes before, between and after special points at these arclengths."""
        if spectrum is None or self._last is None:
            return [None] * (len(placed) + 1)
        counts = [self._last.n_unstable]
        for (one, _), (other, _) in pairwise(placed):
            share = (0.5 * (one + other) - before.arclength) / (after.arclength - before.arclength)
            middle = point_between(before, after, share)
            counts.append(None if middle is None else self._solve(middle, spectrum).n_unstable)
        if placed and _meets(placed[-1][1], after):
            # The rate that vanishes there is counted neither way: look a little beyond.
            beyond = replace(after, x=after.x + AWAY * after.tangent[:-1], p=after.p + AWAY * after.tangent[-1])
            self._beyond = self._solve(beyond, spectrum).n_unstable
        return [*counts, spectrum.n_unstable if self._beyond is None else self._beyond]

    def _special(self, place: float, one: Located | Hopf, counts: list[int | None]) -> BranchPoint:
        if self._leg:
            counts = counts[::-1]
        around = {"n_unstable_before": counts[0], "n_unstable_after": counts[1], "is_step": False}
        if isinstance(one, Hopf):
            label = self._label(HOPF)
            point, error = one.point, one.parameter_error
            return self._record(point, one.spectrum, label=label, kind=HOPF, parameter_error=error, **around)
        singular, after = one.point, one.bracket.after
        kind = str(singular.kind)
        point = Point(
            singular.problem, singular.x, singular.p, singular.index, after.tangent, place, after.step, label=kind
        )
        directions = singular.directions if len(singular.directions) == 2 else np.zeros((0, 0))
        return self._record(
            point,
            self._spectrum(point),
            label=self._label(kind),
            kind=kind,
            directions=directions,
            parameter_error=singular.parameter_error,
            **around,
        )

    def _hopf(self, before: Point, after: Point, one: Spectrum, other: Spectrum) -> list[Located | Hopf]:
        """The Hopf point between two neighbours whose numbers of growing pairs differ while no pair meets on the axis."""
        if not (one.converged and other.converged) or growing_pairs(one) == growing_pairs(other):
            return []
        reals = [_growing_reals(spectrum) for spectrum in (one, other)]
        if abs(reals[0] - reals[1]) > 1:  # two real rates became a pair, or the other way round
            return []
        hopf = locate_hopf(before, after, (one, other), lambda place: self._solve(place, one))
        if hopf is None:
            self._miss(HOPF, before, after, Outcome.DIVERGED)
        return [hopf] if hopf is not None else []

    def _explain(self, before: Point, after: Point, spectrum: Spectrum, found: Sequence[Located | Hopf]) -> None:
        """Say where the number of growing modes changes by more than the special points explain."""
        if self._last is None or self._last.n_unstable is None or spectrum.n_unstable is None:
            return
        # A rate that vanishes at one of the two, as where a branch leaves another, may be counted at the other.
        most = abs(len(spectrum.neutral) - len(self._last.neutral))
        most += sum(2 if isinstance(one, Hopf) else 1 for one in found)
        is_told = any(one["parameter_before"] == before.parameter for one in self._missed)
        if abs(spectrum.n_unstable - self._last.n_unstable) > most and not is_told:
            self._miss(CHANGE, before, after, Outcome.NOT_REACHED)

    def _miss(self, kind: str, before: Point, after: Point, outcome: Outcome) -> None:
        self._missed.append(
            {
                "kind": kind,
                "parameter_before": before.parameter,
                "parameter_after": after.parameter,
                "outcome": outcome.value,
            }
        )

    def _label(self, kind: str) -> str:
        self._numbers[kind] += 1
        return f"{kind}-{self._numbers[kind]}"

    def _spectrum(self, point: Point) -> Spectrum | None:
        """The spectrum at a point, once; it tells where to look at the next one."""
        if not self.stability:
            return None
        if self._ahead is None or self._ahead[0] is not point:
            spectrum = self._solve(point, self._near)
            self._ahead = (point, spectrum)
            self._near = spectrum if spectrum.converged else self._near
        return self._ahead[1]

    def _solve(self, point: Point, near: Spectrum | None) -> Spectrum:
        assert isinstance(point.problem, KeyedProblem | HeldProblem)
        return spectrum_at(point.problem, point.x, point.p, near=near)

    def _spectrum_of(self, point: BranchPoint) -> Spectrum | None:
        """What a stored point keeps of its spectrum."""
        if not self.stability:
            return None
        unit = self.course.scenario_at(self.scenario, point.value).scales.factor("time")
        rates = point.growth_rates @ np.array([1.0, 1.0j]) * unit
        outcome = Outcome(point.spectrum)
        return Spectrum(
            outcome=outcome,
            rates=rates,
            modes=np.zeros((0, 0), np.complex128),
            errors=point.growth_rate_errors * unit,
            parities=point.parities,
            neutral=point.neutral,
            n_unstable=point.n_unstable,
            disc=Disc(0.0, 0.0),
            next_shift=point.next_shift,
            applications=0,
            factorisations=0,
        )

    def _record(self, point: Point, spectrum: Spectrum | None, **more: Any) -> BranchPoint:
        """A point with what is known of it; modes where it has a label."""
        problem = point.problem
        assert isinstance(problem, KeyedProblem | HeldProblem)
        surface, value = problem.surface(point.x), problem.key_value(point.x, point.p)
        at = self.course.scenario_at(self.scenario, value)
        known: dict[str, Any] = {"growth_rates": np.zeros((0, 2)), "growth_rate_errors": np.zeros(0), "next_shift": 0.0}
        if spectrum is not None:
            rates = Rates.of(spectrum, at)
            known = {
                "growth_rates": np.array(rates.values).reshape(-1, 2),
                "growth_rate_errors": np.array(rates.errors),
                "next_shift": spectrum.next_shift,
                "parities": tuple(rates.parities),
                "neutral": rates.neutral,
                "n_unstable": rates.n_unstable,
                "spectrum": spectrum.outcome.value,
            }
            if more["label"]:
                known["modes"] = spectrum.modes[:, : len(surface)]
        return BranchPoint(
            frame=frame_of(problem.base, surface, observables_at(at, problem.base, surface)),
            freed=None if self.course.free is None else value,
            parameter=point.parameter,
            arclength=point.arclength,
            step=point.step,
            test=point.test,
            tangent=point.tangent,
            leg=self._leg,
            **known,
            **more,
        )


def _counting(spectrum: Spectrum | None, beyond: int | None) -> Spectrum | None:
    """A spectrum with the number of growing modes that there are beyond a branch point."""
    return spectrum if spectrum is None or beyond is None else replace(spectrum, n_unstable=beyond)


def _meets(one: Located | Hopf, point: Point) -> bool:
    """Whether a special point is one of the branch's own points, as where it stops or ends at a branch point."""
    return isinstance(one, Located) and _is_at(one.point.parameter, point.parameter)


def _is_at(one: float, other: float) -> bool:
    return abs(one - other) <= AT_POINT * max(abs(other), 1.0)


def _growing_reals(spectrum: Spectrum) -> int:
    return int(np.count_nonzero((spectrum.rates.imag == 0.0) & (spectrum.rates.real > 0.0)))


def _is_start(one: Located | Hopf, before: Point) -> bool:
    """Whether a special point is where the branch starts: one that leaves a branch point need not find it again."""
    miss = abs(one.point.parameter - before.parameter)
    return before.arclength == 0.0 and miss <= AT_START * max(abs(before.parameter), 1.0)


def _arclength(one: Located | Hopf, before: Point, after: Point) -> float:
    """Of a special point, by its place along the chord of its neighbours."""
    if isinstance(one, Hopf):
        return one.point.arclength
    start = before.on(after.problem)
    chord, way = after.joined - start.joined, np.append(one.point.x, one.point.parameter) - start.joined
    weights = metric(after.problem, after.joined)
    share = np.clip((weights @ (chord * way)) / (weights @ chord**2), 0.0, 1.0)
    return float(start.arclength + share * (after.arclength - start.arclength))
