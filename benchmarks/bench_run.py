"""The whole of Fig. 6, adaptive: solving time warm, time from process start, memory, size of the store.

Run: python benchmarks/bench_run.py   (the first time also compiles, which is reported apart)
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.timing import machine

PROBE = """
import json, resource, sys, time
import shapespace as ss
run = ss.run(ss.scenario("guided-division"))
again = ss.run(ss.scenario("guided-division"))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"first": run.wall_time, "warm": again.wall_time, "steps": again.steps, "MB": peak}))
"""


def process(*command: str) -> tuple[float, str]:
    """Seconds and standard output of a process."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return time.perf_counter() - start, done.stdout


def main() -> None:
    """Print the table."""
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        command = (sys.executable, "-m", "shapespace", "run", "guided-division", "--json", "--out")
        for label in ("run, first process (compiles if the cache is cold)", "run, process start to end, warm cache"):
            store = Path(folder) / str(len(list(Path(folder).iterdir())))
            seconds, output = process(*command, str(store))
            result = json.loads(output.splitlines()[-1])
            print(f"{label:52s}{seconds:8.1f} s   ({result['outcome']}, {result['steps']} steps)")
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file())
        print(f"{'store per 1000 frames':52s}{size / (result['steps'] + 1) * 1e3 / 1e6:8.1f} MB")
    _, output = process(sys.executable, "-c", PROBE)
    probe = json.loads(output)
    print(f"{'solving, second time in one process':52s}{probe['warm']:8.2f} s   ({probe['steps']} steps)")
    print(f"{'peak memory of that process':52s}{probe['MB']:8.0f} MB")


if __name__ == "__main__":
    main()
