"""Two causes at once: second causes beside the best single ones, large or small, and each cause of a pair alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, evaluated, fitted
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import decisive, unexplained
from straw.replay.diagnose.refine import finish, refine, refined
from straw.replay.diagnose.screen import Start, screen
from straw.replay.diagnose.settings import COARSE_ROUNDS, FAR, FIRST_ROUNDS, FOLLOWED, NOISE_LEAVES, ROUNDS
from straw.replay.diagnose.tournament import fitted_contestant, tournament


def telling(found: Inquiry) -> Campaign:
    """The most informative runs, compared coarsely."""
    return found.campaign.only(found.campaign.system.telling(found.campaign, found.null)).coarse()


def find_pairs(found: Inquiry, names: Sequence[str], first: Sequence[str], proposed: Sequence[Start]) -> None:
    """Second causes beside the best: fitted coarsely where its fit is poor (those among ``first``), to first order
    where more than noise is left."""
    beside_best(found, first)
    if not found.campaign.stop() and unexplained(found.campaign, found.best) > NOISE_LEAVES:
        screened_pairs(found, names, proposed)
        finish(found)
        nested(found)


def beside_best(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes beside the best single cause that is far off: a tournament as of single causes, once."""
    if found.campaign.stop() or unexplained(found.campaign, found.best) <= FAR:
        return
    best = next((c for c in found.contestants if len(c.hypothesis.causes) == 1), None)
    if best is None or any(best.name in pair.hypothesis.causes for pair in found.pairs.values()):
        return
    wide = telling(found)
    known = evaluated(wide, best.fit.unknowns, best.fit.u)
    others = [found.campaign.hypothesis([name]) for name in names if name not in best.hypothesis.causes]
    both = [Contestant(c.hypothesis.beside(best.hypothesis), c.fit) for c in tournament(wide, known, others, [])]
    refine(found, both)
    finish(found)
    nested(found)


def screened_pairs(found: Inquiry, names: Sequence[str], proposed: Sequence[Start]) -> None:
    """Second causes that gain most to first order beside the best two, and the ``proposed`` pairs."""
    campaign, wide = found.campaign, telling(found)
    for first in [c for c in found.contestants if len(c.hypothesis.causes) == 1][:2]:
        others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
        for start in screen(campaign, first.fit, others, first.hypothesis)[:FOLLOWED]:
            found.keep(fitted_contestant(campaign, start, FIRST_ROUNDS, found.null.unknowns))
    two = [s for s in proposed if len(s.hypothesis.causes) == 2]
    base = found.null.unknowns
    for start in two[:FOLLOWED]:
        coarse = fitted_contestant(wide, start, sum(COARSE_ROUNDS), base)
        found.keep(Contestant(coarse.hypothesis, refined(campaign, coarse.fit, FIRST_ROUNDS)))


def seconds(found: Inquiry, names: Sequence[str]) -> None:
    """Second causes below the noise of a sample that over all samples gain enough to make a cause as probable as none:
    selected to first order beside the best single causes, then fitted."""
    campaign, before, least = found.campaign, len(found.pairs), decisive()
    singles = [c for c in found.contestants if len(c.hypothesis.causes) == 1]
    for first in singles[:2]:
        if first.cost > min(found.null.cost - least, found.best.cost + FAR):
            continue
        others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
        for start in screen(campaign, first.fit, others, first.hypothesis)[:FOLLOWED]:
            if start.gain > least and not campaign.stop():
                found.keep(fitted_contestant(campaign, start, ROUNDS, found.null.unknowns))
    if len(found.pairs) > before:
        nested(found)


def nested(found: Inquiry) -> None:
    """Each cause of the best pair alone, from the pair's constants: if the other cause has no effect, the search for
    the single one had ended in another local minimum."""
    best = found.contestants[0] if found.contestants else None
    if best is None or len(best.hypothesis.causes) == 1:
        return
    at = {unknown.target: float(u) for unknown, u in zip(best.fit.unknowns, best.fit.u, strict=True)}
    for cause in best.hypothesis.causes:
        alone = found.campaign.hypothesis([cause])
        unknowns = (*found.null.unknowns, *alone.unknowns)
        u = np.array([at[unknown.target] for unknown in unknowns])
        found.keep(Contestant(alone, fitted(found.campaign, unknowns, u, rounds=ROUNDS)))
