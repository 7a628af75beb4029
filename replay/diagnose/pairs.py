"""Pairs of causes: the best with a second one beside each, and with what looks like either in its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import (
    Contestant,
    finish,
    followed,
    looks,
    narrowed,
    nothing_yet,
    only,
    ranked,
    tried,
)
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.search import Fit, known_well
from straw.replay.diagnose.stages import CLOSE, FAR, LOUD, NEARLY, ROUGHLY, ROUNDS, TAKEN_OUT, seen_fully, without

#: Causes that get partners; second causes tried by outlines, and from nearby, where linear reckoning is better; pairs
#: carried on.
PARTNERS, SECONDS, NEAR_SECONDS, PAIRS = 2, 9, 6, 3
#: Causes tried in the place of each of the best pair's.
ALIKE = 2


def in_pairs(found: Inquiry, wide: Campaign, names: Sequence[str], thorough: bool) -> None:
    """The best single causes with a second one beside each, tried in a few runs: from nearby or, where much is left, by
    outlines; the best pairs are carried on in all runs."""
    campaign = found.campaign
    singles = sorted(found.singles.values(), key=lambda c: c.cost)
    best = singles[0]
    outlined = unexplained(campaign, best.fit) > LOUD
    few, rows = campaign.among([o.name for o in wide.observations])
    where = wide if outlined else few
    most = None if thorough else SECONDS if outlined else NEAR_SECONDS
    two: list[Contestant] = []
    partners = 1 if campaign.leaves_out() else PARTNERS + thorough
    for one in [c for c in singles if thorough or c.cost < NEARLY * best.cost][:partners]:
        at = finish(wide, one, rounds=ROUNDS, share=ROUGHLY).fit if outlined else _seen_in(few, rows, one)
        two += _beside(where, at, one.hypothesis, [n for n in names if n not in one.hypothesis.causes], most)
    better: dict[str, Contestant] = {}
    for pair in sorted(two, key=lambda c: c.cost):  # either of a pair's causes may have been the first
        better.setdefault(pair.name, pair)
    two = sorted((followed(where, pair) for pair in list(better.values())[: PAIRS + 1]), key=lambda c: c.cost)
    if outlined:
        two = [finish(wide, pair, rounds=ROUNDS, share=ROUGHLY) for pair in two[:PAIRS]]
    seen_fully(found, two, PAIRS + 2 * thorough, outlined=outlined)
    first = sorted(found.pairs.values(), key=lambda c: c.cost)[:PAIRS]
    for pair in first if outlined else ():  # from nearby they were carried to their end at once
        close = pair.cost < first[0].cost + CLOSE and not campaign.stop()
        if close and (pair is first[0] or not campaign.leaves_out()):
            found.keep(finish(campaign, pair, rounds=ROUNDS))
    for name in dict.fromkeys((best.name, *first[0].hypothesis.causes)) if first else ():
        led_on(found, name)


def in_their_place(found: Inquiry, wide: Campaign, names: Sequence[str], thorough: bool) -> None:
    """Where a pair is best, another cause in the place of either, tried in a few runs: what looks like one of a pair
    is heard as it was among single causes. Who promises most is carried on in all runs."""
    campaign, pair = found.campaign, found.contestants[0]
    if len(pair.hypothesis.causes) == 1:
        return
    few, rows = campaign.among([o.name for o in wide.observations])
    there = narrowed(pair.fit, rows)
    worth = there.cost + CLOSE
    others = [name for name in names if name not in pair.hypothesis.causes]
    for name in pair.hypothesis.causes:
        kept = campaign.hypothesis([name])
        at = only(few, there, (*found.null.unknowns, *kept.unknowns))
        tries = sorted(_beside(few, at, kept, others, ALIKE * (1 + thorough)), key=lambda c: c.cost)
        near = [followed(few, one) for one in tries[:1] if one.cost < FAR * worth]
        seen_fully(found, [one for one in near if one.cost < worth], 1, outlined=False)


def led_on(found: Inquiry, name: str) -> None:
    """Fit a single cause once more from where its pairs lead when what is beside it is taken out: fitted less well
    than they, it would make them look needed."""
    beside = [c for c in found.contestants if name in c.hypothesis.causes and c.name != name]
    single = found.singles[name]
    for fit in without(found, single.fit, beside[:TAKEN_OUT], most=1, below=np.inf):
        found.keep(Contestant(single.hypothesis, fit))


def _seen_in(few: Campaign, rows: NDArray[np.intp], one: Contestant) -> Fit:
    """A contestant as a few runs show it; one whose slopes only outlines have shown is fitted to these runs first."""
    if len(one.fit.slopes) == len(one.fit.residual):
        return narrowed(one.fit, rows)
    return finish(few, one).fit


def _beside(where: Campaign, at: Fit, first: Hypothesis, names: Sequence[str], most: int | None) -> list[Contestant]:
    """A first cause with each of the others that promise most, a little way from several starts."""
    out: list[Contestant] = []
    known = [at] if where.rough else known_well(where, at)
    seen = looks(where, at, names) + ([] if where.rough else nothing_yet(where, at, names))
    for group in ranked(seen, at)[:most]:
        if where.stop():
            break
        out.append(tried(where, known, group[: 2 if where.rough else 1], onto=first))
    return out
