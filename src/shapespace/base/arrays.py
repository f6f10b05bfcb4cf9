"""Array types and the 64-bit switch: importing this module is what makes JAX compute in double precision."""

import os
from pathlib import Path

import jax
import numpy as np
from numpy.typing import NDArray

jax.config.update("jax_enable_x64", True)
# Every result is wanted at once, so handing work to another thread only costs.
jax.config.update("jax_cpu_enable_async_dispatch", False)


def _keep_compiled_functions() -> None:
    """Keep compiled functions between processes in the user's cache folder, unless JAX was told where to or it cannot be."""
    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = root / "shapespace" / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return
    if os.access(folder, os.W_OK):
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.05)


_keep_compiled_functions()

Array = NDArray[np.float64]
"""A host array of doubles; shapes are stated in docstrings as (e elements, k stages, n fields, ...)."""

Flags = NDArray[np.bool_]
"""A host array of truth values."""

Traced = jax.Array
"""An array or scalar inside a differentiated or compiled function."""
