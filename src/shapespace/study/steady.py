"""Stationary states of a scenario: from a resting reference in closed form, by following it to the scenario's parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from shapespace.analysis.bifurcation import Kind, solve_singular
from shapespace.analysis.branch import Point
from shapespace.analysis.continuation import Arclength, Continuation, start_point
from shapespace.analysis.stability import Spectrum
from shapespace.analysis.stationary import Stationary, solve_stationary, step_to
from shapespace.analysis.tracing import Located, side_branches, traced
from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.base.problem import REST
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.state import State
from shapespace.study.engine import Engine, frame_of, state_of
from shapespace.study.frame import Frame
from shapespace.study.keyed import KeyedProblem
from shapespace.study.keys import MAIN_KEYS
from shapespace.study.modes import Modes
from shapespace.study.observables import energy_law, measure, shape_end
from shapespace.study.paths import MAX_POINTS, NEWTON, StateName, along, read_state_name, steps
from shapespace.study.presenting import Presented, Summary, quantities_table
from shapespace.study.scenario import Scenario
from shapespace.study.sensitivities import Sensitivities
from shapespace.study.spectra import spectrum_at
from shapespace.study.starts import Start, find_start
from shapespace.study.vesicles import solve_vesicle


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


def steady_from(scenario: Scenario, state: State, keys: tuple[str, ...] = ()) -> Steady:
    """The stationary state of the scenario next to a given state, by Newton's method."""
    keys = keys or (_main_key(scenario),)
    problem = KeyedProblem.of(scenario, keys)
    base, x = Engine.of(scenario).placed(state)
    found = solve_stationary(replace(problem, base=base), x, key_values(scenario, keys), NEWTON)
    return _steady(scenario, found)


def steady(
    scenario: Scenario, *, state: StateName | str = StateName.DEFAULT, start: Steady | Start | str | Path | None = None
) -> Steady:
    """A stationary state: the named one of the scenario, or the one that a stored state becomes at its parameters.

    start: another stationary state, or `STORE` or `STORE:LABEL`, as text or as `find_start` returns it. The outcome says whether
    there is one.
    """
    name = read_state_name(state, scenario.kind)
    if start is None:
        return solve_steady(scenario, name)
    if isinstance(start, Steady):
        start = Start("the given state", start.scenario, start.frame)
    return steady_near(scenario, start if isinstance(start, Start) else find_start(start))


def steady_near(scenario: Scenario, start: Start) -> Steady:
    """What a stored state becomes at the scenario's parameters: settled at its own ones first, then by stepping."""
    start.check_fits(scenario)
    mine, theirs = scenario.parameters.model_dump(), start.scenario.parameters.model_dump()
    keys = tuple(key for key, value in mine.items() if theirs[key] != value)
    state = state_of(start.frame)
    if not keys:
        return _singular_at(scenario, start) or steady_from(scenario, state)
    origin = scenario.with_overrides({key: theirs[key] for key in keys})
    settled = steady_from(origin, state, keys)
    if not settled.outcome.is_success:
        return replace(settled, scenario=scenario)
    found = step_to(settled.found, key_values(scenario, keys))
    return _steady(
        scenario, solve_stationary(found.problem, found.x, found.p, NEWTON) if found.outcome.is_success else found
    )


def _singular_at(scenario: Scenario, start: Start) -> Steady | None:
    """A stored fold or branch point as the solution of its defining system; None for other states, and on other meshes."""
    point = start.point
    if (
        point is None
        or start.key is None
        or start.key not in start.keys
        or point.kind not in (*Kind,)
        or start.scenario.numerics != scenario.numerics
    ):
        return None
    problem = KeyedProblem.of(scenario, (start.key,))
    problem = replace(problem, base=problem.base.on_mesh(point.frame.mesh))
    x, p = problem.base.pack(state_of(point.frame)), np.array([point.parameter])
    root = solve_singular(problem, 0, x, p, point.tangent[None, :-1] if point.kind == Kind.FOLD else point.directions)
    if not root.outcome.is_success:
        return None
    x, p = root.x[: len(x)], root.x[len(x) : len(x) + 1]
    residual = float(np.abs(problem.residual(x, p, REST)).max())
    settled = problem.adapted(x) is problem
    return _steady(
        scenario, Stationary(problem, x, p, root.outcome, root.correction, residual, root.iterations, settled)
    )


def solve_steady(scenario: Scenario, name: StateName = StateName.DEFAULT) -> Steady:
    """The named stationary state of the scenario, from the resting sphere or the flat disc; a vesicle from beside the sphere.

    That reference solves the equations without a ring, a coat and a pull; these are then raised one after another along the
    branch of states that leads on from it, through folds. Without a ring the default is the polarized, swimming state
    on the branch that leaves the sphere at the first pitchfork in the Peclet number.
    """
    check_has_isolated_states(scenario)
    if scenario.kind == "vesicle":
        found, detail = solve_vesicle(scenario, name)
        return replace(_steady(scenario, found), detail=detail)
    if scenario.kind == "closed-surface":
        sphere = reference(scenario)
        if scenario.values()["ring_amplitude"] == 0.0:
            return _sphere(scenario, sphere) if name is StateName.TRIVIAL else _polarized(scenario, sphere)
        return _raised(scenario, _sphere(sphere, sphere), ("ring_amplitude",))
    flat = reference(scenario)
    start = steady_from(flat, Engine.of(flat).initial_state())
    return start if name is StateName.TRIVIAL else _raised(scenario, start, ("spontaneous_curvature", "pulling_force"))


