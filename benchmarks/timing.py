"""Timing for the benchmarks: one core, smallest and middle of many repetitions, and a stated machine."""

import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median


def use_one_core() -> None:
    """Confine this process to one core; to be called before numpy is imported: its threads would spin on that core."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def milliseconds(work: Callable[[], object], repetitions: int = 200) -> tuple[float, float]:
    """(smallest, median) time of one call in ms, after one call to warm up."""
    work()
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times), 1e3 * median(times)


def machine() -> str:
    """One line that names the processor and the load, which matters as much."""
    name = platform.processor() or platform.machine()
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
            name = next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{name}, Python {platform.python_version()}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
