"""Stationary states of a scenario, with what is to be known of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from shapespace.analysis.stability import Spectrum
from shapespace.analysis.stationary import Stationary
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.engine import Engine, frame_of, state_of
from shapespace.study.frame import Frame
from shapespace.study.keyed import KeyedProblem
from shapespace.study.modes import Modes
from shapespace.study.named import followed, named_state
from shapespace.study.observables import energy_law, measure, shape_end
from shapespace.study.paths import StateName, read_state_name
from shapespace.study.presenting import Presented, Summary, quantities_table
from shapespace.study.scenario import Scenario
from shapespace.study.sensitivities import Sensitivities
from shapespace.study.settling import as_it_is, settle, settle_near
from shapespace.study.spectra import spectrum_at
from shapespace.study.starts import Start, find_start


@dataclass(frozen=True)
class Rates:
    """Leading growth rates of a state in its scenario's units, with what is known of them: see `Spectrum`.

    values: (real, imaginary), largest real part first. n_unstable: None where the rates did not converge.
    """

    outcome: Outcome
    values: list[tuple[float, float]]
    errors: list[float]
    parities: list[str | None]
    neutral: dict[int, str]
    n_unstable: int | None

    @classmethod
    def of(cls, spectrum: Spectrum, scenario: Scenario) -> Self:
        """From a dimensionless spectrum."""
        unit = scenario.scales.factor("time")
        return cls(
            spectrum.outcome,
            [(rate.real / unit, rate.imag / unit) for rate in spectrum.rates.tolist()],
            (spectrum.errors / unit).tolist(),
            list(spectrum.parities),
            dict(spectrum.neutral),
            spectrum.n_unstable,
        )


@dataclass(frozen=True)
class Steady(Presented):
    """A stationary state of a scenario, or why there is none: `found.outcome`, with the best state met.

    detail: in words, what a search for a named state met.
    """

    scenario: Scenario
    problem: KeyedProblem
    found: Stationary
    detail: str = ""

    @property
    def outcome(self) -> Outcome:
        """How the search ended; a state that solves the equations may be the shape of no surface."""
        if self.found.outcome is not Outcome.CONVERGED:
            return self.found.outcome
        return shape_end(self.problem.base, self.found.x) or Outcome.CONVERGED

    @property
    def engine(self) -> Engine:
        """What the scenario computes with, on the state's mesh."""
        return replace(Engine.of(self.scenario), problem=self.problem.base)

    @cached_property
    def observables(self) -> dict[str, float]:
        """By their contract names, in the scenario's units."""
        return observables_at(self.scenario, self.problem.base, self.found.x)

    def summary(self) -> Summary:
        """How the search ended, observables, and the outline."""
        from shapespace.study.dataset import meridian_of

        facts = {"outcome": f"{self.outcome}: {self.outcome.advice}"}
        if not self.outcome.is_success:
            return Summary(f"No stationary state of {self.scenario.name}", facts | {"reached": self.nearest})
        tables = {"observables": quantities_table(self.scenario.scales, self.observables)}
        meridian = meridian_of(self.scenario, self.frame)
        return Summary(f"Stationary state of {self.scenario.name}", facts, tables, meridian)

    def spectrum(self, count: int = 6) -> Spectrum:
        """Leading growth rates and modes, dimensionless."""
        found = self.found
        # At a branch point Newton's method ends by round-off far from the state, and its rate is known no better.
        return spectrum_at(self.problem, found.x, found.p, count=count, state_error=found.correction)

    def rates(self, count: int = 6) -> Rates:
        """Leading growth rates in the scenario's units."""
        return Rates.of(self.spectrum(count), self.scenario)

    def modes(self, spectrum: Spectrum) -> Modes:
        """The modes of a spectrum of this state, to store and to draw."""
        rates = Rates.of(spectrum, self.scenario)
        return Modes(
            self.scenario,
            self.frame,
            np.array(rates.values).reshape(-1, 2),
            np.array(rates.errors),
            spectrum.modes,
            spectrum.parities,
            rates.neutral,
        )

    @property
    def reached(self) -> dict[str, float]:
        """The keys that were varied on the way, with the values they came to."""
        return dict(zip(self.problem.keys, self.found.p.tolist(), strict=True))

    @property
    def nearest(self) -> str:
        """Where a search ended, in words."""
        reached = ", ".join(f"{key} = {value:.8g}" for key, value in self.reached.items())
        return " ".join(filter(None, [f"best residual {self.found.residual:.2g} at {reached}.", self.detail]))

    @property
    def frame(self) -> Frame:
        """The state as a frame at time zero, to store or to start from."""
        return frame_of(self.problem.base, self.found.x, self.observables)

    def sensitivity(self, observables: Sequence[str], keys: Sequence[str]) -> dict[str, dict[str, float]]:
        """d(observable)/d(key) in the scenario's units, by observable and key; of all observables where none is named.

        Each key with all others as they are given. InputError where this is no state, or one without derivatives.
        """
        return self._sensitivities.of_observables(observables, keys)

    def outline(self, u: Array) -> Array:
        """r and z (m, 2) of points of the outline at u (m,) in [0, 1], in the scenario's units; s = u L."""
        fields = self.problem.base.system.fields
        values = self.problem.base.unpack(self.found.x).values(np.asarray(u, float))
        return np.asarray(values[:, [fields.index("r"), fields.index("z")]] * self.scenario.scales.factor("radius"))

    def outline_sensitivity(self, u: Array, keys: Sequence[str]) -> Array:
        """d(r, z)/d(key) (m, 2, n_keys) of these points, u held."""
        return self._sensitivities.of_outline(np.asarray(u, float), keys)

    @cached_property
    def _sensitivities(self) -> Sensitivities:
        if not self.found.outcome.is_success:
            raise InputError(
                f"there is no stationary state here ({self.outcome}) to differentiate: {self.outcome.advice}"
            )
        return Sensitivities(self.scenario, self.engine, self.found.x)

    def perturbed(self, amplitude: float, mode: int = 0, count: int = 6) -> Start:
        """The state x + amplitude Re(m) for a run to start from, m the mode of unit size of the leading rate number `mode`."""
        x = self.found.x + amplitude * self.spectrum(count).modes[mode].real
        return Start("a perturbed state", self.scenario, frame_of(self.problem.base, x, self.observables))


