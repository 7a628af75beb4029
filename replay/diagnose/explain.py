"""Explains a campaign: the base model, every cause of the library, the best in pairs; proposed, then fitted exactly.

Every hypothesis goes the same way. Its starts (the library's, the learned proposal's, and the rivals' constants) are
looked at in a coarse comparison of the runs that tell most, the base's constants making room; the best are fitted there
(`straw.replay.diagnose.tournament`), and what is left of them to all samples of all runs.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, evaluated, fitted
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry, Told
from straw.replay.diagnose.judge import CALIBRATION, decisive, unexplained
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.refine import refined
from straw.replay.diagnose.screen import Start, screen
from straw.replay.diagnose.settings import (
    COARSE_ROUNDS,
    FAR,
    FIRST_ROUNDS,
    FOLLOWED,
    NOISE_LEAVES,
    ROUNDS,
    SHORTLIST,
)
from straw.replay.diagnose.starts import check_simulated
from straw.replay.diagnose.tournament import finished, fitted_contestant, tournament

Floats = NDArray[np.float64]

#: Stages that progress is told in, at most.
STAGES = 7


def explain(
    campaign: Campaign,
    names: Sequence[str],
    told: Told,
    proposal: Proposal | None = None,
    known: Floats | None = None,
) -> Inquiry:
    """Fit the base and every cause, alone and in pairs, until done or stopped.

    ``known``: constants u of the base as fewer runs of the same specimen had them. One run more can make the search for
    them end in a worse minimum, in which something seems to be missing.

    A ``proposal`` adds starts, and says which causes come first: where they explain the runs the others are left out,
    but not where it has seen nothing like these runs.
    """
    steps = _Steps(told, campaign)
    steps("base model")
    null, wide_known = campaign.system.fit_base(campaign, _base_start(proposal))
    if known is not None and len(known) == len(null.unknowns):
        null = min(null, fitted(campaign, null.unknowns, known, rounds=ROUNDS), key=lambda fit: fit.cost)
    check_simulated(campaign, null)
    random_effects(campaign, null)
    found = Inquiry(campaign, fitted(campaign, null.unknowns, null.u, rounds=ROUNDS))
    hypotheses = [campaign.hypothesis([name]) for name in names]
    far = unexplained(campaign, found.null) > FAR
    if far:  # to first order around a fit that is far off nothing is told
        _large(found, hypotheses, wide_known, proposal, steps)
    if not found.contestants or not far or _unexplained(found):
        steps("causes that are small", found)
        left = _unexplained(found)
        for start in screen(campaign, found.null, hypotheses)[:SHORTLIST]:
            if not campaign.stop() and (left or start.gain > CALIBRATION.scale):
                found.keep(fitted_contestant(campaign, start, FIRST_ROUNDS))
        finish(found)
    if not far and _unexplained(found):
        _large(found, hypotheses, wide_known, proposal, steps)
    if _unexplained(found):
        steps("pairs", found)
        in_pairs(found, _telling(found), names, _starts(campaign, proposal))
        finish(found)
        nested(found)
    elif not campaign.stop():
        steps("second causes that are small", found)
        seconds(found, names)
    steps("rivals from each other's constants", found)
    from_each_other(found)
    for hypothesis in hypotheses:
        if hypothesis.name not in found.singles:
            found.keep(absent(found.null, hypothesis))
    return found


def _telling(found: Inquiry) -> Campaign:
    """The runs that tell most, compared coarsely."""
    return found.campaign.only(found.campaign.system.telling(found.campaign, found.null)).coarse()


def _large(
    found: Inquiry, hypotheses: Sequence[Hypothesis], base: Fit, proposal: Proposal | None, steps: _Steps
) -> None:
    """Causes fitted coarsely from their starts, those that the proposal puts first before the others.

    Where the base explains the coarse comparison to noise (reduced chi-square below one), no cause can show there.
    """
    wide = _telling(found)
    known = evaluated(wide, base.unknowns, base.u)
    if known.cost < len(known.residual):
        return
    given = _starts(found.campaign, proposal)
    for group in _in_turn(hypotheses, proposal):
        steps("causes that are large", found)
        for one in tournament(wide, known, group, given):
            found.keep(Contestant(one.hypothesis, refined(found.campaign, one.fit, FIRST_ROUNDS)))
        finish(found)
        alternate(found)
        if not _unexplained(found):
            return


def alternate(found: Inquiry) -> None:
    """The best fitted to the coarse comparison and to all samples in turn, while it gains more than noise.

    The tournament compares only the runs that tell most; its constants may leave the others in a local minimum.
    """
    campaign, gain = found.campaign, np.inf
    while gain > NOISE_LEAVES and _unexplained(found):
        best = found.contestants[0]
        coarse = fitted(campaign.coarse(), best.fit.unknowns, best.fit.u, rounds=COARSE_ROUNDS[-1])
        found.keep(Contestant(best.hypothesis, refined(campaign, coarse, ROUNDS)))
        gain = best.cost - found.best.cost


class _Steps:
    """Says what is being done, what leads, and how long it may take at most."""

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


def _unexplained(found: Inquiry) -> bool:
    """Whether the best so far leaves more than noise, and nobody asked to stop."""
    return not found.campaign.stop() and unexplained(found.campaign, found.best) > NOISE_LEAVES


def _base_start(proposal: Proposal | None) -> list[Floats]:
    return [] if proposal is None else [np.array([s.u for s in proposal.base])]


def _starts(campaign: Campaign, proposal: Proposal | None) -> list[Start]:
    """The proposal's hypotheses with its starts, in the order to be tried."""
    out: list[Start] = []
    names = [(name,) for name in proposal.scores] if proposal else []
    pairs = [names for names, _ in proposal.hypotheses if len(names) == 2] if proposal else []
    for hypothesis in (*names, *pairs[:FOLLOWED]):
        assert proposal is not None
        for way in proposal.start(hypothesis):
            out.append(Start(campaign.hypothesis(hypothesis), np.array([s.u for s in way])))
    return out


