"""Array types and the 64-bit switch: importing this module is what makes JAX compute in double precision."""

import jax
import numpy as np
from numpy.typing import NDArray

jax.config.update("jax_enable_x64", True)

Array = NDArray[np.float64]
"""A host array of doubles; shapes are stated in docstrings as (e elements, k stages, n fields, ...)."""

Traced = jax.Array
"""An array or scalar inside a differentiated or compiled function."""
