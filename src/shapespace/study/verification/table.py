"""All benchmarks, and the running of them."""

import os
import platform
from collections.abc import Callable
from time import perf_counter

from shapespace.study.verification import buckling, continuation, divisions, membranes, spheres
from shapespace.study.verification.record import Benchmark, Result, Row, Verification
from shapespace.study.verification.states import Absent
from shapespace.study.versions import own_versions

BENCHMARKS = (
    Benchmark("Sphere at rest", spheres.resting),
    Benchmark("Passive sphere", spheres.passive),
    Benchmark("Active sphere with friction", spheres.active),
    Benchmark("Oscillating sphere", spheres.oscillating),
    Benchmark("The sphere polarizes", spheres.polarization),
    Benchmark("The sphere swims", spheres.swimming),
    Benchmark("The sphere begins to oscillate", spheres.hopf, is_quick=False),
    Benchmark("Sphere under outer pressure", spheres.squeezed),
    Benchmark("Clamped disc", membranes.buckling),
    Benchmark("Pulled disc", membranes.pull, is_quick=False),
    Benchmark("Tether", membranes.tether, is_quick=False),
    Benchmark("Coated membrane, Fig. 3a", divisions.gibbs_loop, is_quick=False),
    Benchmark("Vesicles", membranes.crossings),
    Benchmark("Vesicles near the sphere", membranes.near_sphere),
    Benchmark("Long vesicles", membranes.tubes, is_quick=False),
    Benchmark("Guided division, Fig. 6", divisions.neck),
    Benchmark("Guided division, Fig. 7b", divisions.folds),
    Benchmark("Balances of a run", divisions.balances),
    Benchmark("Bratu's problem", continuation.bratu),
    Benchmark("Gelfand's problem", continuation.gelfand),
    Benchmark("Bratu's problem with free ends", continuation.neumann),
    Benchmark("An integral condition", continuation.integral),
    Benchmark("Chan's problem", continuation.chan),
    Benchmark("Carrier's problem", continuation.carrier, is_quick=False),
    Benchmark("Chafee and Infante's problem", continuation.chafee_infante),
    Benchmark("Euler's elastica", buckling.elastica),
    Benchmark("Elastic ring under pressure", buckling.ring, is_quick=False),
    Benchmark("Soap film and liquid column", buckling.films),
)

Progress = Callable[[str, float], None]
"""Called before each benchmark with its title and the share that is done."""


def verify(*, quick: bool = False, progress: Progress | None = None) -> Verification:
    """Compute every benchmark, or the quick ones, and set the values beside closed forms and published numbers.

    Nothing is stored. A benchmark that finds no value gives a row that fails and says why.
    """
    chosen = [one for one in BENCHMARKS if one.is_quick or not quick]
    results = []
    for number, benchmark in enumerate(chosen):
        if progress is not None:
            progress(benchmark.title, number / len(chosen))
        results.append(measured(benchmark))
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    return Verification(tuple(results), own_versions(), machine, quick)


def measured(benchmark: Benchmark) -> Result:
    """The rows of a benchmark and their time."""
    began = perf_counter()
    rows: list[Row] = []
    try:
        rows.extend(benchmark.compute())
    except (Absent, ValueError, LookupError, ArithmeticError) as trouble:
        rows.append(Row("not computed", float("nan"), float("nan"), "", 0.0, " ".join(str(trouble).split())))
    return Result(benchmark.title, tuple(rows), perf_counter() - began)
