"""Default starts of a system: multi-start over the priors of the base's constants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, clipped, cost_at, fits_from, fitted
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import DRAWN, FIRST_ROUNDS, FOLLOWED, ROUNDS
from straw.replay.errors import ReplayError

Floats = NDArray[np.float64]


def fit_from_priors(campaign: Campaign, proposed: Sequence[Floats] = ()) -> tuple[Fit, Fit]:
    """The base fitted to all samples and to the coarse comparison, from the given constants and from points of the
    priors."""
    unknowns = campaign.system.base
    points = [np.zeros(len(unknowns)), *proposed, *scattered(unknowns)]
    costs = logarithmic(campaign, points)
    best = np.argsort(costs, kind="stable")[:FOLLOWED] if len(unknowns) else [0]
    ends = fits_from(campaign, [(unknowns, points[k]) for k in best], rounds=FIRST_ROUNDS)
    fine = fitted(campaign, unknowns, min(ends, key=lambda fit: fit.cost).u, rounds=ROUNDS)
    return fine, fitted(campaign.coarse(), unknowns, fine.u, rounds=ROUNDS)


def logarithmic(campaign: Campaign, points: Sequence[Floats]) -> list[float]:
    """Misfit of each point as a sum of logarithms, which is insensitive to the size of large differences."""
    unknowns = campaign.system.base
    return [
        float(np.sum(np.log1p((r / 10) ** 2))) + cost_at(unknowns, u, np.zeros(0))
        for u, r in zip(points, campaign.residuals(unknowns, points), strict=True)
    ]


def scattered(unknowns: Sequence[Unknown]) -> list[Floats]:
    """Points u from the priors, evenly."""
    if not unknowns:
        return []
    sd, mean = np.array([k.sd for k in unknowns]), np.array([k.mean for k in unknowns])
    return [clipped(unknowns, mean + sd * row) for row in normal(len(unknowns))]


def normal(dimensions: int) -> Floats:
    """Points of a standard normal distribution, evenly: (DRAWN, dimensions)."""
    from scipy.stats import norm, qmc  # slow to import

    even = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(0)).random(DRAWN)
    return np.asarray(norm.ppf(even))


def check_simulated(campaign: Campaign, fit: Fit) -> None:
    """Raise ReplayError for a run that cannot be simulated with the base's fit."""
    (row,) = campaign.misfits(fit.unknowns, [fit.u])
    for observed, one in zip(campaign.observations, row, strict=True):
        if one is None:
            raise ReplayError(campaign.system.cannot_follow(observed))
