"""Weighs hypotheses: from their misfit beyond noise to probabilities, with "complete" and "unknown"."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit
from straw.replay.diagnose.settings import BEYOND, BLOCK, COVERED, MOST_COUNTED, NOISE_LEAVES

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Calibration:
    """Constants of `weighed`, by maximum likelihood on campaigns whose causes are known.

    `python -m tests.benchmarks.calibrating` finds them and writes `calibration.toml`.
    """

    scale: float  # squared sigmas that count as one, for numerical errors and imperfect repeats
    # minus log prior of a cause, of a second one beside it, of each constant beyond a cause's first, and of a cause
    cause: float
    second: float  # that the library does not hold; that of "complete" is 0
    constant: float
    unknown: float
    other: float  # probability that a right law has another form than the true one,
    other_fault: float  # and that a right fault of an instrument has;
    form: float  # its misfit is then at least this share of what it explains,
    power: float  # the less probable by this power
    chance: float  # probability that a wrong cause explains all that there is, and that a wrong second one explains all
    second_chance: float  # that its first leaves
    directions: float  # in which a misfit varies: a wrong second cause explains those that its constants span
    missed: float  # probability that the search missed the truth, or that it is none of the hypotheses


def _calibration() -> Calibration:
    with Path(__file__).with_name("calibration.toml").open("rb") as file:
        return Calibration(**tomllib.load(file)["calibration"])


CALIBRATION = _calibration()


@dataclass(frozen=True)
class Judgement:
    """Probabilities of hypotheses by name (``complete``, ``unknown``, causes, joint ones), largest first."""

    probability: Mapping[str, float]
    excess: Mapping[str, float]  # misfit of each hypothesis beyond noise, sigmas squared
    left_over: float  # of the best one, in intervals whose differences are too large to be noise
    faults: frozenset[str] = frozenset()  # causes that are faults of instruments


def unexplained(campaign: Campaign, fit: Fit) -> float:
    """Squared sigmas of a fit in intervals whose differences are too large to be noise."""
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
    """Approximate robust cost of sums of squares: large ones count with their root."""
    knee = 25.0 * BLOCK
    return np.where(squares > knee, 2 * np.sqrt(np.maximum(squares, 0) * knee) - knee, squares)


def judge(campaign: Campaign, null: Fit, contestants: Sequence[Contestant]) -> Judgement:
    """Probabilities over the base alone, all contestants, and an unknown cause."""
    fits = {"complete": null, **{c.name: c.fit for c in contestants}}
    best = min(fits.values(), key=lambda fit: fit.cost)
    left_over = max(0.0, unexplained(campaign, best) - NOISE_LEAVES)
    excess = {name: left_over + max(0.0, fit.cost - best.cost) for name, fit in fits.items()}
    constants = {c.name: len(c.hypothesis.unknowns) for c in contestants}
    faults = campaign.system.faults
    return Judgement(weighed(excess, constants, faults), excess, left_over, faults)


def weighed(
    excess: Mapping[str, float],
    constants: Mapping[str, int],
    faults: Collection[str],
    by: Calibration = CALIBRATION,
) -> dict[str, float]:
    """Probabilities, largest first, of hypotheses that leave ``excess`` and have so many ``constants``, of "complete"
    (in ``excess``) and "unknown".

    Prior times likelihood, normalised, mixed with a uniform distribution for causes that the search missed. Likelihoods
    are ratios: of the probability of this misfit under a right hypothesis to that under a wrong one. A wrong cause
    leaves any share of the misfit; a wrong second one, of m constants, what a projection on m of n directions leaves.
    """
    base = excess["complete"]
    log_p = {"complete": -base / (2 * by.scale), "unknown": -by.unknown}
    for name, count in constants.items():
        causes = name.split("+")
        other = by.other_fault if set(causes) <= set(faults) else by.other
        prior = by.cause + by.second * (len(causes) - 1) + by.constant * (min(count, MOST_COUNTED) - len(causes))
        log_p[name] = _log_ratio(excess[name], base, by.chance, other, by) - prior
        if len(causes) > 1:  # one after the other, unless only both together explain something
            first = min(causes, key=lambda cause: excess.get(cause, base))
            left = min(base, excess.get(first, base))
            beside = max(1, count - constants.get(first, 1))
            # P(share left < s) of Beta((n - m) / 2, m / 2) goes as s ** ((n - m) / 2); one direction always remains
            power = max(by.directions - beside, 1.0) / 2
            alone = _log_ratio_of_form(left, base, by.chance, by)
            both = alone + _log_ratio(excess[name], left, by.second_chance, other, by, power) - prior
            log_p[name] = max(log_p[name], both)
    top = max(log_p.values())
    total = sum(np.exp(v - top) for v in log_p.values())
    even = by.missed / len(log_p)
    probability = {k: float((1 - by.missed) * np.exp(v - top) / total + even) for k, v in log_p.items()}
    return dict(sorted(probability.items(), key=lambda kv: -kv[1]))


def decisive(by: Calibration = CALIBRATION) -> float:
    """Squared sigmas that the base, or a first cause of the true form, must leave for a cause of one constant that
    leaves nothing to be as probable."""
    from scipy.optimize import brentq  # slow to import

    def odds(left: float) -> float:
        return _log_ratio(0.0, left, by.chance, by.other, by) - by.cause + left / (2 * by.scale)

    return float(brentq(odds, 0.0, 2 * by.scale * (by.cause + 1)))


def _log_ratio(excess: float, before: float, chance: float, other: float, by: Calibration, power: float = 1.0) -> float:
    """Log likelihood ratio of a hypothesis that leaves ``excess`` of a misfit ``before``: a mixture of laws of the true
    form, which leave noise, and of laws of another form. A wrong one leaves less than a share s with probability
    s ** ``power``."""
    noise = -excess / (2 * by.scale) - np.log(chance + (1 - chance) * _noise_share(before, by) ** power)
    form = _log_ratio_of_form(excess, before, chance, by, power)
    return float(np.logaddexp(np.log1p(-other) + noise, np.log(other) + form))


def _log_ratio_of_form(excess: float, before: float, chance: float, by: Calibration, power: float = 1.0) -> float:
    """Of laws of another form: they leave a part in some ratio to what they explain, with a power law that makes small
    ratios typical of right laws. Wrong laws leave any share of the misfit, or, by ``chance``, nothing."""
    width = max(by.form, _noise_share(before, by))
    explained = max(before - excess, 1e-9 * before, 1e-9)
    typical = -by.power * np.log1p(excess / (by.form * explained))
    return float(typical - np.log(chance + (1 - chance) * width**power))


def _noise_share(before: float, by: Calibration) -> float:
    """The share of a misfit that is no more than noise."""
    return 2 * by.scale / (2 * by.scale + before)


def by_cause(probability: Mapping[str, float]) -> dict[str, float]:
    """Probability that each single cause takes part, alone or with another."""
    out: dict[str, float] = {}
    for name, p in probability.items():
        for cause in name.split("+"):
            if cause not in ("complete", "unknown"):
                out[cause] = out.get(cause, 0.0) + p
    return dict(sorted(out.items(), key=lambda kv: -kv[1]))


def surviving(probability: Mapping[str, float], covers: float = COVERED) -> list[str]:
    """The smallest set of hypotheses with probability ``covers``; what the search missed may be any of them."""
    total = list(itertools.accumulate(probability.values()))
    return list(probability)[: int(np.searchsorted(total, covers * (1 - CALIBRATION.missed))) + 1]
