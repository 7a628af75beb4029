"""Two causes at once: second causes beside the best single ones, large or small, and each cause of a pair alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, cost_at, evaluated, fitted
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import decisive, unexplained
from straw.replay.diagnose.refine import finish, reach, refine, refined
from straw.replay.diagnose.screen import Start, screen
from straw.replay.diagnose.settings import (
    COARSE_ROUNDS,
    FAR,
    FIRST_ROUNDS,
    FOLLOWED,
    ROUNDS,
    SHORTLIST,
    STARTS,
)
from straw.replay.diagnose.tournament import fitted_contestant, halved, look

Floats = NDArray[np.float64]


def telling(found: Inquiry) -> Campaign:
    """The most informative runs, compared coarsely."""
    return found.campaign.only(found.campaign.system.telling(found.campaign, found.null)).coarse()


def find_pairs(found: Inquiry, names: Sequence[str], proposed: Sequence[Start]) -> None:
    """Second causes beside the best, then the ``proposed`` pairs, as long as more than noise is left."""
    beside_best(found, names)
    if found.goes_on:
        screened_pairs(found, names)
        proposed_pairs(found, proposed)
        finish(found)
        nested(found)


def second_causes(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes beside the best: fitted coarsely where its fit is poor, to first order where little is left."""
    beside_best(found, names)
    if found.goes_on and unexplained(found.campaign, found.best) <= FAR:
        screened_pairs(found, names)
        finish(found)
        nested(found)


def beside_best(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes beside the best single cause whose fit is poor, once: those that gain most to first order in the
    coarse comparison, which tells them from afar, in a tournament as of single causes."""
    if found.campaign.stop() or unexplained(found.campaign, found.best) <= FAR:
        return
    best = next(iter(found.ranked_singles), None)
    if best is None or any(best.name in pair.hypothesis.causes for pair in found.pairs.values()):
        return
    wide = telling(found)
    known = fitted(wide, best.fit.unknowns, best.fit.u, rounds=COARSE_ROUNDS[0])
    others = [found.campaign.hypothesis([name]) for name in names if name not in best.hypothesis.causes]
    begun: dict[str, Contestant] = {}
    for start in screen(wide, known, others):
        name = start.hypothesis.name
        if wide.stop() or (len(begun) == SHORTLIST and name not in begun):
            continue
        starts = [shortened(wide, known, start)]
        if name not in begun and len(begun) < FOLLOWED:
            starts += look(wide, known, start.hypothesis)[:STARTS]
        fits = [fitted_contestant(wide, one, COARSE_ROUNDS[0], known.unknowns) for one in starts]
        begun[name] = min([*fits, begun.get(name, fits[0])], key=lambda c: c.cost)
    pairs = [
        Contestant(c.hypothesis.beside(best.hypothesis), c.fit) for c in halved(wide, list(begun.values()), len(begun))
    ]
    refine(found, pairs)
    finish(found)
    exchanged(found)
    nested(found)


def shortened(campaign: Campaign, known: Fit, start: Start) -> Start:
    """A start that first order leads to from a fit, on the way there where it is best: first order may lead too far."""
    n, own = len(known.unknowns), start.hypothesis.unknowns[-(len(start.u) - len(known.unknowns)) :]
    unknowns = (*known.unknowns, *own)
    origin = np.concatenate([known.u, np.where([k.kind == "strength" for k in own], 0.0, start.u[n:])])
    points = [origin + (start.u - origin) / 2**k for k in range(FOLLOWED)]
    costs = [cost_at(unknowns, u, r) for u, r in zip(points, campaign.residuals(unknowns, points), strict=True)]
    return replace(start, u=points[int(np.argmin(costs))])


def exchanged(found: Inquiry) -> None:
    """The second cause of the best pair beside the rival of its first: the cause that alone explains nearly as much."""
    campaign, pair = found.campaign, found.contestants[0]
    alone = [c for c in found.ranked_singles if c.name in pair.hypothesis.causes]
    rivals = [c for c in found.ranked_singles if c.name not in pair.hypothesis.causes]
    if len(pair.hypothesis.causes) == 1 or not alone or not rivals or campaign.stop():
        return
    first, rival = alone[0], rivals[0]
    if rival.cost > first.cost + FAR:
        return
    (second,) = (campaign.hypothesis([cause]) for cause in pair.hypothesis.causes if cause != first.name)
    u = np.concatenate([rival.fit.u, _u_of(second.unknowns, pair.fit)])
    start = evaluated(campaign.coarse(), (*rival.fit.unknowns, *second.unknowns), u)
    refine(found, [Contestant(second.beside(rival.hypothesis), start)])
    finish(found)


def screened_pairs(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes that gain most to first order beside the best, and beside a rival that is close."""
    for first in found.ranked_singles[:2]:
        if first.cost <= found.best.cost + reach(found):
            _beside(found, first, names, FIRST_ROUNDS)


def proposed_pairs(found: Inquiry, proposed: Sequence[Start]) -> None:
    """The first of the proposed pairs, fitted coarsely before."""
    wide = telling(found)
    two = [s for s in proposed if len(s.hypothesis.causes) == 2]
    for start in two[:FOLLOWED]:
        coarse = fitted_contestant(wide, start, sum(COARSE_ROUNDS), found.null.unknowns)
        found.keep(Contestant(coarse.hypothesis, refined(found.campaign, coarse.fit, FIRST_ROUNDS)))


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
    """The second causes that gain most to first order beside a first one, and more than ``least``, fitted."""
    campaign = found.campaign
    others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
    for start in screen(campaign, first.fit, others, first.hypothesis)[:FOLLOWED]:
        if start.gain > least and not campaign.stop():
            start = shortened(campaign, first.fit, start)
            found.keep(fitted_contestant(campaign, start, rounds, found.null.unknowns))


def nested(found: Inquiry) -> None:
    """Each cause of the best pair alone, from the pair's constants: if the other cause has no effect, the search for
    the single one had ended in another local minimum."""
    best = found.contestants[0] if found.contestants else None
    if best is None or len(best.hypothesis.causes) == 1:
        return
    for cause in best.hypothesis.causes:
        alone = found.campaign.hypothesis([cause])
        unknowns = (*found.null.unknowns, *alone.unknowns)
        u = _u_of(unknowns, best.fit)
        found.keep(Contestant(alone, fitted(found.campaign, unknowns, u, rounds=ROUNDS)))


def _u_of(unknowns: Sequence[Unknown], fit: Fit) -> Floats:
    """Some of a fit's u, by target."""
    at = {unknown.target: float(u) for unknown, u in zip(fit.unknowns, fit.u, strict=True)}
    return np.array([at[unknown.target] for unknown in unknowns])
