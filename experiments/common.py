"""What the experiments share: their command line, the table of what the paper says and what we get, ramps and pictures."""

import argparse
import inspect
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.console import Console
from rich.table import Table

import shapespace as ss
from shapespace.study.branch_point import BranchPoint
from shapespace.study.dataset import profile_of
from shapespace.study.starts import Start
from shapespace.view import style
from shapespace.view.figure import plot_run
from shapespace.view.outline import draw_outline


@dataclass(frozen=True)
class Row:
    """One claim. holds: what is asserted of our number, which is not agreement where the paper is wrong or silent.

    verdict: agrees, differs, not in the paper, or in a word why it cannot be compared. error: of our number, as another
    discretisation or a law shows it.
    """

    claim: str
    paper: str
    ours: str
    error: str
    holds: bool
    verdict: str = "agrees"


def near(claim: str, paper: str, value: float, expected: float, tolerance: float, verdict: str = "agrees") -> Row:
    """A number with the one it must meet, from the paper, a law, or another method or discretisation."""
    miss = abs(value - expected)
    return Row(claim, paper, f"{value:.9g}", f"{miss:.1e}", miss <= tolerance, verdict)


def main(run: Callable[[Path, bool], list[Row]]) -> None:
    """The command line of an experiment: print its table; exit status 1 where an assertion fails."""
    file = Path(inspect.getfile(run))
    parser = argparse.ArgumentParser(description=(sys.modules[run.__module__].__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="coarse and in seconds: a look at it, not its numbers")
    parser.add_argument("--out", type=Path, help="directory for data and figure; the default is results/NAME")
    options = parser.parse_args()
    out = options.out or Path("results") / (file.stem + ("-quick" if options.quick else ""))
    out.mkdir(parents=True, exist_ok=True)
    began = perf_counter()
    rows = run(out, options.quick)
    Console(width=None if sys.stdout.isatty() else 170).print(table_of(rows))
    print(f"{perf_counter() - began:.0f} s; data and figure are in {out}")
    sys.exit(0 if all(row.holds for row in rows) else 1)


def table_of(rows: Iterable[Row]) -> Table:
    """The table of claims, and whether what is asserted of our numbers holds."""
    table = Table("claim", "paper", "here", "error", "verdict", "asserted", box=None, header_style="bold")
    for row in rows:
        table.add_row(
            row.claim, row.paper, row.ours, row.error, row.verdict, "holds" if row.holds else "[bold red]FAILS"
        )
    return table


def resumed_branch(
    out: Path,
    scenario: ss.Scenario,
    key: str,
    stop: float,
    ends: Sequence[ss.Outcome] = (),
    blind: tuple[float, float] = (np.inf, -np.inf),
    **options: Any,
) -> ss.Branch:
    """`ss.branch` into a store: the branch found there, where an earlier call has finished it.

    ends: allowed besides success. blind: range of the key in which special points may be missed; nowhere else.
    """
    found = ss.branch(scenario, key, stop, out=out, resume=True, **options)
    assert found.outcome is not None
    assert found.outcome.is_success or found.outcome in ends, f"{out}: {found.outcome} {found.detail}"
    missed = [one for one in found.missed if not blind[0] < one["parameter_before"] < blind[1]]
    assert not missed, missed
    return found


def settled_run(name: str, out: Path, scenario: ss.Scenario, quick: bool) -> tuple[ss.Run, ss.Steady]:
    """A run to its end, in a store where an earlier call may have finished it, and the stationary state next to that end.

    Its figure, of this name: the observable over time, snapshots with flow, profiles.
    """
    case = scenario.with_overrides({"time_tolerance": 10.0 * scenario.run.time_tolerance}) if quick else scenario
    found = ss.run(case, out=out / "run", resume=True)
    save(plot_run(found.dataset), out, name)
    return found, ss.steady(case, start=found.state())


def labelled(branch: ss.Branch, kind: str) -> list[BranchPoint]:
    """The special points of a kind, in the order of the branch."""
    return [point for point in branch.special_points if point.kind == kind]


def ramp(
    scenario: ss.Scenario, key: str, values: Sequence[float], start: Any, kick: float = 1e-3
) -> list[dict[str, float]]:
    """A slow ramp in steps: at each value the dynamics runs until nothing moves, from the state at the value before.

    kick: of the leading mode, added to each state that is left, so that what becomes unstable has something to grow from.
    Returns the observables of the last states, with the key.
    """
    reached = []
    for value in values:
        at = scenario.with_overrides({key: value})
        run = ss.run(at, start=start)
        reached.append({**run.observables, key: value})
        if run.outcome is not ss.Outcome.STATIONARY:
            break
        start = ss.steady(at, start=run.state()).perturbed(kick)
    return reached


def jump(
    reached: Sequence[dict[str, float]], key: str, measure: Callable[[dict[str, float]], float]
) -> tuple[float, float]:
    """The two neighbouring values of the key between which a measure of the observables changes most, the lower one first."""
    changes = [abs(measure(after) - measure(before)) for before, after in pairwise(reached)]
    place = changes.index(max(changes))
    low, high = sorted((reached[place][key], reached[place + 1][key]))
    return low, high


def panels(columns: Sequence[float], height_mm: float = 80.0) -> tuple[Figure, list[Axes]]:
    """A figure of the page's width with axes side by side of these relative widths; inside `style.house_style()`."""
    figure = style.new_figure(1.0, height_mm)
    return figure, list(figure.subplots(1, len(columns), width_ratios=columns, squeeze=False)[0])


def handle(text: str, colour: str = style.INK, **looks: Any) -> Line2D:
    """An entry of a legend: a line, or with marker and linestyle="" a mark."""
    return Line2D([], [], color=colour, label=text, **{"ms": 3.5, **looks})


def draw_states(axes: Axes, branch: ss.Branch, points: Sequence[BranchPoint], names: Sequence[str]) -> None:
    """Sections of states of one branch side by side, each with its name below."""
    draw_starts(axes, [Start("", branch.scenario_at(point), point.frame) for point in points], names)


def draw_starts(axes: Axes, states: Sequence[Start], names: Sequence[str]) -> None:
    """Sections of states with their names below: closed surfaces side by side, membranes one below the other."""
    right = low = 0.0
    for state, name in zip(states, names, strict=True):
        profile = profile_of(state.scenario, state.frame)
        radius, z = float(profile["radius"].max()), profile["axial_position"]
        if state.scenario.model == "open-membrane":
            low -= float(np.ptp(z)) + 0.45 * radius
            centre = (0.0, low)
        else:
            right += 1.12 * radius
            centre = (right, 0.0)
            right += 1.12 * radius
        draw_outline(axes, state.scenario, state.frame, centre)
        below = (centre[0], centre[1] + float(z.min()))
        axes.annotate(name, below, (0, -4), textcoords="offset points", ha="center", va="top")
    axes.margins(0.05, 0.12)


def save(figure: Figure, out: Path, name: str) -> None:
    """The figure as PNG and PDF."""
    for suffix in ("png", "pdf"):
        figure.savefig(out / f"{name}.{suffix}", dpi=200)