def observables_at(scenario: Scenario, problem: CollocationProblem, x: Array) -> dict[str, float]:
    """Observables of a state of the scenario at rest, in its units."""
    engine = replace(Engine.of(scenario), problem=problem)
    values = measure(engine, x, REST)
    values |= energy_law(values, 0.0)
    return {name: value * scenario.scales.factor(name) for name, value in values.items()}


def steady(
    scenario: Scenario, *, state: StateName | str = StateName.DEFAULT, start: Steady | Start | str | Path | None = None
) -> Steady:
    """A stationary state: the named one of the scenario, or the one that a stored state becomes at its parameters.

    start: another stationary state, or `STORE` or `STORE:LABEL`, as text or as `find_start` returns it. The outcome says whether
    there is one.
    """
    name = read_state_name(state, scenario.kind)
    if start is None:
        return steady_of(scenario, *named_state(scenario, name))
    if isinstance(start, Steady):
        start = Start("the given state", start.scenario, start.frame)
    return steady_near(scenario, start if isinstance(start, Start) else find_start(start))


def steady_near(scenario: Scenario, start: Start) -> Steady:
    """What a stored state becomes at the scenario's parameters; InputError where it is one of another model."""
    start.check_fits(scenario)
    return steady_of(scenario, *settle_near(scenario, start))


def follow(start: Steady, key: str, value: float) -> Steady:
    """The state that a known one becomes along its branch when one key goes to a value, wherever the branch turns."""
    found = followed(start.scenario, start.found, key, value)
    return steady_of(start.scenario.with_overrides({key: value}), found)


def steady_of(scenario: Scenario, found: Stationary, detail: str = "") -> Steady:
    """What was found, as a state of the scenario."""
    assert isinstance(found.problem, KeyedProblem)
    return Steady(scenario, found.problem, found, detail)


def settled(scenario: Scenario, frame: Frame) -> Frame:
    """The state of rest that a surface has come close to. InputError where there is none."""
    found = steady_of(scenario, settle(scenario, state_of(frame)))
    if not found.outcome.is_success:
        raise InputError(f"this state does not rest at its parameters ({found.outcome}): {found.outcome.advice}")
    return found.frame


def modes_at(scenario: Scenario, frame: Frame, count: int = 6) -> Modes:
    """Leading modes of a stored solution, at the state as it is: Newton's method loses a fold or a branch point."""
    found = steady_of(scenario, as_it_is(scenario, frame))
    spectrum = found.spectrum(count)
    if not spectrum.outcome.is_success:
        raise InputError(f"its growth rates are not known ({spectrum.outcome}): {spectrum.outcome.advice}")
    return found.modes(spectrum)
