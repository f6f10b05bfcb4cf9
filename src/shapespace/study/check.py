"""Probes of an installation: each returns a line about what it found, or raises what went wrong.

What is not needed but would be of use, and is not there, raises `Absent` with what to do about it.
"""

import os
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from shapespace.study.files import write_atomically

_PACKAGES = ("cyclopts", "h5netcdf", "jax", "matplotlib", "numpy", "pydantic", "rich", "scipy", "shapespace", "xarray")


class Absent(Exception):
    """An optional part is not there; the message says what it would be good for and how to get it."""


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
    assert result.outcome is not None
    if not result.outcome.is_success:
        raise RuntimeError(f"{result.outcome}: {result.outcome.advice}")
    return f"{result.steps} time steps in {result.wall_time:.1f} s, compilation included"


def probe_writing() -> str:
    """That a file can be written where runs go by default."""
    with TemporaryDirectory(dir=Path.cwd()) as directory:
        write_atomically(Path(directory) / "probe", b"shapespace")
    return "files can be written in the current directory"


def probe_cores() -> str:
    """How many cores there are for diagrams."""
    from shapespace.study.workers import available_cores

    cores = available_cores()
    return f"{cores}: `diagram` uses {'it' if cores == 1 else 'all'}, other commands one"


def probe_cache() -> str:
    """Where compiled functions are kept between processes."""
    import jax

    from shapespace.base.arrays import Array

    del Array  # importing its module is what chooses the folder
    folder = jax.config.values["jax_compilation_cache_dir"]
    if folder is None:
        raise Absent(
            "compiled functions are not kept, every command compiles them anew; make ~/.cache writable or set XDG_CACHE_HOME"
        )
    size = sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file())
    if not os.access(folder, os.W_OK):
        raise Absent(f"{folder} is not writable, new functions are compiled again each time; make it so")
    return f"{size / 2**20:.0f} MB of compiled functions in {folder}; may be deleted at any time"


def probe_accelerator() -> str:
    """What else than the CPU there is to compute on; the solver has no use for it."""
    import jax

    others = sorted({device.device_kind for device in jax.devices() if device.platform != "cpu"})
    if others:
        return f"{', '.join(others)}: is not made for these small systems; JAX_PLATFORMS=cpu is faster"
    return "none, and none is needed: the systems are small, and diagrams spread over cores"


def probe_cluster() -> str:
    """Whether diagrams can be computed on a Dask cluster."""
    return f"distributed {_optional('distributed', 'diagram --dask', 'cluster')}"


def probe_meshes() -> str:
    """Whether meshes that were exported can be opened from Python; writing them needs nothing."""
    return f"pyvista {_optional('pyvista', 'opening exported meshes in Python; ParaView needs nothing', 'export')}"


def _optional(package: str, purpose: str, extra: str) -> str:
    """The version of a package that an extra brings; Absent without it."""
    try:
        import_module(package)
    except ImportError:
        raise Absent(f"not installed, for {purpose}: pip install 'shapespace[{extra}]'") from None
    return version(package)
