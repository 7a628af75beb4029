"""Robust least squares on normal equations: Levenberg and Marquardt's steps within bounds (Nielsen 1999).

Steps are damped relative to the curvature's diagonal, whatever the scales of the unknowns; those of
`straw.replay.diagnose.fit` have a length in u, and here a unit of u is not always well seen: with them a curve's points
stay where they start, two of the first 18 of `tests.benchmarks.measured` end worse, and one of the two claims a wrong
law.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign, Point
from straw.replay.diagnose.fit import Fit, clipped, cost_at
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import weights

Floats = NDArray[np.float64]

#: First damping in units of the curvature's diagonal, the least, as closely as rounding tells, and the largest: then no
#: step helps.
DAMPED, LEAST, MOST = 1e-3, 1e-12, 1e8
#: A step shorter than this in all unknowns is none.
SHORTEST = 1e-6


def least(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    *,
    rounds: int,
    share: float = 1e-4,
    smooth: Floats | None = None,
) -> Fit:
    """The fit found from u in at most so many evaluations; it ends when a step gains less than ``share`` of the cost.

    Cost and arguments are those of `straw.replay.diagnose.fit.fitted`.
    """
    low, high, mean, sd = (np.array([getattr(k, name) for k in unknowns]) for name in ("low", "high", "mean", "sd"))
    prior = np.diag(1 / sd**2)
    rough = np.zeros_like(prior) if smooth is None else smooth.T @ smooth
    u = clipped(unknowns, np.asarray(u, dtype=np.float64))
    damping, growth = DAMPED, 2.0
    ((residual, slopes),) = campaign.at([Point(tuple(unknowns), u, derivatives=True)])
    cost = cost_at(unknowns, u, residual, smooth)
    moved = True
    g, H = np.zeros(len(u)), prior
    for _ in range(rounds - 1 if len(u) else 0):
        if campaign.stop() or damping > MOST:
            break
        if moved:
            w = weights(residual)
            g = slopes.T @ (w * residual) + prior @ (u - mean) + rough @ u
            H = (slopes * w[:, None]).T @ slopes + prior + rough
        step = _step(H, g, damping, (u <= low) & (g > 0) | (u >= high) & (g < 0))
        there = np.clip(u + step, low, high)
        step = there - u
        if not np.any(np.abs(step) > SHORTEST):
            break
        (residual_there,) = campaign.residuals(unknowns, [there])
        cost_there = cost_at(unknowns, there, residual_there, smooth)
        moved = bool(cost_there < cost)
        if not moved:
            damping, growth = damping * growth, 2 * growth
            continue
        gain, promised = cost - cost_there, -float(2 * g @ step + step @ H @ step)
        ((residual, slopes),) = campaign.at([Point(tuple(unknowns), there, derivatives=True)])
        u, cost = there, min(cost_there, cost_at(unknowns, there, residual, smooth))
        ratio = gain / promised if promised > 0 else 0.0
        damping = max(damping * max(1 / 3, 1 - (2 * min(ratio, 1.0) - 1) ** 3), LEAST)
        growth = 2.0
        if gain < share * cost:
            break
    return Fit(tuple(unknowns), u, residual, slopes, cost_at(unknowns, u, residual, smooth))


def _step(H: Floats, g: Floats, damping: float, stays: NDArray[np.bool_]) -> Floats:
    """A damped step of what is not held at a bound."""
    out = np.zeros(len(g))
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    free = ~stays
    if free.any():
        A = (H / np.outer(scale, scale))[np.ix_(free, free)] + damping * np.eye(int(free.sum()))
        out[free] = -np.linalg.solve(A, (g / scale)[free]) / scale[free]
    return out
