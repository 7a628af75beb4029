"""Stages of an inquiry: causes by outlines, from nearby, from the winner's constants, finished, the base once more."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import (
    Contestant,
    finish,
    followed,
    looks,
    nothing_yet,
    ranked,
    released,
    seen_again,
    taken_out,
    tried,
    unfitted,
)
from straw.replay.diagnose.forks import forks
from straw.replay.diagnose.hypothesis import dragged, held
from straw.replay.diagnose.inquiry import Inquiry, Told, allow_repeats
from straw.replay.diagnose.judge import run_by_run, unexplained
from straw.replay.diagnose.knocks import knocked
from straw.replay.diagnose.search import Fit, cost_at, descend, known_well

Floats = NDArray[np.float64]

#: Rounds a search may take to its end; most take ten.
ROUNDS = 40
#: A search by outlines ends when a round gains less than this share of the cost.
ROUGHLY = 3e-3
#: Gain over the base below which a cause is not worth more fitting.
HOPELESS = 12.0
#: What is unexplained up to this, sigmas squared, may be the noise's own; beyond it causes are looked for in outlines
#: first, as the base's constants have been dragged away.
EXPLAINED = 300.0
#: Beside a first cause the base is nearly right; beyond this unexplained second ones are looked for in outlines, too.
LOUD = 1000.0
#: Where the best cause leaves more than this, no cause is looked for from near the base either.
AWAY = 10_000.0
#: What the wide search leaves this little above the base may still win when it is finished.
NEARLY = 1.3
#: Starts of a cause that are tried.
STARTS = 4
#: A rival this much behind is not close, whatever more fitting would bring.
CLOSE = 1000.0
#: Rivals this near are fitted once more when what repeats differ by has been felt anew.
REVIEWED = 300.0
#: Beyond this many causes, one that by linear reckoning leaves this many times what the best leaves once it is tried is
#: not tried itself; one that is tried and leaves as much is not followed.
FOREMOST, FAR = 5, 4.0
#: Causes followed of all that are tried from near the base; tried there after outlines left much; of those tried by
#: outlines followed, carried on, and from there by all that is seen.
NEARBY, AFTERWARDS, FOLLOWED, CARRIED_ON, SEEN_FULLY = 9, 3, 10, 6, 4
#: Of these, how many are carried on in outlines of all runs first, and knocked out of valleys: half a minute of CPU.
KNOCKED = 1
#: Causes that are tried once more from the winner's constants.
RIVALS = 9
#: Whose outlines fit this many times worse than the best's is not carried on.
HOPEFUL = 2.5
#: Causes that are carried to the end, and beyond these where little is missing.
FINISHED, FINISHED_NEARBY = 3, 1
#: How many of the best are asked which runs fork.
JUDGES = 2
#: How many of the best are taken out to see whether what is left is fitted better from there.
TAKEN_OUT = 3


def by_outlines(
    found: Inquiry, wide: Campaign, known: Fit, start: Floats, names: Sequence[str], thorough: bool, told: Told
) -> None:
    """Fit every cause to outlines of a few runs, the best further, and the best of these to all that is seen.

    ``known`` is the base's fit to these outlines, from ``start``. Where the base has given way to what is missing, the
    way back is long: then elasticity and geometry are held to what is given while causes are tried.
    """
    free = found.null.unknowns
    if dragged(free, known.u):
        known = descend(wide, held(free), start, rounds=ROUNDS, share=ROUGHLY)
    told("looking at every cause", 1, len(names) + 5)
    first: list[Contestant] = []
    best = np.inf
    for k, group in enumerate(ranked(looks(wide, known, names), known)):
        if wide.stop():
            return
        told(group[0].name, k + 2, len(names) + 5)
        if not thorough and k >= FOREMOST and min(look.promise for look in group) > FAR * best:
            one = unfitted(wide, known, group[0])
        else:
            one = tried(wide, [known], group[: STARTS + 3 * thorough])
        best = min(best, one.cost)
        first.append(released(one, free))
    first.sort(key=lambda c: c.cost)
    near = [thorough or (k < FOLLOWED and one.cost < FAR * best) for k, one in enumerate(first)]
    entered = [followed(wide, one) if close else one for one, close in zip(first, near, strict=True)]
    entered.sort(key=lambda c: c.cost)
    hopeful = [c for c in entered if c.cost < HOPEFUL * entered[0].cost][: CARRIED_ON * (1 + thorough)]
    further = [finish(wide, c, rounds=ROUNDS, share=ROUGHLY) for c in hopeful]
    for one in entered:
        found.keep(Contestant(one.hypothesis, seen_again(found.campaign, one.fit)))
    seen_fully(found, further, SEEN_FULLY * (1 + thorough))


def from_nearby(found: Inquiry, names: Sequence[str], most: int | None, thorough: bool, told: Told) -> None:
    """Fit causes to all that is seen from the base's optimum: the ``most`` that promise most by linear reckoning, or
    all, as after light damping's long ringing it promises 3 where 300 are to be gained."""
    campaign, null = found.campaign, found.null
    known = known_well(campaign, null)
    seen = looks(campaign, null, names)
    for look in seen:
        found.keep(unfitted(campaign, null, look))
    near = ranked([*seen, *nothing_yet(campaign, null, names)], null)
    first = []
    for group in near if thorough else near[:most]:
        if campaign.stop():
            return
        told(group[0].name, len(names), len(names) + 5)
        first.append(tried(campaign, known, group[: 3 if thorough else 2]))
    first.sort(key=lambda c: c.cost)
    for k, one in enumerate(first):
        fitted = followed(campaign, one) if thorough or k < NEARBY else one
        if fitted.cost < null.cost - HOPELESS:  # with nothing of it a cause would share in the base's own probability
            found.keep(fitted)


