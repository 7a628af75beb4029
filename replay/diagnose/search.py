"""Least squares over a campaign: damped Gauss-Newton with priors, bounds and robust weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.diagnose.campaign import Campaign
from replay.diagnose.hypothesis import Unknown

Floats = NDArray[np.float64]

#: Differences beyond this many sigmas count with their size, not their square.
ROBUST_SIGMAS = 5.0
#: Damping tried in each step, as a share of the curvature.
DAMPING = (1e-4, 0.1)
#: A step that gains less than this share of what was predicted was predicted badly.
WELL = 0.3
#: A fit that is far from noise need not be known so well: a round that gains less than this share of it is the last.
BEYOND_NOISE = 1e-3
#: Longest step in units of u.
LONGEST_STEP = 3.0
#: A derivative's step in u: first, least, most; and how many sigmas (root mean square) it aims to move the runs.
STEP, SMALLEST_STEP, LARGEST_STEP, STEP_SIGMAS = 0.03, 2e-3, 0.2, 0.3


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a search ended: u, differences (m,), slopes (m, unknowns) there, and what it cost to be there."""

    unknowns: tuple[Unknown, ...]
    u: Floats
    residual: Floats
    slopes: Floats
    cost: float  # robust, with priors
    fresh: bool  # whether the slopes were measured here
    damping: float = DAMPING[0]  # with which the search would go on

    @property
    def values(self) -> dict[str, float]:
        """Numbers found, SI, by target."""
        return {k.target: k.value(float(u)) for k, u in zip(self.unknowns, self.u, strict=True)}


def robust_cost(residual: Floats) -> float:
    """Sum of squares in which what is far off counts with its size (soft L1)."""
    c2 = ROBUST_SIGMAS**2
    return float(np.sum(2 * c2 * (np.sqrt(1 + residual**2 / c2) - 1)))


def weights(residual: Floats) -> Floats:
    """Weights of squares that stand for the robust cost."""
    return np.asarray(1 / np.sqrt(1 + (residual / ROBUST_SIGMAS) ** 2))


def prior_cost(unknowns: Sequence[Unknown], u: Floats) -> float:
    """What the priors charge."""
    return float(sum(((x - k.mean) / k.sd) ** 2 for k, x in zip(unknowns, u, strict=True)))


def cost_at(unknowns: Sequence[Unknown], u: Floats, residual: Floats) -> float:
    """Robust misfit at u with what the priors charge."""
    return robust_cost(residual) + prior_cost(unknowns, u)


def clipped(unknowns: Sequence[Unknown], u: Floats) -> Floats:
    """u within its bounds."""
    return np.clip(u, [k.low for k in unknowns], [k.high for k in unknowns])


def measured_slopes(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    residual: Floats,
    which: Sequence[int],
    felt_sigmas: float = STEP_SIGMAS,
) -> Floats:
    """Derivatives of the differences by some of the unknowns, (m, len(which)), by steps that are well felt: that move
    the runs by ``felt_sigmas`` (root mean square), roughly."""
    steps = np.array([campaign.steps.get(unknowns[k].target, STEP) for k in which])
    out = np.empty((len(residual), len(which)))
    todo = list(range(len(which)))
    for _ in range(2):
        points = []
        for k in todo:
            step = steps[k] if u[which[k]] + steps[k] <= unknowns[which[k]].high else -steps[k]
            points.append(u + step * np.eye(len(u))[which[k]])
        for k, point, moved in zip(todo, points, campaign.residuals(unknowns, points), strict=True):
            out[:, k] = (moved - residual) / (point - u)[which[k]]
        effect = np.sqrt(np.mean(out**2, axis=0)) * steps
        better = np.clip(steps * felt_sigmas / np.maximum(effect, 1e-9), SMALLEST_STEP, LARGEST_STEP)
        todo = [k for k in todo if abs(np.log(better[k] / steps[k])) > np.log(6.0)]
        steps = better
        if not todo:
            break
    campaign.steps.update((unknowns[k].target, float(step)) for k, step in zip(which, steps, strict=True))
    return out


