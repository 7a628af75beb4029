"""Least squares over a campaign: damped Gauss-Newton with priors, bounds and robust weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import robust_cost, weights

Floats = NDArray[np.float64]

#: Damping tried in each step, as a share of the curvature.
DAMPING = (1e-4, 0.1)
#: A step that gains less than this share of what was predicted was predicted badly.
WELL = 0.3
#: A fit that is far from noise need not be known so well: a round that gains less than this share of it is the last.
BEYOND_NOISE = 1e-3
#: Longest step in units of u.
LONGEST_STEP = 3.0
#: Before a search ends that is this near to noise (sigmas squared), and that minds gains as little as this, it takes
#: derivatives in both of two other ways, and so many times at most: by steps that are felt so much, and to either side,
#: by this share of the last steps.
NEAR_NOISE, FINELY, BOTH, OTHERWISE, WIDE_SIGMAS, HALF = 2000.0, 3.0, 2, 3, 0.3, 0.5
#: A slope so many times steeper than one taken by a shorter step, or to the other side, is an edge's.
STEEPER = 3.0
#: A derivative's step in u: first, least, most; and how many sigmas (root mean square) it aims to move the runs.
STEP, SMALLEST_STEP, LARGEST_STEP, STEP_SIGMAS = 0.03, 5e-4, 0.2, 0.1


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
    felt_sigmas: float = STEP_SIGMAS  # by which steps slopes were measured

    @property
    def values(self) -> dict[str, float]:
        """Numbers found, SI, by target."""
        return {k.target: k.value(float(u)) for k, u in zip(self.unknowns, self.u, strict=True)}


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
    first = steps = np.array([campaign.steps.get(unknowns[k].target, STEP) for k in which])
    out, edged = np.empty((len(residual), len(which))), np.zeros(len(which), dtype=bool)
    todo = list(range(len(which)))
    for again in range(2):
        points = []
        for k in todo:
            step = steps[k] if u[which[k]] + steps[k] <= unknowns[which[k]].high else -steps[k]
            points.append(u + step * np.eye(len(u))[which[k]])
        for k, point, moved in zip(todo, points, campaign.residuals(unknowns, points), strict=True):
            slope = (moved - residual) / (point - u)[which[k]]
            if again and steps[k] > first[k] and _steeper(slope, out[:, k]):
                steps[k], edged[k] = first[k], True  # the longer step fell off: another snap, or nothing to be played
            else:
                out[:, k] = slope
        effect = np.sqrt(np.mean(out**2, axis=0)) * steps
        better = np.clip(steps * felt_sigmas / np.maximum(effect, 1e-9), SMALLEST_STEP, LARGEST_STEP)
        better = np.where(edged, steps, better)
        todo = [k for k in todo if abs(np.log(better[k] / steps[k])) > np.log(6.0)]
        first, steps = steps, better
        if not todo:
            break
    campaign.steps.update((unknowns[k].target, float(step)) for k, step in zip(which, steps, strict=True))
    return out


def central_slopes(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats, residual: Floats) -> Floats:
    """`measured_slopes` by all unknowns with a step to either side, (m, unknowns): twice the work, and what rings after
    a snap, of which the phase changes, does not pass for a slope. Of a step off an edge the other side is taken."""
    steps = np.diag([HALF * campaign.steps.get(unknown.target, STEP) for unknown in unknowns])
    points = [clipped(unknowns, u + sign * step) for step in steps for sign in (1, -1)]
    ends = campaign.residuals(unknowns, points)
    out = np.empty((len(residual), len(u)))
    for k in range(len(u)):
        sides = [(points[j][k], ends[j]) for j in (2 * k, 2 * k + 1)]
        gentle = min(((end - residual) / (x - u[k]) for x, end in sides if x != u[k]), key=np.linalg.norm)
        (above, end_above), (below, end_below) = sides
        slope = (end_above - end_below) / (above - below)
        out[:, k] = gentle if _steeper(slope, gentle) else slope
    return out


def known_well(campaign: Campaign, fit: Fit) -> list[Fit]:
    """The fit with slopes measured where it is, from both sides, and by steps that are felt more: where something rings
    now the ones, now the others show the way."""
    central = central_slopes(campaign, fit.unknowns, fit.u, fit.residual)
    wide = measured_slopes(campaign, fit.unknowns, fit.u, fit.residual, range(len(fit.u)), WIDE_SIGMAS)
    return [replace(fit, slopes=central, fresh=True), replace(fit, slopes=wide, fresh=True, felt_sigmas=WIDE_SIGMAS)]


def _otherwise(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats, residual: Floats, time: int) -> Floats:
    """Slopes for a search that has come to its end, in turn by steps over which what rings is averaged out, and from
    both sides."""
    if time % 2:
        return measured_slopes(campaign, unknowns, u, residual, range(len(u)), WIDE_SIGMAS)
    return central_slopes(campaign, unknowns, u, residual)


def _steeper(slope: Floats, other: Floats) -> bool:
    return bool(np.linalg.norm(slope) > STEEPER * np.linalg.norm(other))


def descend(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    *,
    slopes: Floats | None = None,
    residual: Floats | None = None,
    fresh: bool = False,
    rounds: int = 8,
    enough: float = 1.0,
    share: float = 0.0,
    resumed: Fit | None = None,
) -> Fit:
    """Damped Gauss-Newton from u, or going on with a fit as if it had not been interrupted (``resumed``).

    ``slopes`` (m, unknowns) may be known, from nearby or as measured here (``fresh``); they are measured anew whenever
    they predict badly, else corrected by what each step shows (Broyden).
    Ends when a round gains less than ``enough`` or that ``share`` of the cost.
    """
    unknowns = tuple(unknowns)
    if resumed is not None:
        slopes, residual = resumed.slopes, resumed.residual
    u = clipped(unknowns, np.asarray(u, dtype=np.float64))
    if residual is None:
        residual = campaign.residuals(unknowns, [u])[0]
    cost = cost_at(unknowns, u, residual)
    if slopes is None:
        fresh, slopes = True, measured_slopes(campaign, unknowns, u, residual, range(len(u)))
    straight, otherwise = Straight(unknowns), 0
    damping = np.array(DAMPING)
    if resumed is not None:
        fresh, damping = resumed.fresh, damping * (resumed.damping / DAMPING[0])
    for _ in range(rounds):
        if campaign.stop():
            break
        little = max(enough, share * cost, BEYOND_NOISE * (cost - len(residual)))
        best, predicted = _best_step(campaign, straight, u, residual, cost, slopes, damping, enough)
        gain = cost - best.cost
        corrected = _broyden(slopes, best.residual - residual, straight.way(u, best.u))
        if gain > 0:
            corrected *= straight.stretch(best.u, u)
            u, residual, cost = best.u, best.residual, best.cost
            damping = damping / 4 if best.damping == damping[0] else damping
        else:
            damping = damping * 16
        if gain < little and fresh and (gain > 0 or predicted < enough or damping[0] > 10):
            if otherwise < BOTH and little <= FINELY and cost < len(residual) + NEAR_NOISE:
                otherwise, damping = otherwise + 1, np.array(DAMPING)
                slopes, fresh = _otherwise(campaign, unknowns, u, residual, otherwise), True
                continue
            slopes, fresh = (corrected, False) if gain > 0 else (slopes, fresh)
            break
        if not fresh and (gain < WELL * predicted or gain < little):
            if otherwise == OTHERWISE:
                slopes = corrected if gain > 0 else slopes
                break
            if otherwise:
                otherwise += 1
                slopes = _otherwise(campaign, unknowns, u, residual, otherwise)
            else:
                slopes = measured_slopes(campaign, unknowns, u, residual, range(len(u)))
            fresh = True
        elif gain > 0 or not fresh:
            slopes, fresh = corrected, False
    return Fit(unknowns, u, residual, slopes, cost, fresh, float(damping[0]))


@dataclass(frozen=True, eq=False)
class _Tried:
    """A step that was taken on trial: where it led, what it cost to be there, with which damping."""

    u: Floats
    residual: Floats
    cost: float
    damping: float


def _best_step(
    campaign: Campaign,
    straight: Straight,
    u: Floats,
    residual: Floats,
    cost: float,
    slopes: Floats,
    damping: Floats,
    enough: float,
) -> tuple[_Tried, float]:
    """The best of a few steps, and the gain predicted for it: one with each damping, until one keeps what it promised
    or promises less than ``enough``, and one back to the valley's floor."""

    def taken(at: Floats, left: Floats, damped: float) -> tuple[_Tried, float]:
        step = straight.step(at, slopes * straight.stretch(at, u), left, damped)
        (end,) = campaign.residuals(straight.unknowns, [step.end])
        return _Tried(step.end, end, cost_at(straight.unknowns, step.end, end), damped), step.gain

    best, predicted = taken(u, residual, damping[0])
    for damped in damping[1:]:
        if cost - best.cost >= WELL * predicted or predicted < enough:
            return best, predicted
        other, gain = taken(u, residual, damped)
        if other.cost < best.cost:
            best, predicted = other, gain
    if cost - best.cost < WELL * predicted:
        # valleys bend: from where a step has led, the same slopes lead back down to the valley's floor
        back, _ = taken(best.u, best.residual, best.damping)
        best = min(best, back, key=lambda one: one.cost)
    return best, predicted


