"""Pairs of causes in a coarse comparison: the proposal's first ones, and second causes beside the best single ones.

Coarsely, a leading cause that is right ends near its constants even where another acts beside it, and the other is
mostly among those that gain most to first order; sample by sample, the same fits end in local minima of ringing and of
snaps in another order.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.judge import CALIBRATION
from straw.replay.diagnose.pairs import shortened
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.refine import explains
from straw.replay.diagnose.screen import Start, screen
from straw.replay.diagnose.settings import COARSE_ROUNDS, FOLLOWED
from straw.replay.diagnose.tournament import best_of_each, briefly_fitted, by_cost, halved, near, proposed

#: Pairs that the proposal puts first: 9 of 14 opened pairs are among them, and no more among twice as many (`python -m
#: tests.benchmarks.proposing --split two --seed 20261218 --cases 14`).
PAIRS = 6
#: Squared sigmas that a second cause promises to gain coarsely beside one that explains the comparison, from which on
#: the pair is fitted before the first is refined: beside eight right single causes others promise at most 45, beside
#: the first of two, where both are needed, the other 59 to 175 in four of five (`python -m
#: tests.benchmarks.coarse_search`).
SHOWS = 45.0


def first_fits(
    wide: Campaign,
    base: Fit,
    causes: Sequence[Hypothesis],
    pairs: Sequence[Hypothesis],
    proposal: Proposal | None,
) -> tuple[list[Contestant], list[Contestant]]:
    """Causes, and pairs as long as none of these explains the comparison, fitted from the proposal's constants: the
    first of both that are near after a few evaluations are continued, to their ends where a pair is better. The best
    first."""
    alone = from_proposal(wide, base, causes, proposal)
    two = [] if explained(alone) else from_proposal(wide, base, pairs, proposal)
    some = [one for group in (alone, two) for one in group[:FOLLOWED] if near(one)]
    every = by_cost(best_of_each([*alone, *two, *halved(wide, some, 2 * len(some), COARSE_ROUNDS[1:2])]))
    alone, two = ([one for one in every if len(one.hypothesis.causes) == n] for n in (1, 2))
    if beside_any(two, alone):
        two = by_cost(best_of_each([*two, *halved(wide, two, len(two), COARSE_ROUNDS[2:])]))
    return alone, two


def from_proposal(
    wide: Campaign, base: Fit, hypotheses: Sequence[Hypothesis], proposal: Proposal | None
) -> list[Contestant]:
    """Hypotheses fitted briefly from the proposal's constants, the best first."""
    starts = [proposed(base, h, proposal) for h in hypotheses]
    return by_cost([briefly_fitted(wide, base, [[start] for start in ways]) for ways in starts if ways])


def pairs_in_turn(hypotheses: Sequence[Hypothesis], proposal: Proposal | None) -> list[Hypothesis]:
    """The pairs that the proposal puts first."""
    by_name = {h.name: h for h in hypotheses}
    pairs = [names for names, _ in proposal.hypotheses if len(names) == 2] if proposal else []
    return [by_name[b].beside(by_name[a]) for a, b in pairs if a in by_name and b in by_name][:PAIRS]


def explained(some: Sequence[Contestant]) -> bool:
    """Whether any of them explains the coarse comparison."""
    return any(explains(one.fit) for one in some)


def beside_any(pairs: Sequence[Contestant], singles: Sequence[Contestant]) -> bool:
    """Whether a pair explains the coarse comparison and leaves less than each single cause."""
    least = min((one.cost for one in singles), default=np.inf) - CALIBRATION.scale
    return any(explains(one.fit) and one.cost < least for one in pairs)


def second_causes(
    wide: Campaign,
    base: Fit,
    leaders: Sequence[Contestant],
    hypotheses: Sequence[Hypothesis],
    proposal: Proposal | None,
    begun: Sequence[Contestant] = (),
    done: Collection[str] = (),
) -> list[Contestant]:
    """Second causes beside single ones that lead, but for those that are ``done``, which gain most to first order or
    cannot be expanded, fitted coarsely, and pairs that are ``begun``; the best first. Where a single one explains the
    comparison, only causes that promise to show."""
    alone = explained(leaders)
    some = [one for one in begun if not alone or one.cost < leaders[0].cost - CALIBRATION.scale]
    for first in (one for one in leaders if one.name not in done):
        others = [h for h in hypotheses if h.name not in first.hypothesis.causes]
        screened = screen(wide, first.fit, others, first.hypothesis)
        starts = {s.hypothesis.name: s for s in reversed(screened)}  # the best of each one's shapes
        most = [*dict.fromkeys(s.hypothesis.name for s in screened)][:FOLLOWED]
        names = [name for name in most if not alone or starts[name].gain > SHOWS]
        for h in others:
            pair = h.beside(first.hypothesis)
            if wide.stop() or ((pair.name in starts or alone) and pair.name not in names):
                continue
            own = [start.u[len(base.unknowns) :] for start in proposed(base, h, proposal)]
            groups = [[Start(pair, np.concatenate([first.fit.u, u]))] for u in own]
            if pair.name in starts:
                groups.append([shortened(wide, first.fit, starts[pair.name])])
            some.append(briefly_fitted(wide, base, groups))
    best = best_of_each(some)
    return halved(wide, best, len(best))
