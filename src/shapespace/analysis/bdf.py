"""Backward differentiation on variable steps: backward Euler (order 1), BDF2 and BDF3 as one formula.

Stiffly accurate, so algebraic equations hold at every step, and of full order for the index-2 systems that constrained
overdamped motion leads to (Hairer & Wanner II, Sec. VII.3).
"""

import numpy as np

from shapespace.base.arrays import Array


def derivative_weights(times: Array) -> Array:
    """Weights (m,) of values at `times` (m,), newest first, in the derivative of their interpolant at times[0]."""
    weights = np.zeros(len(times))
    for j in range(1, len(times)):
        others = [m for m in range(1, len(times)) if m != j]
        ratio = np.prod([(times[0] - times[m]) / (times[j] - times[m]) for m in others])
        weights[j] = ratio / (times[j] - times[0])
    weights[0] = -weights[1:].sum()
    return weights


def extrapolation_weights(time: float, times: Array) -> Array:
    """Weights (m,) of values at `times` (m,) in their interpolant at `time`."""
    weights = np.ones(len(times))
    for j in range(len(times)):
        for m in range(len(times)):
            if m != j:
                weights[j] *= (time - times[m]) / (times[j] - times[m])
    return weights


def error_factor(time: float, times: Array, order: int) -> float:
    """Local error of a step to `time` per difference between its result and the predictor through `order` + 1 points.

    The predictor misses q^(k+1)/(k+1)! prod_{j<=k}(t - t_j), the formula of order k the same product without j = k over
    its leading weight.
    """
    leading = derivative_weights(np.concatenate([[time], times[:order]]))[0]
    return float(1.0 / (leading * (time - times[order])))