def seen_fully(found: Inquiry, fitted: Sequence[Contestant], most: int, *, outlined: bool = True) -> None:
    """Take contestants that were fitted to outlines, or to a few runs, on to all that is seen, the best first."""
    campaign = found.campaign
    for k, one in enumerate(sorted(fitted, key=lambda c: c.cost)[:most]):
        if campaign.stop():
            return
        if outlined and k < KNOCKED:
            one = knocked(campaign.roughly(), one, ROUNDS, ROUGHLY)
        # from nearby all will be close, so they are carried to their end at once
        found.keep(finish(campaign, one, rounds=4 if outlined else ROUNDS))


def until_they_fork(found: Inquiry, wide: Campaign, done: dict[str, float]) -> None:
    """Look at runs only until they fork, as the best of those done or the base shows it, and carry these to their end
    once more."""
    campaign, rivals = found.campaign, sorted(done, key=lambda name: done[name])[:JUDGES]
    if campaign.stop():
        return
    fits = {name: found.singles[name].fit for name in rivals} | {"complete": found.null}
    ends = {name: forks(campaign, fit) for name, fit in fits.items()}
    name = min(ends, key=lambda name: _left_before(campaign, fits[name], ends[name]))
    if not ends[name]:
        return
    rows = campaign.seen_until(ends[name])
    campaign.look_until(ends[name])
    wide.look_until(ends[name])
    found.forked = ends[name]
    for known, one in found.singles.items():  # what was seen of all runs, and not of outlines, still holds
        if len(one.fit.slopes) == len(one.fit.residual):
            found.singles[known] = Contestant(one.hypothesis, replace(one.fit, slopes=one.fit.slopes[rows]))
    allow_repeats(campaign, fits[name])
    found.singles = {name: Contestant(c.hypothesis, seen_again(campaign, c.fit)) for name, c in found.singles.items()}
    found.null = descend(campaign, found.null.unknowns, found.null.u, rounds=ROUNDS)
    for name in done:
        found.singles[name] = finish(campaign, found.singles[name], rounds=ROUNDS)
        done[name] = found.singles[name].cost


def _left_before(campaign: Campaign, fit: Fit, ends: Mapping[str, float]) -> float:
    """What a fit leaves unexplained of runs that do not fork."""
    each = zip(campaign.observations, run_by_run(campaign, fit), strict=True)
    return sum(left for observed, left in each if observed.name not in ends)


