"""Single causes and pairs selected by fits of all causes at once, then fitted by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, clipped, cost_at
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.pairs import nested, shortened
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.refine import explains, finish, refine
from straw.replay.diagnose.saturated import subsets
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.settings import COARSE_ROUNDS, FOLLOWED, STARTS
from straw.replay.diagnose.tournament import finished, fitted_contestants, halved, look


def at_once(
    found: Inquiry, wide: Campaign, base: Fit, hypotheses: Sequence[Hypothesis], proposal: Proposal | None
) -> set[str]:
    """The most promising single causes of fits of all causes at once, and pairs where no single one explains the
    coarse comparison, fitted coarsely from there and from the proposal's constants, then finished. As long as none
    explains it, singles have their own starts as well; pairs start on the way from the base's and their causes' fits,
    too. Returns the names of singles that were fitted from all of these."""
    rankings = subsets(wide, base, hypotheses, _likely(found.campaign, base, proposal))
    begun: list[Contestant] = []
    tried: set[str] = set()
    for starts in foremost(rankings, 1):
        hypothesis = starts[0].hypothesis
        own = proposed(base, hypothesis, proposal)
        if not _explained(begun):
            own += look(wide, base, hypothesis)[:STARTS]
            tried.add(hypothesis.name)
        begun.append(_begun(wide, base, [*([start] for start in starts), own]))
    if begun and not _explained(begun):  # a fit continued costs less than those of four pairs
        begun.sort(key=lambda one: one.cost)
        begun[0] = finished(wide, begun[0], COARSE_ROUNDS[1])
    if not _explained(begun):
        begun += [_pair(wide, base, starts, begun, proposal) for starts in foremost(rankings, 2)]
    refine(found, halved(wide, begun, len(begun)))
    finish(found)
    nested(found)
    return tried


def _explained(begun: Sequence[Contestant]) -> bool:
    return any(explains(one.fit) for one in begun)


def _pair(
    wide: Campaign, base: Fit, starts: Sequence[Start], singles: Sequence[Contestant], proposal: Proposal | None
) -> Contestant:
    """A pair from its starts, also on the way there from the fits of the base and of its causes alone."""
    hypothesis = starts[0].hypothesis
    origins = [base, *(one.fit for one in singles if one.name in hypothesis.causes)]
    groups = [[start, *(shortened(wide, fit, start) for fit in origins)] for start in starts]
    return _begun(wide, base, [*groups, proposed(base, hypothesis, proposal)])


def foremost(rankings: Sequence[Sequence[Start]], size: int) -> list[list[Start]]:
    """Hypotheses of ``size`` causes that come first in any of the rankings, each with its starts of all of them."""
    of_size = [[start for start in ranked if len(start.hypothesis.causes) == size] for ranked in rankings]
    names = dict.fromkeys(start.hypothesis.name for level in zip(*of_size, strict=True) for start in level)
    return [[s for ranked in of_size for s in ranked if s.hypothesis.name == name] for name in [*names][:FOLLOWED]]


def _begun(wide: Campaign, base: Fit, groups: Sequence[Sequence[Start]]) -> Contestant:
    """A hypothesis fitted for a few rounds from the best start of each group, which may lie in other basins."""
    firsts: list[Start] = []
    for starts in groups:
        if starts:
            unknowns = (*base.unknowns, *starts[0].hypothesis.unknowns)
            points = [clipped(unknowns, start.u) for start in starts]
            costs = [cost_at(unknowns, u, r) for u, r in zip(points, wide.residuals(unknowns, points), strict=True)]
            firsts.append(replace(starts[0], u=points[int(np.argmin(costs))]))
    return min(fitted_contestants(wide, firsts, COARSE_ROUNDS[0], base.unknowns, brief=True), key=lambda c: c.cost)


def proposed(base: Fit, hypothesis: Hypothesis, proposal: Proposal | None) -> list[Start]:
    """Starts from the proposal's constants, ordered as the unknowns; two where a sign is open, none without one."""
    unknowns = (*base.unknowns, *hypothesis.unknowns)
    ways = proposal.start(hypothesis.causes) if proposal else ()
    at = [{one.unknown.target: one.u for one in way} for way in ways]
    return [Start(hypothesis, np.array([way[one.target] for one in unknowns])) for way in at]


def _likely(campaign: Campaign, base: Fit, proposal: Proposal | None) -> list[Start]:
    """A start of each cause that the proposal takes for more likely present than not."""
    names = [name for name, score in proposal.scores.items() if score > 0.5] if proposal else []
    return [proposed(base, campaign.hypothesis([name]), proposal)[0] for name in names]