def reference(scenario: Scenario) -> Scenario:
    """The scenario without ring, coat and pull: its initial state, a sphere or a flat disc, is at rest; a spheroid nearly so."""
    if scenario.kind == "vesicle":
        return scenario.with_overrides({"initial_leaning": 0.0})
    if scenario.kind == "closed-surface":
        return scenario.with_overrides(
            {"ring_amplitude": 0.0, "initial_background": 1.0, "initial_ring_amplitude": 0.0, "seed_amplitude": 0.0}
        )
    return scenario.with_overrides({"spontaneous_curvature": 0.0, "pulling_force": 0.0})


def key_values(scenario: Scenario, keys: Sequence[str]) -> Array:
    """Values of keys, in the scenario's units."""
    values = scenario.values()
    return np.array([float(values[key]) for key in keys])


def follow(start: Steady, key: str, value: float) -> Steady:
    """The state that a known one becomes along its branch when one key goes to a value, wherever the branch turns."""
    scenario = start.scenario.with_overrides({key: value})
    problem = KeyedProblem.of(start.scenario, (key,))
    problem = replace(problem, base=start.problem.base)
    at = key_values(start.scenario, (key,))
    if at[0] == value:
        return replace(start, scenario=scenario)
    first = start_point(problem, start.found.x, at, 0, float(np.sign(value - at[0])), steps(value - at[0]))
    if isinstance(first, Outcome):
        return replace(start, found=replace(start.found, outcome=first))
    return _steady(scenario, along(first, value, steps(value - first.parameter)))


def _steady(scenario: Scenario, found: Stationary) -> Steady:
    assert isinstance(found.problem, KeyedProblem)
    return Steady(scenario, found.problem, found)


def _main_key(scenario: Scenario) -> str:
    return MAIN_KEYS[scenario.kind]


def _sphere(scenario: Scenario, sphere: Scenario) -> Steady:
    """The resting sphere with the uniform reference concentration."""
    return steady_from(scenario, Engine.of(sphere).initial_state())


def _raised(scenario: Scenario, start: Steady, keys: Sequence[str]) -> Steady:
    """Raise keys from zero to their values one after another."""
    for key in keys:
        if not start.outcome.is_success:
            break
        start = follow(start, key, float(scenario.values()[key]))
    return replace(start, scenario=scenario) if start.outcome.is_success else start


def _polarized(scenario: Scenario, sphere: Scenario) -> Steady:
    """The swimming state on the branch that leaves the sphere at its first pitchfork in the Peclet number.

    Below the pitchfork that branch leads to a swimmer only if it turns back: it is followed to twice the pitchfork's number,
    above it as far back as zero, where nothing drives a flow.
    """
    goal = float(scenario.values()["peclet"])
    resting = _sphere(sphere.with_overrides({"peclet": 0.0}), sphere.with_overrides({"peclet": 0.0}))
    first = start_point(resting.problem, resting.found.x, np.zeros(1), 0, 1.0, steps(1.0))
    assert isinstance(first, Point)
    branch = Continuation([first], (), Arclength(first=0.1, largest=0.2, max_points=MAX_POINTS), NEWTON)
    reached = 0.0
    for one in traced(branch):
        reached = one.parameter if isinstance(one, Point) else reached
        if isinstance(one, Located) and one.point.kind is Kind.PITCHFORK:
            fork = one.point.parameter
            side = side_branches(one.point, one.bracket.after.tangent, 0.02)[0]
            away = 2.0 * fork if goal < fork else 0.0
            found = along(side, goal, steps(max(abs(goal - fork), 0.1 * fork)), away)
            met = f"The sphere polarizes at peclet = {fork:.8g}; the branch from there comes to no swimmer at {goal:g}."
            return replace(_steady(scenario, found), detail="" if found.outcome.is_success else met)
    detail = f"The sphere does not polarize up to peclet = {reached:.3g}."
    return replace(resting, found=replace(resting.found, outcome=Outcome.NO_STATE), detail=detail)


def check_has_isolated_states(scenario: Scenario) -> None:
    """InputError where stationary states come in families."""
    if scenario.kind == "closed-surface" and scenario.values()["turnover_rate"] == 0.0:
        raise InputError(
            "turnover_rate = 0: conserves the regulator, so that stationary states come in families that no equation tells "
            "apart; choose a turnover_rate > 0."
        )


def settled(scenario: Scenario, frame: Frame) -> Frame:
    """The state of rest that a surface has come close to. InputError where there is none."""
    found = steady_from(scenario, state_of(frame))
    if not found.outcome.is_success:
        raise InputError(f"this state does not rest at its parameters ({found.outcome}): {found.outcome.advice}")
    return found.frame


def modes_at(scenario: Scenario, frame: Frame, count: int = 6) -> Modes:
    """Leading modes of a stored solution, at the state as it is: Newton's method loses a fold or a branch point."""
    problem = KeyedProblem.of(scenario, (_main_key(scenario),))
    problem = replace(problem, base=problem.base.on_mesh(frame.mesh))
    x, p = problem.base.pack(state_of(frame)), key_values(scenario, problem.keys)
    residual = float(np.abs(problem.residual(x, p, REST)).max())
    found = _steady(scenario, Stationary(problem, x, p, Outcome.CONVERGED, 0.0, residual, 0, settled=True))
    spectrum = found.spectrum(count)
    if not spectrum.outcome.is_success:
        raise InputError(f"its growth rates are not known ({spectrum.outcome}): {spectrum.outcome.advice}")
    return found.modes(spectrum)
