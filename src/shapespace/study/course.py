"""What a branch varies: a key of its scenario, or an observable while a key is free to follow."""

from dataclasses import dataclass, replace

from shapespace.base.errors import InputError
from shapespace.numerics.collocation import CollocationProblem
from shapespace.study.keyed import HeldProblem, KeyedProblem
from shapespace.study.keys import MAIN_KEYS
from shapespace.study.measures import make_observable, observed_names
from shapespace.study.scenario import Scenario


@dataclass(frozen=True)
class Course:
    """key: what varies from point to point, a parameter's key or, with a key `free` that answers, an observable."""

    key: str
    free: str | None = None

    @property
    def moved(self) -> str:
        """The scenario's key whose value changes along the branch."""
        return self.free or self.key

    def check(self, scenario: Scenario) -> None:
        """InputError where this cannot vary."""
        if self.free is None and self.key not in scenario.values() and self.key in observed_names(scenario):
            raise InputError(
                f"--vary {self.key}: is an observable; give as --free the key that is to answer, such as "
                f"{MAIN_KEYS[scenario.kind]}."
            )
        if self.free is None:
            KeyedProblem.of(scenario, (self.key,))
        elif self.key in scenario.values():
            raise InputError(f"--free {self.free}: goes with an observable, and {self.key} is a key; leave it away.")
        else:
            KeyedProblem.of(scenario, (self.free,))
            make_observable(scenario, self.key, self.free)

    def problem(self, scenario: Scenario, base: CollocationProblem | None = None) -> KeyedProblem | HeldProblem:
        """The problem whose one parameter varies, on the scenario's initial mesh or on that of `base`."""
        keyed = KeyedProblem.of(scenario, (self.moved,))
        keyed = keyed if base is None else replace(keyed, base=base)
        return keyed if self.free is None else HeldProblem(keyed, 0, make_observable(scenario, self.key, self.free))

    def scenario_at(self, scenario: Scenario, value: float) -> Scenario:
        """The scenario at a value of the key that changes."""
        return scenario.with_overrides({self.moved: value})
