"""Explains a campaign: the base model, every cause of the library, the best in pairs; proposed, then fitted exactly.

The causes that the proposal puts first are fitted from their own starts, by successive halving
(`straw.replay.diagnose.tournament`), in a coarse comparison of the most informative runs; where one of them explains
it, the survivors are fitted to all samples of all runs. Where these leave more than noise, single causes and pairs are
selected by fits of all causes at once (`straw.replay.diagnose.at_once`), and then every other cause is fitted from its
own starts.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.at_once import at_once, proposed
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, evaluated, fitted
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry, Told
from straw.replay.diagnose.judge import CALIBRATION, unexplained
from straw.replay.diagnose.pairs import find_pairs, seconds, telling
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.random_effects import linearise, one_run_misfits, to_conditional_mode
from straw.replay.diagnose.refine import explains, finish, refine
from straw.replay.diagnose.rivals import absent, as_before, from_each_other
from straw.replay.diagnose.screen import Start, screen
from straw.replay.diagnose.settings import FAR, FIRST_ROUNDS, ROUNDS, SHORTLIST
from straw.replay.diagnose.starts import check_simulated, fit_from_priors
from straw.replay.diagnose.tournament import fitted_contestants, tournament

Floats = NDArray[np.float64]

#: Largest number of stages of progress.
STAGES = 11
#: A cause leads where it leaves less than this share of the base's misfit: one of two does in 32 of 47 pairs
#: (`python -m tests.benchmarks.sealed`), beside which the other is sought with what is left of the budget.
LEADS = 0.3


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
    tried: set[str] = set()
    if far:  # a first-order expansion around a poor fit is not informative
        tried = _large(found, hypotheses, wide_known, proposal, steps)
    if not found.contestants or not far or found.goes_on:
        steps("causes that are small", found)
        left = found.goes_on
        starts = screen(campaign, found.null, hypotheses)[:SHORTLIST]
        worth = [start for start in starts if left or start.gain > CALIBRATION.scale]
        for one in fitted_contestants(campaign, worth, FIRST_ROUNDS):
            found.keep(one)
        finish(found)
    if not far and found.goes_on:
        tried = _large(found, hypotheses, wide_known, proposal, steps)
    if found.goes_on:
        steps("pairs", found)
        find_pairs(found, names)
        if found.goes_on:  # the best may be in a poor minimum, or a wrong one
            _from_own_starts(found, [h for h in hypotheses if h.name not in tried], wide_known, proposal, steps)
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


def _large(
    found: Inquiry, hypotheses: Sequence[Hypothesis], base: Fit, proposal: Proposal | None, steps: _Steps
) -> set[str]:
    """The causes that the proposal puts first by themselves; where none of them explains the coarse comparison, all
    causes at once, and from there single causes and pairs; if much is left, each cause from its own starts. Returns the
    names of those that were fitted from them."""
    wide = telling(found)
    known = evaluated(wide, base.unknowns, base.u)
    first, *others = _in_turn(hypotheses, proposal)
    ranked: list[Contestant] = []
    if others:  # costs less than all at once
        steps("causes that are large", found)
        ranked = tournament(wide, known, first, _proposed(found, known, proposal))
        if any(explains(one.fit) or one.cost < LEADS * known.cost for one in ranked):
            refine(found, ranked)
            finish(found)
            ranked = []
            left, of = (unexplained(found.campaign, fit) for fit in (found.best, found.null))
            if found.goes_on and left < LEADS * of:  # what is left may be a second cause's
                steps("second causes beside the leading one", found)
                find_pairs(found, [h.name for h in hypotheses])
    tried = {h.name for h in first} if others and not ranked else set()
    if not found.goes_on or explains(known):  # if it does, all causes cannot be told from each other at once
        return tried
    steps("all causes at once", found)
    tried |= at_once(found, wide, known, hypotheses, proposal)
    if unexplained(found.campaign, found.best) <= FAR:
        return tried
    if ranked:
        refine(found, ranked)
        finish(found)
        tried |= {h.name for h in first}
    if found.goes_on:
        _from_own_starts(found, [h for h in hypotheses if h.name not in tried], base, proposal, steps)
    return {h.name for h in hypotheses}


def _from_own_starts(
    found: Inquiry, hypotheses: Sequence[Hypothesis], base: Fit, proposal: Proposal | None, steps: _Steps
) -> None:
    """Each cause from its own starts, the proposal's first ones before the others, until one explains the runs."""
    wide = telling(found)
    known = evaluated(wide, base.unknowns, base.u)
    for group in _in_turn(hypotheses, proposal):
        steps("causes that are large", found)
        refine(found, tournament(wide, known, group, _proposed(found, known, proposal)))
        finish(found)
        if not found.goes_on:
            return


def _proposed(found: Inquiry, known: Fit, proposal: Proposal | None) -> list[Start]:
    """The proposal's starts of single causes."""
    causes = [found.campaign.hypothesis([name]) for name in proposal.scores] if proposal else []
    return [start for cause in causes for start in proposed(known, cause, proposal)]


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


def _in_turn(hypotheses: Sequence[Hypothesis], proposal: Proposal | None) -> list[list[Hypothesis]]:
    """The hypotheses that the proposal puts first, and the others."""
    groups = [list(hypotheses)]
    if proposal is not None and proposal.familiar:
        first = list(proposal.scores)[:SHORTLIST]
        groups = [[h for h in hypotheses if (h.name in first) is one] for one in (True, False)]
    return [group for group in groups if group]