def descend(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    *,
    slopes: Floats | None = None,
    residual: Floats | None = None,
    rounds: int = 8,
    enough: float = 1.0,
    share: float = 0.0,
    resumed: Fit | None = None,
) -> Fit:
    """Damped Gauss-Newton from u, or going on with a fit as if it had not been interrupted (``resumed``).

    ``slopes`` (m, unknowns) may be known from nearby; they are measured anew whenever they predict badly, else
    corrected by what each step shows (Broyden).
    Ends when a round gains less than ``enough`` or that ``share`` of the cost.
    """
    unknowns = tuple(unknowns)
    if resumed is not None:
        slopes, residual = resumed.slopes, resumed.residual
    u = clipped(unknowns, np.asarray(u, dtype=np.float64))
    if residual is None:
        residual = campaign.residuals(unknowns, [u])[0]
    cost = cost_at(unknowns, u, residual)
    fresh = slopes is None
    if slopes is None:
        slopes = measured_slopes(campaign, unknowns, u, residual, range(len(u)))
    mean, sd = np.array([k.mean for k in unknowns]), np.array([k.sd for k in unknowns])
    damping = np.array(DAMPING)
    if resumed is not None:
        fresh, damping = resumed.fresh, damping * (resumed.damping / DAMPING[0])
    for _ in range(rounds):
        if campaign.stop():
            break

        def downhill(at: Floats, left: Floats, damped: float, slopes: Floats = slopes) -> tuple[Floats, float]:
            """Where a step from ``at`` leads, and what it is predicted to gain."""
            w = weights(left)
            curvature = (slopes * w[:, None]).T @ slopes + np.diag(1 / sd**2)
            gradient = slopes.T @ (w * left) + (at - mean) / sd**2
            end = _step(unknowns, at, curvature, gradient, damped)
            step = end - at
            return end, float(-2 * gradient @ step - step @ curvature @ step)

        trials, predictions = zip(*(downhill(u, residual, d) for d in damping), strict=True)
        points, ends = list(trials), campaign.residuals(unknowns, trials)
        costs = [cost_at(unknowns, t, r) for r, t in zip(ends, points, strict=True)]
        predicted = predictions[int(np.argmin(costs))]
        if cost - min(costs) < WELL * predicted:
            # valleys bend: from where a step has led, the same slopes lead back down to the valley's floor
            back = [downhill(t, r, d)[0] for t, r, d in zip(trials, ends, damping, strict=True)]
            ends += campaign.residuals(unknowns, back)
            points += back
            costs = [cost_at(unknowns, t, r) for r, t in zip(ends, points, strict=True)]
        best = int(np.argmin(costs))
        gain = cost - costs[best]
        little = max(enough, share * cost, BEYOND_NOISE * (cost - len(residual)))
        corrected = _broyden(slopes, ends[best] - residual, points[best] - u)
        if gain > 0:
            u, residual, cost = points[best], ends[best], costs[best]
            damping = damping / 4 if best % 2 == 0 else damping
        else:
            damping = damping * 16
        if gain < little and fresh and (gain > 0 or damping[0] > 10):
            slopes, fresh = (corrected, False) if gain > 0 else (slopes, fresh)
            break
        if not fresh and (gain < WELL * predicted or gain < little):
            slopes = measured_slopes(campaign, unknowns, u, residual, range(len(u)))
            fresh = True
        elif gain > 0 or not fresh:
            slopes, fresh = corrected, False
    return Fit(unknowns, u, residual, slopes, cost, fresh, float(damping[0]))


def _step(unknowns: Sequence[Unknown], u: Floats, curvature: Floats, gradient: Floats, damping: float) -> Floats:
    """u after a step; unknowns that would leave their bounds are held there and the others solved again."""
    free = np.ones(len(u), dtype=bool)
    damped = curvature + damping * np.diag(np.diag(curvature))
    low, high = np.array([k.low for k in unknowns]), np.array([k.high for k in unknowns])
    step = np.zeros(len(u))
    for _ in range(len(u)):
        step[free] = np.linalg.solve(damped[np.ix_(free, free)], -(gradient + damped @ np.where(free, 0, step))[free])
        step = step * min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-12))
        beyond = free & ((u + step < low) | (u + step > high))
        if not beyond.any():
            break
        step[beyond] = np.clip(u + step, low, high)[beyond] - u[beyond]
        free &= ~beyond
    return np.asarray(np.clip(u + step, low, high))


def _broyden(slopes: Floats, moved: Floats, step: Floats) -> Floats:
    """Slopes corrected so that they predict the last step."""
    size = float(step @ step)
    if size == 0:
        return slopes
    return np.asarray(slopes + np.outer(moved - slopes @ step, step) / size)
