"""Robust loss: large differences count linearly, not squared (soft L1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.settings import ROBUST_SIGMAS

Floats = NDArray[np.float64]


def robust_cost(residual: Floats) -> float:
    """Sum of squares in which large differences count linearly (soft L1)."""
    c2 = ROBUST_SIGMAS**2
    return float(np.sum(2 * c2 * (np.sqrt(1 + residual**2 / c2) - 1)))


def weights(residual: Floats) -> Floats:
    """Weights of squares equivalent to the robust cost."""
    return np.asarray(1 / np.sqrt(1 + (residual / ROBUST_SIGMAS) ** 2))


def curvature(residual: Floats) -> Floats:
    """Weights of a Gauss-Newton Hessian of half the robust cost, taken as the sum of squares of the roots of its terms:
    (w + w^2) / 2 with w the `weights`. These alone are twice as much where differences are large, and steps half as
    long."""
    w = weights(residual)
    return np.asarray((w + w**2) / 2)