@dataclass(frozen=True)
class Step:
    """Where a step leads, u, and what it is predicted to gain."""

    end: Floats
    gain: float


class Straight:
    """Steps along straight lines of what acts in proportion: a strength's value, which u is not.

    Where two constants stand in for each other, as a tip offset and a length do, the valley between them is straight in
    their values; in u it bends, and a search that goes straight ahead in u stops at once.
    """

    def __init__(self, unknowns: Sequence[Unknown]) -> None:
        self.unknowns = tuple(unknowns)
        self.mean, self.sd = np.array([k.mean for k in unknowns]), np.array([k.sd for k in unknowns])
        self.low, self.high = np.array([k.low for k in unknowns]), np.array([k.high for k in unknowns])

    def _units(self, u: Floats) -> Floats:
        return np.array([k.units(x) for k, x in zip(self.unknowns, u, strict=True)])

    def _per_u(self, u: Floats) -> Floats:
        return np.array([k.units_per_u(x) for k, x in zip(self.unknowns, u, strict=True)])

    def stretch(self, at: Floats, known: Floats) -> Floats:
        """What slopes by u, known at one place, are to be multiplied with to hold at another."""
        return self._per_u(at) / self._per_u(known)

    def way(self, u: Floats, end: Floats) -> Floats:
        """From u to the end, straight: in units of u where it begins."""
        return (self._units(end) - self._units(u)) / self._per_u(u)

    def after(self, u: Floats, way: Floats) -> Floats:
        """u at the end of a way."""
        end = self._units(u) + self._per_u(u) * way
        return clipped(self.unknowns, np.array([k.at(x) for k, x in zip(self.unknowns, end, strict=True)]))

    def step(self, u: Floats, slopes: Floats, left: Floats, damping: float) -> Step:
        """A damped step downhill; unknowns that would leave their bounds are held there and the others solved again."""
        w = weights(left)
        curvature = (slopes * w[:, None]).T @ slopes + np.diag(1 / self.sd**2)
        gradient = slopes.T @ (w * left) + (u - self.mean) / self.sd**2
        damped = curvature + damping * np.diag(np.diag(curvature))
        low, high = self.way(u, self.low), self.way(u, self.high)
        free = np.ones(len(u), dtype=bool)
        way = np.zeros(len(u))
        for _ in range(len(u)):
            held = (gradient + damped @ np.where(free, 0, way))[free]
            way[free] = np.linalg.solve(damped[np.ix_(free, free)], -held)
            way = way * min(1.0, LONGEST_STEP / max(float(np.max(np.abs(way))), 1e-12))
            beyond = free & ((way < low) | (way > high))
            if not beyond.any():
                break
            way[beyond] = np.clip(way, low, high)[beyond]
            free &= ~beyond
        way = np.clip(way, low, high)
        return Step(self.after(u, way), float(-2 * gradient @ way - way @ curvature @ way))


def _broyden(slopes: Floats, moved: Floats, step: Floats) -> Floats:
    """Slopes corrected so that they predict the last step."""
    size = float(step @ step)
    if size == 0:
        return slopes
    return np.asarray(slopes + np.outer(moved - slopes @ step, step) / size)
