"""AUTO-07p as a peer: the branch of stationary surfaces of guided division (Fig. 7b at Pe = 450) in the ring amplitude.

`auto/guided_division.f90` holds the equations, written by hand from peer_solve_bvp.py; `auto/c.guided_division` the
settings: 60 intervals of 4 Gauss points, moved after every step, tolerances 1e-7, folds located. Branch points are not
looked for (ISP = 0): with ISP = 2 AUTO reports dozens on this branch, others for every largest step.

AUTO-07p is free software (BSD): on Debian and Ubuntu `apt install auto-07p gfortran`; elsewhere from
https://github.com/auto-07p/auto-07p, with AUTO_DIR set to the built folder or its `auto` on the PATH.

Run from the root: python -m benchmarks.peer_auto
"""

import os
import resource
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent / "auto"
NAME = "guided_division"
MISSING = "AUTO-07p is not here: install the Debian packages auto-07p and gfortran, or set AUTO_DIR to a built copy."
DEBIAN = Path("/usr/lib/auto-07p")
FOLD = 5
"""AUTO's type number of a fold of differential equations."""
STEPS = (0.35, 2.0)
"""Largest steps, of 145 and 84 points. Between, AUTO may stop short of the second fold: by 2e-4 for 0.5 and 1.0."""


@dataclass(frozen=True)
class Run:
    """A branch by AUTO. end: (Delta_c, h, p) of the last point; seconds: processor time."""

    points: int
    folds: tuple[float, ...]
    end: tuple[float, float, float]
    seconds: float


def auto_directory() -> Path | None:
    """Where AUTO's compiled library is; None without it or without gfortran."""
    places = [Path(os.environ["AUTO_DIR"])] if "AUTO_DIR" in os.environ else []
    program = shutil.which("auto")
    places += [Path(program).resolve().parent.parent] if program else []
    found = [place for place in (*places, DEBIAN) if any((place / "lib").glob("*.o"))]
    return found[0] if found and shutil.which("gfortran") else None


def run_auto(directory: Path, largest_step: float) -> Run:
    """Compile and follow the branch once. subprocess.CalledProcessError where a program fails."""
    with tempfile.TemporaryDirectory() as folder:
        objects = map(str, (directory / "lib").glob("*.o"))
        source = str(HERE / f"{NAME}.f90")
        compile_ = ["gfortran", "-O3", "-fopenmp", "-J", folder, "-o", f"{folder}/run", source, *objects]
        subprocess.run(compile_, check=True, capture_output=True)
        settings = (HERE / f"c.{NAME}").read_text(encoding="utf-8")
        Path(folder, "fort.2").write_text(f"{settings}DSMAX = {largest_step}\n", encoding="utf-8")
        Path(folder, "fort.3").touch()
        before = _seconds_of_children()
        one_thread = {**os.environ, "OMP_NUM_THREADS": "1"}
        subprocess.run([f"{folder}/run"], cwd=folder, env=one_thread, check=True, capture_output=True)
        seconds = _seconds_of_children() - before
        table = Path(folder, "fort.7").read_text(encoding="utf-8")
    return _parsed(table, seconds)


def _seconds_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _parsed(table: str, seconds: float) -> Run:
    """From lines of branch, point, type, label, Delta_c, norm, three maxima, h, p, v0; those of branch 0 are headings."""
    rows = [row for line in table.splitlines() if (row := line.split())[0] != "0"]
    folds = tuple(float(row[4]) for row in rows if abs(int(row[2])) == FOLD)
    last = rows[-1]
    return Run(len(rows), folds, (float(last[4]), float(last[9]), float(last[10])), seconds)


def main() -> None:
    """Print the branch at each largest step."""
    directory = auto_directory()
    if directory is None:
        print(MISSING)
        return
    for step in STEPS:
        run = run_auto(directory, step)
        print(f"largest step {step}: {run.points} points in {run.seconds:.2f} s of processor time, folds {run.folds}")
        print(f"  end: Delta_c, h, p = {run.end}")


if __name__ == "__main__":
    main()