def _in_turn(hypotheses: Sequence[Hypothesis], proposal: Proposal | None) -> list[list[Hypothesis]]:
    """The hypotheses that the proposal puts first, and the others."""
    if proposal is None or not proposal.familiar:
        return [list(hypotheses)]
    first = list(proposal.scores)[:SHORTLIST]
    groups = [[h for h in hypotheses if (h.name in first) is one] for one in (True, False)]
    return [group for group in groups if group]


def random_effects(campaign: Campaign, fit: Fit) -> None:
    """From now on allow for what repeats differ by, as felt at this fit."""
    campaign.random_effects = None
    directions = campaign.system.repeats(campaign, fit)
    if directions is not None:
        campaign.allow(directions)


def finish(found: Inquiry) -> None:
    """Carry the best few to their end, until no other is close."""
    done: set[str] = set()
    while not found.campaign.stop() and len(done) < FOLLOWED:
        waiting = [c for c in found.contestants if c.name not in done]
        if not waiting or (done and waiting[0].cost > _best_cost(found, done) + reach(found)):
            return
        found.keep(finished(found.campaign, waiting[0], ROUNDS))
        done.add(waiting[0].name)


def _best_cost(found: Inquiry, done: set[str]) -> float:
    return min(c.cost for c in found.contestants if c.name in done)


def reach(found: Inquiry) -> float:
    """How much more than the best a hypothesis may cost that is still carried on."""
    return max(NOISE_LEAVES, unexplained(found.campaign, found.best))


def in_pairs(found: Inquiry, wide: Campaign, names: Sequence[str], proposed: Sequence[Start]) -> None:
    """Second causes beside the best: by first order in all that is seen, and by a coarse tournament."""
    campaign = found.campaign
    for first in found.contestants[:2]:
        others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
        for start in screen(campaign, first.fit, others, first.hypothesis)[:FOLLOWED]:
            found.keep(fitted_contestant(campaign, start, FIRST_ROUNDS, found.null.unknowns))
    two = [s for s in proposed if len(s.hypothesis.causes) == 2]
    base = found.null.unknowns
    for start in two[:FOLLOWED]:
        coarse = fitted_contestant(wide, start, sum(COARSE_ROUNDS), base)
        found.keep(Contestant(coarse.hypothesis, refined(campaign, coarse.fit, FIRST_ROUNDS)))


def seconds(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes that stay within the noise of a sample, yet gain over all of them what makes a pair as probable as
    its first cause alone: promised to first order beside the best single causes, then fitted."""
    campaign, before = found.campaign, len(found.pairs)
    for first in found.contestants[:2]:
        highest = min(found.null.cost - decisive(CALIBRATION.cause), found.best.cost + FAR)
        if len(first.hypothesis.causes) > 1 or first.cost > highest:
            continue
        others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
        for start in screen(campaign, first.fit, others, first.hypothesis)[:FOLLOWED]:
            if start.gain > decisive(CALIBRATION.second, found.null.cost - first.cost) and not campaign.stop():
                found.keep(fitted_contestant(campaign, start, ROUNDS, found.null.unknowns))
    if len(found.pairs) > before:
        nested(found)


def nested(found: Inquiry) -> None:
    """Each cause of the best pair alone, from the pair's constants: where the other of the two does nothing, the
    search for the one alone had only ended in another local minimum."""
    best = found.contestants[0]
    if len(best.hypothesis.causes) == 1:
        return
    at = {unknown.target: float(u) for unknown, u in zip(best.fit.unknowns, best.fit.u, strict=True)}
    for cause in best.hypothesis.causes:
        alone = found.campaign.hypothesis([cause])
        unknowns = (*found.null.unknowns, *alone.unknowns)
        u = np.array([at[unknown.target] for unknown in unknowns])
        found.keep(Contestant(alone, fitted(found.campaign, unknowns, u, rounds=ROUNDS)))


def from_each_other(found: Inquiry) -> None:
    """The base, and the best rivals, once more from the constants that the best of all leaves: that a search ended in
    another local minimum is no evidence against a hypothesis."""
    campaign, n = found.campaign, len(found.null.unknowns)
    best = found.contestants[:FOLLOWED]
    if not best or found.null.cost < best[0].cost + CALIBRATION.scale:
        return  # nothing is better than the base
    for one in best:
        if found.null.cost > best[0].cost + FAR and one is not best[0]:
            break  # it is not the base's constants that are wrong
        again = fitted(campaign, found.null.unknowns, one.fit.u[:n], rounds=ROUNDS)
        found.null = min(found.null, again, key=lambda fit: fit.cost)
    for one in best[1:]:
        if one.cost < best[0].cost + FAR:
            u = np.concatenate([best[0].fit.u[:n], one.fit.u[n:]])
            found.keep(Contestant(one.hypothesis, fitted(campaign, one.fit.unknowns, u, rounds=ROUNDS)))


def absent(null: Fit, h: Hypothesis) -> Contestant:
    """A hypothesis that was not worth a fit: the base's fit with nothing of it."""
    start = np.where([k.kind == "strength" for k in h.unknowns], 0.0, h.starts[0])
    slopes = np.pad(null.slopes, ((0, 0), (0, len(h.unknowns))))
    return Contestant(
        h, Fit((*null.unknowns, *h.unknowns), np.concatenate([null.u, start]), null.residual, slopes, null.cost)
    )
