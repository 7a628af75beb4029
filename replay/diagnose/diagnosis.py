"""The inquiry: base fit, every cause alone, the best in pairs, the judgement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import base_unknowns
from straw.replay.diagnose.inquiry import Inquiry, Told, allow_repeats
from straw.replay.diagnose.judge import run_by_run, unexplained
from straw.replay.diagnose.knocks import deep
from straw.replay.diagnose.library import causes
from straw.replay.diagnose.observation import Observation
from straw.replay.diagnose.pairs import in_pairs, in_their_place
from straw.replay.diagnose.search import Fit, descend
from straw.replay.diagnose.stages import (
    AFTERWARDS,
    AWAY,
    CLOSE,
    EXPLAINED,
    FINISHED,
    FINISHED_NEARBY,
    HOPELESS,
    LOUD,
    NEARLY,
    ROUGHLY,
    ROUNDS,
    base_anew,
    by_outlines,
    finish_best,
    from_nearby,
    from_the_winner,
    until_they_fork,
    weigh_anew,
)
from straw.replay.diagnose.start import base_start, few_of
from straw.replay.errors import ReplayError

#: Steps after which a search that is not thorough leaves out what only may help, and after which it ends where it is:
#: on two cores 18.2 million took 165 s, on a slower day 23.1 million 334 s. What is found before every cause was
#: carried as far as it goes names nothing.
PATIENCE, LONGEST = 6.5e6, 17.5e6


def _silent(_what: str, _done: int, _total: int) -> None:
    """Say nothing."""


def inquire(
    observations: Sequence[Observation],
    straw: StrawParameters,
    *,
    library: Sequence[str] | None = None,
    executor: Executor,
    thorough: bool = False,
    told: Told = _silent,
    stop: Callable[[], bool] = lambda: False,
) -> Inquiry:
    """Fit the base and every cause in the library (all by default), alone and in pairs, until done or stopped.

    Raises ReplayError where a run cannot be played at all.

    ``executor`` plays runs: a `ThreadPoolExecutor` (the compiled model releases the GIL), or a Dask client's
    ``client.get_executor()``. It must outlive what is asked of the inquiry later.
    """
    names = [n for n in causes(straw.cells) if library is None or n in library]
    for observed in observations:
        observed.rest_of(straw)
    campaign = Campaign(observations, straw, executor, stop, np.inf if thorough else PATIENCE)
    campaign.stop = lambda: stop() or (not thorough and campaign.tally["steps"] > LONGEST)
    found = _searched(campaign, names, thorough, told)
    campaign.tally["left_out"] += campaign.stop()
    found.whole = found.whole and not stop()
    campaign.stop = stop
    return found


def _searched(campaign: Campaign, names: Sequence[str], thorough: bool, told: Told) -> Inquiry:
    """The inquiry of a campaign until it is done or is stopped."""
    observations, straw, total = campaign.observations, campaign.straw, len(names) + 5
    base = base_unknowns(straw)
    told("base model", 0, total)
    start = base_start(campaign, base)
    null = descend(campaign, base, start, rounds=8, enough=5.0)
    if _unplayed(campaign, null):  # it was led astray; where the given constants can be played it stays with them
        null = descend(campaign, base, np.zeros(len(base)), rounds=ROUNDS, enough=5.0)
    if unplayed := _unplayed(campaign, null):
        raise ReplayError(
            f"run {unplayed[0]}: the straw cannot be played from where this run starts, neither with the constants "
            "given nor with those that fit; check initial_deployed and the straw, or leave the run out"
        )
    left_each = run_by_run(campaign, null)
    wide, left = campaign.only(few_of(observations, left_each)).roughly(), sum(left_each)
    known = null
    if left > EXPLAINED:  # the base may be stuck: outlines lead on, and only what they leave is missing
        known = descend(wide, base, start, rounds=ROUNDS, share=ROUGHLY)
        null = min(null, descend(campaign, base, known.u, rounds=ROUNDS), key=lambda fit: fit.cost)
        left = unexplained(campaign, null)
    loud = left > LOUD or (left > EXPLAINED and not deep(known))  # else outlines show nothing that the base does not
    if not loud:
        null = descend(campaign, base, null.u, rounds=ROUNDS)
    allow_repeats(campaign, null)
    null = descend(campaign, base, null.u, rounds=4 if loud else ROUNDS)
    found = Inquiry(campaign, null)
    told("looking at every cause", 1, total)
    done: dict[str, float] = {}  # costs of those carried to their end
    worth = NEARLY * null.cost if loud else null.cost - HOPELESS  # what costs more is not carried there
    if loud:
        by_outlines(found, wide, known, start, names, thorough, told)
        finish_best(found, 1, done, worth)
    if thorough or not loud or EXPLAINED < unexplained(campaign, found.best) < AWAY:
        from_nearby(found, names, AFTERWARDS if loud else None, thorough, told)
    if campaign.stop():
        return found
    told("finishing the best", len(names) + 2, total)
    finish_best(found, FINISHED + (0 if loud else FINISHED_NEARBY) + 3 * thorough, done, worth)
    until_they_fork(found, wide, done)
    found.whole = not campaign.stop()
    if found.singles and found.contestants[0].cost < found.null.cost - HOPELESS:
        if loud:
            weigh_anew(found, done)
        base_anew(found)
        before, found.whole = found.contestants[0].cost, not campaign.stop()
        enough = unexplained(campaign, found.best) <= EXPLAINED
        # only the base had been far off: what is missing is small, and is looked for as such
        nearby = loud and found.null.cost < found.contestants[0].cost + CLOSE and not campaign.leaves_out()
        if nearby:
            from_nearby(found, names, None, thorough, told)
            finish_best(found, len(done) + FINISHED, done, found.null.cost - HOPELESS)
        if thorough or (loud and enough and not nearby):
            from_the_winner(found, wide, names, done)
        told("pairs", len(names) + 3, total)
        if thorough or not enough:
            in_pairs(found, wide, names, thorough)
            in_their_place(found, wide, names, thorough)
        if found.contestants[0].cost < before:  # the base may be led on by it: till then nothing is named for sure
            base_anew(found)
            found.whole = not campaign.stop() or unexplained(campaign, found.best) > EXPLAINED
    told("weighing", len(names) + 4, total)
    return found


def _unplayed(campaign: Campaign, fit: Fit) -> list[str]:
    """Names of runs that cannot be played with a fit."""
    (row,) = campaign.misfits(fit.unknowns, [fit.u])
    return [o.name for o, one in zip(campaign.observations, row, strict=True) if one is None]
