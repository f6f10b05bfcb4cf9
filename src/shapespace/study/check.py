"""Probes of an installation: each returns a line about what it found, or raises what went wrong."""

import sys
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from shapespace.study.files import write_atomically

_PACKAGES = ("cyclopts", "h5netcdf", "jax", "matplotlib", "numpy", "pydantic", "rich", "scipy", "shapespace", "xarray")


def probe_versions() -> str:
    """The versions of Python and of the packages that matter."""
    return ", ".join([f"python {sys.version.split()[0]}", *(f"{name} {version(name)}" for name in _PACKAGES)])


def probe_precision() -> str:
    """That arrays are of double precision."""
    # Imported late, like the solver below: a broken installation should fail its check, not this module.
    import jax.numpy as jnp

    from shapespace.base.arrays import Array

    del Array  # importing its module switches double precision on
    if (kind := jnp.asarray(1.0).dtype.name) != "float64":
        raise RuntimeError(f"arrays are {kind}; unset JAX_ENABLE_X64")
    return kind


def probe_solve() -> str:
    """That a few time steps of a small problem can be taken."""
    from shapespace.study.run import run
    from shapespace.study.scenario import scenario

    result = run(scenario("guided-division", until=1e-3, elements=20))
    if not result.outcome.is_success:
        raise RuntimeError(f"{result.outcome}: {result.outcome.advice}")
    return f"{result.steps} time steps in {result.wall_time:.1f} s, compilation included"


def probe_writing() -> str:
    """That a file can be written where runs go by default."""
    with TemporaryDirectory(dir=Path.cwd()) as directory:
        write_atomically(Path(directory) / "probe", b"shapespace")
    return "files can be written in the current directory"
