"""Trust-region steps of Gauss-Newton within bounds (Nocedal and Wright, Numerical Optimization, 2006, section 4.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Longest first step, in units in which a constant is well seen or changes by a factor e. Fits of a gauge's offset of
#: 15 units from six starts all reached it with 0.5 and with 1, with 3 one of them.
FIRST_RADIUS = 1.0
#: Ratio of the cost's decrease to that of its quadratic expansion below which the region shrinks to a quarter of the
#: step, and above which it doubles where the step reached its edge (Nocedal and Wright, algorithm 4.1).
POOR, GOOD = 0.25, 0.75


def bounded_step(H: Floats, g: Floats, low: Floats, high: Floats, radius: float) -> Floats:
    """The step (n,) that minimises g s + s H s / 2 within ``low`` <= s <= ``high`` and, as long as it meets no bound,
    |s| <= radius; what would pass a bound stops there, and the others are minimised beside it."""
    step, free = np.zeros(len(g)), np.ones(len(g), dtype=bool)
    while free.any():
        rest = g[free] + H[np.ix_(free, ~free)] @ step[~free]
        step[free] = _within(H[np.ix_(free, free)], rest, radius)
        passed = free & ((step < low) | (step > high))
        if not passed.any():
            break
        step[passed] = np.clip(step, low, high)[passed]
        free &= ~passed
    return step


def promised(H: Floats, g: Floats, step: Floats) -> float:
    """Decrease of the cost, twice g s + s H s / 2, by its quadratic expansion."""
    return float(-2 * g @ step - step @ H @ step)


def resized(radius: float, step: Floats, gained: float, expected: float) -> float:
    """The radius after a step of which so much was expected."""
    length = float(np.linalg.norm(step))
    if gained < POOR * expected:
        return POOR * length
    return 2 * radius if gained > GOOD * expected and length > 0.95 * radius else radius


def _within(H: Floats, g: Floats, radius: float) -> Floats:
    """The minimum of g s + s H s / 2 with |s| <= radius, H positive definite: -(H + damping)^-1 g."""
    values, vectors = np.linalg.eigh(H)
    values, along = np.maximum(values, np.finfo(np.float64).eps * values[-1]), vectors.T @ g

    def length(damping: float) -> float:
        return float(np.linalg.norm(along / (values + damping)))

    if length(0.0) <= radius:
        return np.asarray(-vectors @ (along / values))
    low, high = 0.0, float(np.linalg.norm(g)) / radius  # where the step is no longer than the radius
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if length(middle) > radius else (low, middle)
    return np.asarray(-vectors @ (along / (values + high)))
