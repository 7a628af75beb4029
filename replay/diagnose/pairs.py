"""Two causes at once: small second causes beside the best single ones, and each cause of a pair alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, cost_at, fits_from
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import decisive
from straw.replay.diagnose.refine import finish, reach
from straw.replay.diagnose.screen import Start, screen
from straw.replay.diagnose.settings import (
    FAR,
    FIRST_ROUNDS,
    FOLLOWED,
    NOISE_LEAVES,
    ROUNDS,
)
from straw.replay.diagnose.tournament import fitted_contestants

Floats = NDArray[np.float64]


def find_pairs(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes that gain most to first order beside the best, and beside a rival that is close, unless they were
    sought beside the same fit before."""
    for first in found.ranked_singles[:2]:
        if first.cost <= found.best.cost + reach(found) and not any(fit is first.fit for fit in found.beside):
            found.beside.append(first.fit)
            _beside(found, first, names, FIRST_ROUNDS)
    finish(found)
    nested(found)


def shortened(campaign: Campaign, known: Fit, start: Start) -> Start:
    """A pair's start on the way there from a fit without one or both of its causes, where it is best: a linear or
    quadratic expansion may lead too far."""
    unknowns = (*known.unknowns[: len(campaign.system.base)], *start.hypothesis.unknowns)
    at = {unknown.target: float(u) for unknown, u in zip(known.unknowns, known.u, strict=True)}
    absent = np.where([one.kind == "strength" for one in unknowns], 0.0, start.u)
    origin = np.array([at.get(one.target, none) for one, none in zip(unknowns, absent, strict=True)])
    points = [origin + (start.u - origin) / 2**k for k in range(FOLLOWED)]
    costs = [cost_at(unknowns, u, r) for u, r in zip(points, campaign.residuals(unknowns, points), strict=True)]
    return replace(start, u=points[int(np.argmin(costs))])


def seconds(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes below the noise of a sample that over all samples gain enough to make a cause as probable as none:
    selected to first order beside the best single causes, then fitted."""
    before, least = len(found.pairs), decisive()
    for first in found.ranked_singles[:2]:
        if first.cost <= min(found.null.cost - least, found.best.cost + FAR):
            _beside(found, first, names, ROUNDS, least)
    if len(found.pairs) > before:
        nested(found)


def _beside(found: Inquiry, first: Contestant, names: Sequence[str], rounds: int, least: float = -np.inf) -> None:
    """The second causes that gain most to first order beside a first one, and more than ``least``, fitted; also those
    of pairs that leave more than the first alone, which they contain: the search for them ended in a local minimum."""
    campaign = found.campaign
    others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
    poor = {one.name for one in found.pairs.values() if one.cost > first.cost}
    least = max(least, first.cost - found.best.cost - reach(found))  # what leaves more is not continued either
    screened = enumerate(screen(campaign, first.fit, others, first.hypothesis))
    some = [s for k, s in screened if (k < FOLLOWED or s.hypothesis.name in poor) and s.gain > least]
    starts = [shortened(campaign, first.fit, start) for start in some if not campaign.stop()]
    for one in fitted_contestants(campaign, starts, rounds, found.null.unknowns):
        found.keep(one)


def nested(found: Inquiry) -> None:
    """Each cause of the best pair, and of others as good but for noise, alone from the pair's constants: if the other
    cause has no effect, the search for the single one had ended in another local minimum."""
    best = found.contestants[0] if found.contestants else None
    if best is None or len(best.hypothesis.causes) == 1:
        return
    near = [one for one in found.contestants if one.name in found.pairs and one.cost <= best.cost + NOISE_LEAVES]
    alone = [(found.campaign.hypothesis([name]), one.fit) for one in near[:FOLLOWED] for name in one.hypothesis.causes]
    starts = [((*found.null.unknowns, *one.unknowns), fit) for one, fit in alone]
    fits = fits_from(found.campaign, [(some, _u_of(some, fit)) for some, fit in starts], rounds=ROUNDS)
    for (one, _), fit in zip(alone, fits, strict=True):
        found.keep(Contestant(one, fit))


def _u_of(unknowns: Sequence[Unknown], fit: Fit) -> Floats:
    """Some of a fit's u, by target."""
    at = {unknown.target: float(u) for unknown, u in zip(fit.unknowns, fit.u, strict=True)}
    return np.array([at[unknown.target] for unknown in unknowns])
