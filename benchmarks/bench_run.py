"""The whole of Fig. 6, adaptive: from process start to end, solving warm, memory, size of the store, import time.

Times are wall-clock and processor time of the whole process: other work on the machine shows in the first, hardly in the
second. Run: python benchmarks/bench_run.py   (a minute; with cold caches the first line also compiles, for another)
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.timing import machine

IMPORT = "import shapespace.cli, shapespace.study.simulation"
PROBE = """
import json, resource, time
import shapespace as ss
from shapespace.study.simulation import Simulation
scenario = ss.scenario("guided-division")
ss.run(scenario)
start = time.process_time()
steps = sum(1 for _ in Simulation(scenario)) - 1
solving = time.process_time() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"solving": solving, "steps": steps, "MB": peak}))
"""


def process(*command: str) -> tuple[float, float, str]:
    """Seconds, processor seconds and standard output of a process."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - start, cpu, done.stdout


def main() -> None:
    """Print the table."""
    print(machine())
    print(f"{'':52s}{'wall, s':>9s}{'cpu, s':>9s}")
    with tempfile.TemporaryDirectory() as folder:
        command = (sys.executable, "-m", "shapespace", "run", "guided-division", "--json", "--out")
        for label in (
            "run, first process (compiles if the cache is cold)",
            *2 * ["run, process start to end, warm cache"],
        ):
            store = Path(folder) / str(len(list(Path(folder).iterdir())))
            wall, cpu, output = process(*command, str(store))
            result = json.loads(output.splitlines()[-1])
            print(f"{label:52s}{wall:9.1f}{cpu:9.1f}   ({result['outcome']}, {result['steps']} steps)")
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file())
    for _ in range(2):
        wall, cpu, _ = process(sys.executable, "-c", IMPORT)
    print(f"{'  of it, importing':52s}{wall:9.1f}{cpu:9.1f}")
    probe = json.loads(process(sys.executable, "-c", PROBE)[2])
    print(
        f"{'solving with all observables, second time in a process':61s}{probe['solving']:9.2f}   ({probe['steps']} steps)"
    )
    print(f"{'peak memory of that process':52s}{probe['MB']:9.0f} MB")
    print(f"{'store per 1000 frames':52s}{size / (result['steps'] + 1) * 1e3 / 1e6:9.1f} MB")
    print(machine())


if __name__ == "__main__":
    main()
