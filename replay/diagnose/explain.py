"""Explains a campaign: the base model, every cause of the library, the best in pairs; proposed, then fitted exactly.

Where the base leaves little, causes are selected to first order. Where it leaves much, causes and pairs are fitted in a
coarse comparison of the most informative runs, and the best of them to all samples of all runs
(`straw.replay.diagnose.coarse_search`).
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.coarse_search import CoarseSearch
from straw.replay.diagnose.fit import fitted
from straw.replay.diagnose.inquiry import Inquiry, Told
from straw.replay.diagnose.judge import CALIBRATION, unexplained
from straw.replay.diagnose.pairs import find_pairs, seconds
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.random_effects import linearise, one_run_misfits, to_conditional_mode
from straw.replay.diagnose.refine import finish
from straw.replay.diagnose.rivals import absent, as_before, from_each_other
from straw.replay.diagnose.screen import screen
from straw.replay.diagnose.settings import FAR, FIRST_ROUNDS, NOISE_LEAVES, ROUNDS, SHORTLIST
from straw.replay.diagnose.starts import check_simulated, fit_from_priors
from straw.replay.diagnose.tournament import fitted_contestants

Floats = NDArray[np.float64]

#: Largest number of stages of progress.
STAGES = 9


def explain(
    campaign: Campaign,
    names: Sequence[str],
    told: Told,
    proposal: Proposal | None = None,
    before: Inquiry | None = None,
) -> Inquiry:
    """Fit the base and every cause, alone and in pairs, until done or stopped.

    ``before``: the inquiry of fewer runs of the same specimen, whose base and best hypotheses are starts, too. With one
    run more the search may end in a worse minimum, in which something else seems to be missing.

    A ``proposal`` adds starts and an order of causes: where the first ones explain the runs the others are left out,
    unless the runs are outside its training distribution.
    """
    steps, given = _Steps(told, campaign), _base_start(proposal)
    steps("base model")
    null, wide_known = campaign.system.fit_base(campaign, given) or fit_from_priors(campaign, given)
    if before and [k.target for k in before.null.unknowns] != [k.target for k in null.unknowns]:
        before = None  # its constants are others
    if before:
        null = min(null, fitted(campaign, null.unknowns, before.null.u, rounds=ROUNDS), key=lambda fit: fit.cost)
    check_simulated(campaign, null)
    linearise(campaign, null)
    found = Inquiry(campaign, fitted(campaign, null.unknowns, null.u, rounds=FIRST_ROUNDS))
    far = unexplained(campaign, found.null) > FAR
    if far and one_run_misfits(campaign, found.null) and to_conditional_mode(found):
        found.null = fitted(campaign, null.unknowns, found.null.u, rounds=FIRST_ROUNDS)
        far = unexplained(campaign, found.null) > FAR
    if not far:
        found.null = fitted(campaign, null.unknowns, found.null.u, rounds=ROUNDS)
    hypotheses = [campaign.hypothesis([name]) for name in names]
    if before:
        as_before(found, before, names)
    search = CoarseSearch(found, hypotheses, wide_known, proposal, steps)
    if far:  # a first-order expansion around a poor fit is not informative
        search.until(FAR)
    if not found.contestants or not far or found.goes_on:
        steps("causes that are small", found)
        left = found.goes_on
        starts = screen(campaign, found.null, hypotheses)
        # what is found to first order only may gain more by far, so none that counts is left out where nothing follows
        worth = starts[:SHORTLIST] if left else [start for start in starts if start.gain > CALIBRATION.scale]
        for one in fitted_contestants(campaign, worth, FIRST_ROUNDS):
            found.keep(one)
        finish(found)
    if not far and found.goes_on:
        search.until(FAR)
    if found.goes_on:
        steps("pairs", found)
        find_pairs(found, names)
        if found.goes_on:  # the best may be in a poor minimum, or a wrong one
            search.until(NOISE_LEAVES)
            if found.goes_on:
                find_pairs(found, names)
    elif not campaign.stop():
        steps("second causes that are small", found)
        seconds(found, names)
    steps("rivals from each other's constants", found)
    found.null = fitted(campaign, found.null.unknowns, found.null.u, rounds=ROUNDS)
    from_each_other(found)
    for hypothesis in hypotheses:
        if hypothesis.name not in found.singles:
            found.keep(absent(found.null, hypothesis))
    return found


class _Steps:
    """Reports the activity, the leading hypothesis, and the longest time left."""

    def __init__(self, told: Told, campaign: Campaign) -> None:
        self.told, self.campaign, self.done, self.began_s = told, campaign, 0, time.monotonic()

    def __call__(self, what: str, found: Inquiry | None = None) -> None:
        text = what
        work, most = self.campaign.tally["work"], self.campaign.system.most_work
        if work and np.isfinite(most):
            text += f", at most {max((time.monotonic() - self.began_s) * (most / work - 1), 0.0):.0f} s more"
        if found and found.contestants and found.best.cost < found.null.cost - CALIBRATION.scale:
            text += f"; {found.contestants[0].name} leads, {100 * found.best.cost / found.null.cost:.2g} % left"
        self.told(text, self.done, STAGES)
        self.done += 1


def _base_start(proposal: Proposal | None) -> list[Floats]:
    return [] if proposal is None else [np.array([s.u for s in proposal.base])]
