"""Causes whose effects are large, and pairs of them: fitted coarsely, then refined, until one explains the runs.

First the causes and pairs that the proposal puts first, from its constants; then each cause from its own starts, and
second causes beside the leading ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, evaluated
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.pairs import nested
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.refine import explains, finish, refine
from straw.replay.diagnose.second_causes import beside_any, explained, first_fits, pairs_in_turn, second_causes
from straw.replay.diagnose.settings import SHORTLIST
from straw.replay.diagnose.tournament import by_cost, contenders, tournament

#: A cause leads where it leaves less than this share of the base's misfit: one of two does in 45 of 71 pairs
#: (`python -m tests.benchmarks.sealed`).
LEADS = 0.3
#: Causes that leave this many times as much as one that explains the comparison, briefly fitted from the proposal's
#: constants, are not fitted from their own starts, which lower that at most 7.8-fold in 24 opened cases (`python -m
#: tests.benchmarks.coarse_search`).
FAR_BEHIND = 10.0


class CoarseSearch:
    """The search among large effects, beside the base as it was fitted coarsely; it can be continued."""

    def __init__(
        self,
        found: Inquiry,
        hypotheses: Sequence[Hypothesis],
        base: Fit,
        proposal: Proposal | None,
        told: Callable[[str, Inquiry], None],
    ) -> None:
        self.found, self.hypotheses, self.base, self.proposal, self.told = found, hypotheses, base, proposal, told
        self.groups = in_turn(hypotheses, proposal)
        own = [partial(self._from_own_starts, group) for group in self.groups]
        self.stages: list[Callable[[Campaign, Fit], bool]] = [self._from_proposal, *own] if own else []
        self.singles: list[Contestant] = []  # from the proposal's constants
        self.pairs: list[Contestant] = []
        self.ranked: list[Contestant] = []  # from own starts, too
        self.waiting: list[Contestant] = []  # of these and pairs, those that are not refined
        self.beside: set[str] = set()  # causes beside which second ones were sought

    def until(self, enough: float) -> None:
        """Try what comes next, until the best leaves at most so many squared sigmas beyond noise, or nothing is left to
        try."""
        while self.stages and not self.found.campaign.stop():
            wide = telling(self.found)
            known = evaluated(wide, self.base.unknowns, self.base.u)
            refined = self.stages.pop(0)(wide, known)
            if refined and unexplained(self.found.campaign, self.found.best) <= enough:
                return

    def _from_proposal(self, wide: Campaign, known: Fit) -> bool:
        """Whether anything was good enough to be refined."""
        self.told("causes that the proposal puts first", self.found)
        pairs = pairs_in_turn(self.hypotheses, self.proposal)
        self.singles, self.pairs = first_fits(wide, known, self.groups[0], pairs, self.proposal)
        if not beside_any(self.pairs, self.singles):
            return False
        self._refine([*self.singles, *self.pairs])
        self.pairs = []
        return True

    def _from_own_starts(self, group: Sequence[Hypothesis], wide: Campaign, known: Fit) -> bool:
        """Whether anything was good enough to be refined, or nothing is left to try."""
        self.told("causes that are large", self.found)
        ranked = tournament(wide, known, self._not_far_behind(group), self.singles)
        self.ranked, self.waiting = by_cost([*self.ranked, *ranked]), by_cost([*self.waiting, *ranked])
        if not explains(known):  # if it does, a second cause does not show in the coarse comparison
            self.told("second causes beside the leading ones", self.found)
            leaders = contenders(self.ranked[:2])
            two = second_causes(wide, known, leaders, self.hypotheses, self.proposal, self.pairs, self.beside)
            self.beside.update(one.name for one in leaders)
            self.pairs, self.waiting = [], by_cost([*self.waiting, *two])
        leads = any(explains(one.fit) or one.cost < LEADS * known.cost for one in self.waiting[:1])
        if self.stages and not leads:
            return False
        self._refine(self.waiting)
        self.waiting = []
        return True

    def _not_far_behind(self, group: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Those of a group whose own starts may still make up for what they leave from the proposal's constants."""
        if not explained(self.singles):
            return list(group)
        most = FAR_BEHIND * self.singles[0].cost
        behind = {one.name for one in self.singles if one.cost > most}
        return [h for h in group if h.name not in behind]

    def _refine(self, coarse: Sequence[Contestant]) -> None:
        refine(self.found, by_cost(coarse))
        finish(self.found)
        nested(self.found)


def telling(found: Inquiry) -> Campaign:
    """The most informative runs, compared coarsely."""
    return found.campaign.only(found.campaign.system.telling(found.campaign, found.null)).coarse()


def in_turn(hypotheses: Sequence[Hypothesis], proposal: Proposal | None) -> list[list[Hypothesis]]:
    """The hypotheses that the proposal puts first, and the others."""
    groups = [list(hypotheses)]
    if proposal is not None and proposal.familiar:
        first = list(proposal.scores)[:SHORTLIST]
        groups = [[h for h in hypotheses if (h.name in first) is one] for one in (True, False)]
    return [group for group in groups if group]
