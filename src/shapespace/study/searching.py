"""Which stationary states are there at given parameters? A search from many starts, with the states found deflated."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapespace.analysis.branch import Point
from shapespace.analysis.deflation import Guess, Trial, images, perturbed, search
from shapespace.analysis.stability import Spectrum
from shapespace.analysis.stationary import Stationary, step_to
from shapespace.base.errors import InputError
from shapespace.base.outcome import Outcome
from shapespace.numerics.state import State
from shapespace.study.engine import Engine, frame_of, state_of
from shapespace.study.keyed import KeyedProblem
from shapespace.study.landmarks import physical_end
from shapespace.study.manifests import holds_store
from shapespace.study.named import check_has_isolated_states, reference
from shapespace.study.paths import NEWTON, own_states
from shapespace.study.scenario import Scenario
from shapespace.study.search_store import Search, SearchStore, Tried
from shapespace.study.settling import key_values
from shapespace.study.spectra import spectrum_at
from shapespace.study.starts import Start, find_starts
from shapespace.study.steady import Rates, observables_at, steady, steady_near

MAX_TRIES = 200
DRIVING = ("reduced_volume", "ring_amplitude", "peclet", "spontaneous_curvature", "pulling_force")
"""Keys that drive a surface away from its resting shape; the first that does is varied to get neighbouring states."""
NEIGHBOURS = (0.9, 1.1)
"""Factors of that key."""

Progress = Callable[[Tried], None]
"""Called after each try."""


def search_states(
    scenario: Scenario,
    *,
    origins: Sequence[str | Path] = (),
    max_tries: int = MAX_TRIES,
    out: str | Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    ready: Callable[[int], None] | None = None,
) -> Search:
    """Search for all stationary states of a scenario at its parameters; mirror images count as one state.

    Starts: the resting sphere or the flat disc; the scenario's named states; stored states `origins` (`STORE` or
    `STORE:LABEL`; of a branch without a label all labelled points and those next to the scenario's value of its key); each
    state found, perturbed by its leading modes, and as it is at neighbouring values of a key. All that was found is deflated.
    `out` is the directory of the store, new or empty; with `resume` a store there is continued, to the same tries as if it had
    never been interrupted. The outcome says whether starts are left. InputError before anything is computed.
    """
    if max_tries < 1:
        raise InputError(f"--starts {max_tries}: must be at least 1; give a larger number.")
    check_has_isolated_states(scenario)
    starts = [start for origin in origins for start in find_starts(origin, scenario)]
    if out is None:
        if resume:
            raise InputError("resume = True: needs the directory of a stored search; give it as out.")
        tried: list[Tried] = []
        outcome = _search(scenario, starts, max_tries, tried, tried.append, progress)
        return Search(outcome, scenario, tuple(tried))
    request = {"origins": [str(origin) for origin in origins]}
    begin = SearchStore.resume if resume and holds_store(out) else SearchStore.create
    with begin(out, scenario, request) as store:
        tried = [*store]
        if ready is not None:
            ready(len(tried))

        def keep(one: Tried) -> None:
            store.append(one)
            tried.append(one)

        is_over = store.outcome is not None and (store.outcome is not Outcome.MAX_STARTS or len(tried) >= max_tries)
        if not is_over:
            store.finish(_search(scenario, starts, max_tries, tried, keep, progress))
        return Search(store.outcome, scenario, tuple(tried), store.path)


def _search(
    scenario: Scenario,
    starts: Sequence[Start],
    max_tries: int,
    tried: Sequence[Tried],
    keep: Callable[[Tried], None],
    progress: Progress | None,
) -> Outcome:
    """Make the tries that are missing; `keep` lengthens those that are there."""
    searcher = _Searcher(scenario)
    guesses = [*searcher.guesses(), *map(searcher.guess_from, starts)]
    done = [searcher.trial_of(one) for one in tried]
    trials = search(guesses, searcher.p, searcher.further, done, newton=NEWTON)
    while len(tried) < max_tries:
        trial = next(trials, None)
        if trial is None:
            return Outcome.NO_MORE_FOUND if any(one.label for one in tried) else Outcome.NO_STATE
        one = searcher.record(trial, len(tried), sum(bool(one.label) for one in tried))
        keep(one)
        if progress is not None:
            progress(one)
    return Outcome.MAX_STARTS


class _Searcher:
    """Makes the guesses of a scenario and the records of tries."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        values = scenario.values()
        present = [key for key in DRIVING if key in values]
        self.key = next((key for key in present if values[key]), present[0])
        self.problem = KeyedProblem.of(scenario, (self.key,))
        self.p = key_values(scenario, (self.key,))
        self._spectra: dict[int, Spectrum] = {}

    def guesses(self) -> Iterator[Guess]:
        """The resting shape in closed form, and the scenario's own states."""
        yield self._guess("reference", Engine.of(reference(self.scenario)).initial_state())
        for name in own_states(self.scenario.kind):
            found = steady(self.scenario, state=name)
            yield self._guess(f"state {name}", found.problem.base.unpack(found.found.x))

    def guess_from(self, start: Start) -> Guess:
        """What a stored state becomes at the scenario's parameters; where it becomes nothing, the stored state itself."""
        found = steady_near(self.scenario, start)
        is_there = found.outcome.is_success
        return self._guess(start.text, found.problem.base.unpack(found.found.x) if is_there else state_of(start.frame))

    def _guess(self, name: str, state: State) -> Guess:
        base, x = Engine.of(self.scenario).placed(state)
        return Guess(name, replace(self.problem, base=base), x)

    def further(self, trial: Trial) -> list[Guess]:
        """Starts around a new state: perturbed by its modes, and as it is at neighbouring values of the key."""
        if self._unphysical(trial.found) is not None:
            return []
        assert trial.number is not None
        name, found = f"state {trial.number + 1}", trial.found
        guesses = perturbed(found, self._spectrum(trial), name)
        for factor in NEIGHBOURS if self.p[0] else ():
            near = step_to(found, factor * self.p)
            if near.outcome.is_success:
                guesses.append(Guess(f"{name} at {self.key} = {near.p[0]:.6g}", _keyed(near), near.x))
        return guesses

    def _spectrum(self, trial: Trial) -> Spectrum:
        """Of a new solution, once."""
        assert trial.number is not None
        if trial.number not in self._spectra:
            found = trial.found
            self._spectra[trial.number] = spectrum_at(_keyed(found), found.x, found.p)
        return self._spectra[trial.number]

    def _unphysical(self, found: Stationary) -> Outcome | None:
        """Why a solution is no physical shape, if so."""
        return physical_end(Point(found.problem, found.x, found.p, 0, np.zeros(len(found.x) + 1)))

    def record(self, trial: Trial, place: int, states: int) -> Tried:
        """What is kept of a trial, `states` having been found before."""
        found = trial.found
        bare = Tried(place, trial.name, found.outcome.value, found.iterations, found.residual, trial.number)
        if not trial.is_new:
            return bare
        problem = _keyed(found)
        frame = frame_of(problem.base, found.x, observables_at(self.scenario, problem.base, found.x))
        unphysical = self._unphysical(found)
        if unphysical is not None:
            return replace(bare, outcome=unphysical.value, frame=frame)
        rates = Rates.of(self._spectrum(trial), self.scenario)
        return replace(
            bare,
            label=f"state-{states + 1}",
            is_mirrored=len(images(found, problem)) == 2,
            frame=frame,
            growth_rates=np.array(rates.values).reshape(-1, 2),
            growth_rate_errors=np.array(rates.errors),
            parities=tuple(rates.parities),
            neutral=rates.neutral,
            n_unstable=rates.n_unstable,
        )

    def trial_of(self, one: Tried) -> Trial:
        """The trial of which a record was kept."""
        problem, x, outcome = self.problem, np.zeros(0), Outcome(one.outcome)
        if one.frame is not None:
            base, x = Engine.of(self.scenario).placed(state_of(one.frame))
            problem, outcome = replace(problem, base=base), Outcome.CONVERGED
        found = Stationary(problem, x, self.p, outcome, np.nan, one.residual, one.iterations, one.frame is not None)
        return Trial(one.start, found, one.number)


def _keyed(found: Stationary) -> KeyedProblem:
    assert isinstance(found.problem, KeyedProblem)
    return found.problem
