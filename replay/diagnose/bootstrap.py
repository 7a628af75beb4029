"""Whether a second cause gains more than chance: campaigns that hold the first alone, simulated to first order.

A parametric bootstrap of a likelihood ratio (McLachlan 1987), with a score test (Rao 1948) in place of a new search in
each simulated campaign. Its errors are what the fit with both causes leaves, signs drawn block by block (a wild
bootstrap, Liu 1988): as large, as correlated in time and as heavy-tailed as in the recordings themselves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Chance, Inquiry
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.screen import linearised_beside
from straw.replay.diagnose.settings import BLOCK, BY_CHANCE

Floats = NDArray[np.float64]

#: Simulated campaigns: enough that ten of them lie beyond what is accepted.
SIMULATED = round(10 / BY_CHANCE) - 1


def accept(found: Inquiry, names: Sequence[str]) -> None:
    """Leave out the most probable pair, and the next, until one gains more than chance or a single cause leads."""
    while found.contestants:
        top = next(iter(found.judgement().probability))
        pair = found.pairs.get(top)
        alone = [found.singles[c] for c in pair.hypothesis.causes if c in found.singles] if pair else []
        if pair is None or not alone or pair.name in found.chance:
            return
        first = min(alone, key=lambda one: one.cost)
        others = [found.campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
        by_chance = chance_gains(found.campaign, first.fit, others, pair.fit.residual)
        gain = first.cost - pair.cost
        probability = (1 + int(np.sum(by_chance >= gain))) / (1 + SIMULATED)
        most = float(np.quantile(by_chance, 1 - BY_CHANCE))
        if probability <= BY_CHANCE:
            found.chance[pair.name] = Chance(first.name, gain, most, SIMULATED)
            return
        del found.pairs[pair.name]


def chance_gains(campaign: Campaign, first: Fit, others: Sequence[Hypothesis], left: Floats) -> Floats:
    """Squared sigmas that the best of ``others`` beside the ``first`` gains in each simulated campaign, (SIMULATED,).

    ``left`` (m,): residual of the fit with both causes. Strengths may have either sign here, and the known unknowns no
    prior: the first makes chance a little larger, the second smaller by what their priors hold.
    """
    root = np.sqrt(weights(first.residual))
    errors = left[:, None] * _signs(campaign, len(left)) * root[:, None]
    known, _ = np.linalg.qr(first.slopes * root[:, None])
    errors -= known @ (known.T @ errors)
    most = np.zeros(SIMULATED)
    for _, _, _, columns in linearised_beside(campaign, first, others):
        own = columns * root[:, None]
        own = own - known @ (known.T @ own)
        basis, size, _ = np.linalg.svd(own, full_matrices=False)
        basis = basis[:, size > 1e-6 * max(size.max(), 1e-300)]
        most = np.maximum(most, np.sum((basis.T @ errors) ** 2, axis=0))
    return most


def _signs(campaign: Campaign, size: int) -> Floats:
    """A sign for every block of every channel of every run, and for every time of an event, (size, SIMULATED)."""
    rng, out = np.random.default_rng(0), np.empty((size, SIMULATED))
    for observed, part in zip(campaign.observations, campaign.slices(), strict=True):
        channels, samples = observed.seen.shape
        blocks = np.arange(samples) // BLOCK
        of = np.concatenate([blocks + k * (blocks[-1] + 1) for k in range(channels)])
        events = part.stop - part.start - len(of)
        of = np.concatenate([of, of[-1] + 1 + np.arange(events)])
        out[part] = rng.choice([-1.0, 1.0], size=(of[-1] + 1, SIMULATED))[of]
    return out