def weigh_anew(found: Inquiry, done: Mapping[str, float]) -> None:
    """Judge everybody with what repeats differ by at the winner's optimum, where the base has been far from it.

    Away from where it is felt all is charged more, so whoever was near before is fitted once more.
    """
    campaign, winner = found.campaign, min(found.singles.values(), key=lambda c: c.cost)
    rivals = [name for name in done if found.singles[name].cost < winner.cost + REVIEWED]
    allow_repeats(campaign, winner.fit)
    found.singles = {name: Contestant(c.hypothesis, seen_again(campaign, c.fit)) for name, c in found.singles.items()}
    for name in dict.fromkeys((winner.name, *rivals)):
        found.singles[name] = finish(campaign, found.singles[name], rounds=4)
    found.null = seen_again(campaign, found.null)


def base_anew(found: Inquiry) -> None:
    """Fit the base once more, also from where the best leave its constants: one fitted less well would be no judge."""
    null, best = found.null, found.contestants[:TAKEN_OUT]
    close = null.cost - best[0].cost < CLOSE
    again = [descend(found.campaign, null.unknowns, null.u, rounds=ROUNDS)] if close else []
    led = without(found, null, best, most=TAKEN_OUT if close else 1, below=np.inf if close else null.cost)
    found.null = min((null, *again, *led), key=lambda fit: fit.cost)


def without(found: Inquiry, fit: Fit, others: Sequence[Contestant], most: int, below: float) -> list[Fit]:
    """A fit once more from the best places to which linear reckoning leads when others' causes beside it are taken out,
    where it costs less than ``below`` already."""
    campaign, unknowns = found.campaign, fit.unknowns
    starts = [taken_out(one.fit, unknowns) for one in others if len(one.fit.slopes) == len(fit.residual)]
    residuals = campaign.residuals(unknowns, starts)
    costs = [cost_at(unknowns, u, residual) for u, residual in zip(starts, residuals, strict=True)]
    best = [k for k in np.argsort(costs, kind="stable")[:most] if costs[k] < below]
    return [descend(campaign, unknowns, starts[k], residual=residuals[k], rounds=ROUNDS) for k in best]


def from_the_winner(found: Inquiry, wide: Campaign, names: Sequence[str], done: Collection[str]) -> None:
    """Causes that were left behind, or ended far away, are tried once more, by outlines, from the winner's constants of
    the base: that a search ended in another valley is no evidence against a cause."""
    winner, base = min(found.singles.values(), key=lambda c: c.cost), found.null.unknowns
    known = descend(wide, base, winner.fit.u[: len(base)], rounds=0)
    before = {name: one.cost for name, one in found.singles.items()}
    others = [name for name in names if name not in done or before[name] > winner.cost + CLOSE]
    first = []
    for group in ranked(looks(wide, known, others), known)[:RIVALS]:
        if wide.stop():
            return
        first.append(tried(wide, [known], group[:2]))
    first.sort(key=lambda c: c.cost)
    further = [finish(wide, one, rounds=ROUNDS, share=ROUGHLY) for one in first[: RIVALS // 2]]
    hopeful = HOPEFUL * seen_again(wide, winner.fit).cost
    seen_fully(found, [one for one in further if one.cost < hopeful], RIVALS // 3)
    for name in list(found.singles):
        if wide.stop():
            return
        cost = found.singles[name].cost
        anew = name not in done or cost < before[name]
        if anew and cost < found.singles[winner.name].cost + CLOSE:
            found.singles[name] = finish(found.campaign, found.singles[name], rounds=ROUNDS)


def finish_best(found: Inquiry, most: int, done: dict[str, float], worth: float) -> None:
    """Carry the best few single causes that cost less than ``worth`` to their end, as long as one may still overtake
    the best of those ``done``."""
    while len(done) < most:
        waiting = [c for c in found.singles.values() if c.name not in done and c.cost < worth]
        if not waiting or found.campaign.stop():
            return
        next_one = min(waiting, key=lambda c: c.cost)
        if done:
            best = found.singles[min(done, key=lambda name: done[name])]
            if next_one.cost - best.cost > max(CLOSE, unexplained(found.campaign, best.fit)):
                return
        found.singles[next_one.name] = finish(found.campaign, next_one, rounds=ROUNDS)
        done[next_one.name] = found.singles[next_one.name].cost
