"""Commands about states at rest: `steady`."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from shapespace.base.errors import InputError
from shapespace.cli.shared import (
    GAVE_UP,
    AsJson,
    NameOrFile,
    Settings,
    StartFrom,
    app,
    chosen_scenario,
    described,
    examples,
    print_lines,
    print_observables,
    read_settings,
    tell,
)

if TYPE_CHECKING:
    from shapespace.study.steady import Rates, Steady


@app.command(
    name="steady",
    help_epilogue=examples(
        "shapespace steady polar-swimmer",
        "shapespace steady guided-division -s ring_amplitude=2.5 --json",
        "shapespace steady guided-division --sensitivity peclet,ring_amplitude",
        "shapespace steady guided-division --from results/guided-division --out results/divided",
    ),
)
def steady_command(
    scenario: NameOrFile,
    /,
    *,
    settings: Settings = (),
    start: StartFrom = None,
    state: Annotated[
        str | None,
        Parameter(
            metavar="NAME",
            help="default; trivial: resting sphere or flat disc; prolate, oblate, stomatocyte: vesicles.",
        ),
    ] = None,
    sensitivity: Annotated[
        str | None,
        Parameter(metavar="KEYS", help="Derivatives of all observables by these parameters, with commas between them."),
    ] = None,
    out: Annotated[Path | None, Parameter(metavar="DIR", help="New directory to store the state in.")] = None,
    as_json: AsJson = False,
) -> int:
    """Solve for a stationary state; print its observables and the leading growth rates of small perturbations."""
    from shapespace.study.files import storage
    from shapespace.study.modes import store_modes
    from shapespace.study.run import store_frame
    from shapespace.study.steady import Rates, steady
    from shapespace.study.store import RunStore

    if start is not None and state is not None:
        raise InputError(f"--state {state} and --from {start}: name two states; give only one.")
    chosen = chosen_scenario(scenario, read_settings(settings), start)
    if out is not None:
        with storage(out):
            RunStore.check_free(out)
    found = steady(chosen, state=state or "default", start=start)
    rates, slopes = None, dict[str, dict[str, float]]()
    if found.outcome.is_success:
        keys = [] if sensitivity is None else [key.strip() for key in sensitivity.split(",")]
        if "" in keys:
            raise InputError(f"--sensitivity {sensitivity!r}: must name parameters, e.g. --sensitivity peclet,tension.")
        slopes = found.sensitivity((), keys) if keys else {}
        spectrum = found.spectrum()
        rates = Rates.of(spectrum, found.scenario)
        if out is not None:
            store_frame(out, chosen, found.frame, found.outcome)
            store_modes(out, found.modes(spectrum))
    if as_json:
        record = _record(found, rates, out) | ({"sensitivities": slopes} if slopes else {})
        print(json.dumps(record, allow_nan=False))
    else:
        _summarise(found, rates, slopes, out)
    if not found.outcome.is_success:
        tell(f"no stationary state found ({found.outcome}): {found.outcome.advice} Reached: {found.nearest}")
        return GAVE_UP
    if rates is not None and not rates.outcome.is_success:
        tell(f"the growth rates are not known ({rates.outcome}): {rates.outcome.advice}")
    return 0


def _record(found: "Steady", rates: "Rates | None", out: Path | None) -> dict[str, object]:
    from shapespace.study.modes import neutral_modes

    record = described(found.outcome, found.scenario, found.observables if rates else {})
    record |= {
        "growth_rates": rates.values if rates else [],
        "growth_rate_errors": rates.errors if rates else [],
        "parities": rates.parities if rates else [],
        "neutral_modes": neutral_modes(found.scenario, rates.neutral) if rates else [],
        "n_unstable": rates.n_unstable if rates else None,
        "residual": found.found.residual if math.isfinite(found.found.residual) else None,
        "reached": found.reached,
    }
    return record | ({"store": str(out)} if out is not None and rates else {})


def _summarise(found: "Steady", rates: "Rates | None", slopes: dict[str, dict[str, float]], out: Path | None) -> None:
    from rich.table import Table

    from shapespace.study.modes import neutral_modes

    if rates is not None:
        neutral = neutral_modes(found.scenario, rates.neutral)
        names = {mode["index"]: f"neutral: {mode['name']}" for mode in neutral}
        held = [f"neutral, held by the frame: {mode['name']}" for mode in neutral if mode["index"] is None]
        print_observables(found.scenario, found.observables)
        table = Table("growth rate", "frequency", "error", "mode", box=None, header_style="bold")
        for i, (real, imaginary) in enumerate(rates.values):
            kind = ", ".join(word for word in (rates.parities[i], names.get(i)) if word)
            table.add_row(f"{real:.8g}", f"{imaginary:.8g}" if imaginary else "", f"{rates.errors[i]:.1g}", kind)
        print_lines("", table, *held, _verdict(rates))
    if slopes:
        by_key = Table(
            "derivative of", *(f"by {key}" for key in next(iter(slopes.values()))), box=None, header_style="bold"
        )
        for name, row in slopes.items():
            by_key.add_row(name, *(f"{value:.8g}" for value in row.values()))
        print_lines("", by_key, "")
    print_lines(f"{found.outcome}: {found.outcome.advice}")
    if out is not None and rates is not None:
        print_lines(f"stored in {out}")


def _verdict(rates: "Rates") -> str:
    if rates.n_unstable is None:
        return "stability unknown"
    if rates.n_unstable == 0:
        return "stable"
    modes = "1 growing mode" if rates.n_unstable == 1 else f"{rates.n_unstable} growing modes"
    return f"unstable: {modes}; `shapespace search` looks for other states"
