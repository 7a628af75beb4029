"""Weighs hypotheses: how much each leaves unexplained beyond noise, as probabilities with "complete" and "unknown"."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit

Floats = NDArray[np.float64]

#: Samples that are looked at together, and how many deviations of their sum of squares are beyond noise.
BLOCK, BEYOND = 24, 5.0
#: Differences of misfit up to this count as likelihoods do; beyond it only ratios of what is left unexplained count,
#: since no law in the library has exactly the form nature gave it.
LIKELIHOOD_UP_TO = 10.0
#: Squared sigmas that count as one: searches end, solvers err and runs repeat only to this. With nothing concealed
#: the best cause was up to 172 sigmas squared below the base, which then still is more probable than not (0.59).
COUNTS_AS_ONE = 20.0
#: What noise and forks of repeats leave unexplained even with the right model, sigmas squared.
NOISE_LEAVES = 300.0
#: Share of the base's excess misfit that "unknown" is taken to leave, where the best leaves nothing beyond noise and
#: where it leaves much, and what much is (sigmas squared). Of 306 sealed cases right answers left nothing, at most 348,
#: or 0.0005 of that excess; what no hypothesis explained left more than 400 (one case 21), and 0.02 of it and more.
#: The first and the last were set with deck 20261129 opened: with 0.1 and 100 causes that explained all of a small
#: excess came second to "unknown", which was the truth there once where nothing was left (in the next deck twice).
UNKNOWN_LEAVES, UNKNOWN_LEAVES_LESS, MUCH = 0.2, 0.005, 30.0
#: "Unknown" is never surer than this, as the library may hold the cause and its search have ended too early. It was set
#: with deck 20261129 opened, 3 of whose misses were mended; said 34 times in that deck and the next, it was right 24
#: times, so this is still too sure. What is over goes to those that come nearest.
UNKNOWN_AT_MOST = 0.85
#: Logarithms of prior probabilities: one cause, a second one beside it, each constant beyond a cause's first, unknown.
LOG_PRIOR_CAUSE, LOG_PRIOR_SECOND, LOG_PRIOR_CONSTANT, LOG_PRIOR_UNKNOWN = -4.0, -4.0, -0.5, -4.0
#: What survives is together as probable as this.
COVERED = 0.95


@dataclass(frozen=True)
class Judgement:
    """Probabilities of hypotheses by name (``complete``, ``unknown``, causes, joint ones), largest first."""

    probability: Mapping[str, float]
    excess: Mapping[str, float]  # misfit beyond noise that each hypothesis leaves, sigmas squared
    left_over: float  # of the best of them, from where its differences are too large to be noise


def unexplained(campaign: Campaign, fit: Fit) -> float:
    """Squared sigmas of a fit that lie in stretches whose differences are too large to be noise."""
    return sum(run_by_run(campaign, fit))


def run_by_run(campaign: Campaign, fit: Fit) -> list[float]:
    """What is `unexplained` in each run."""
    parts = zip(campaign.observations, campaign.slices(), strict=True)
    return [beyond_noise(fit.residual[part], observed.seen.shape) for observed, part in parts]


def beyond_noise(row: Floats, shaped: tuple[int, ...]) -> float:
    """What is `unexplained` of one run's differences: samples of ``shaped`` (channels, n), then those of timing."""
    size = int(np.prod(shaped))
    shape = row[:size].reshape(shaped)
    blocks = shape.shape[1] // BLOCK
    squares = np.sum(shape[:, : blocks * BLOCK].reshape(len(shape), blocks, BLOCK) ** 2, axis=2)
    usual = np.clip(np.median(squares, axis=1, keepdims=True), 0.5 * BLOCK, 1.5 * BLOCK)
    loud = squares > usual * (1 + BEYOND * np.sqrt(2 / BLOCK))
    timing = row[size:] ** 2
    late = np.sum(_gently(np.where(timing > 9, timing - 1, 0)))
    return float(np.sum(np.where(loud, _gently(squares - usual), 0)) + late)


def _gently(squares: Floats) -> Floats:
    """Sums of squares as the robust cost counts them, roughly: large ones with their root."""
    knee = 25.0 * BLOCK
    return np.where(squares > knee, 2 * np.sqrt(np.maximum(squares, 0) * knee) - knee, squares)


def judge(campaign: Campaign, null: Fit, contestants: Sequence[Contestant]) -> Judgement:
    """Probabilities over the base alone, all contestants, and a cause nobody has thought of."""
    fits = {"complete": null, **{c.name: c.fit for c in contestants}}
    best = min(fits.values(), key=lambda fit: fit.cost)
    left_over = max(0.0, unexplained(campaign, best) - NOISE_LEAVES)
    excess = {name: left_over + max(0.0, fit.cost - best.cost) for name, fit in fits.items()}
    constants = {c.name: len(c.hypothesis.unknowns) for c in contestants}
    return Judgement(weighed(excess, left_over, constants), excess, left_over)


def weighed(excess: Mapping[str, float], left_over: float, constants: Mapping[str, int]) -> dict[str, float]:
    """Probabilities, largest first, of hypotheses that leave ``excess`` and have so many ``constants``, of "complete"
    (in ``excess``) and "unknown"."""
    log_p = {"complete": _log_likelihood(excess["complete"])}
    for name, count in constants.items():
        together = name.count("+") + 1
        prior = LOG_PRIOR_CAUSE + LOG_PRIOR_SECOND * (together - 1)
        prior += LOG_PRIOR_CONSTANT * (min(count, 4) - together)
        log_p[name] = prior + _log_likelihood(excess[name])
    log_p["unknown"] = LOG_PRIOR_UNKNOWN + _log_likelihood(unknown_leaves(excess["complete"], left_over))
    top = max(log_p.values())
    total = sum(np.exp(v - top) for v in log_p.values())
    probability = {k: float(np.exp(v - top) / total) for k, v in log_p.items()}
    over = probability["unknown"] - UNKNOWN_AT_MOST
    if over > 0 and constants:
        near = {name: 1 / (1 + excess[name]) for name in constants}
        whole = sum(near.values())
        for name, weight in near.items():
            probability[name] += over * weight / whole
        probability["unknown"] = UNKNOWN_AT_MOST
    return dict(sorted(probability.items(), key=lambda kv: -kv[1]))


def unknown_leaves(base: float, left_over: float) -> float:
    """Excess misfit that a cause nobody has thought of is taken to leave, where base and best leave these."""
    share = (UNKNOWN_LEAVES * MUCH + UNKNOWN_LEAVES_LESS * left_over) / (MUCH + left_over)
    return share * base + (1 - share) * min(left_over, 1.0)


def _log_likelihood(excess: float) -> float:
    """Likelihood of what is left unexplained: exp(-excess / 2) while it is small, a power of it when it is large."""
    return float(-LIKELIHOOD_UP_TO / 2 * np.log1p(excess / COUNTS_AS_ONE / LIKELIHOOD_UP_TO))


def by_cause(probability: Mapping[str, float]) -> dict[str, float]:
    """Probability that each single cause takes part, alone or with another."""
    out: dict[str, float] = {}
    for name, p in probability.items():
        for cause in name.split("+"):
            if cause not in ("complete", "unknown"):
                out[cause] = out.get(cause, 0.0) + p
    return dict(sorted(out.items(), key=lambda kv: -kv[1]))


def surviving(probability: Mapping[str, float], covers: float = COVERED) -> list[str]:
    """The fewest hypotheses that together are as probable as ``covers``."""
    total = list(itertools.accumulate(probability.values()))
    return list(probability)[: int(np.searchsorted(total, covers)) + 1]
