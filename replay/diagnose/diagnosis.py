"""From observations to an inquiry: the search with its proposal, budget and workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from straw.replay.diagnose.bootstrap import accept
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.explain import explain
from straw.replay.diagnose.inquiry import Inquiry, Told, silent
from straw.replay.diagnose.one_thread import one_blas_thread
from straw.replay.diagnose.pairs import nested
from straw.replay.diagnose.random_effects import linearise_at_best, to_conditional_mode
from straw.replay.diagnose.recording import Recording
from straw.replay.diagnose.refine import finish, without_a_run
from straw.replay.diagnose.settings import ROUNDS
from straw.replay.diagnose.system import System
from straw.replay.diagnose.tournament import finished

#: Share of the budget after which no further hypothesis is tried; the rest is for restarts, which would take nearly as
#: much again without a limit (41 million evaluations after 67 million in 20261129-097 with eight runs, in vain).
SEARCHED = 0.8


@one_blas_thread()
def inquire(
    observations: Sequence[Recording],
    system: System,
    *,
    library: Sequence[str] | None = None,
    executor: Executor,
    told: Told = silent,
    stop: Callable[[], bool] = lambda: False,
    before: Inquiry | None = None,
) -> Inquiry:
    """Fit the base and every cause in the library (all by default), alone and in pairs, until done or stopped.

    Raises ReplayError where a run cannot be simulated at all. A search that takes `SEARCHED` of the system's
    ``most_work`` evaluations of its equations ends there, at the same place on every machine, and reports it. With the
    rest the best hypothesis is fitted on, and restarted with one run left out where it leaves more than noise; if it
    still does, a run that misfits may have constants of its own, as far from the others' as repeats are.

    The result does not depend on the order of the recordings, which are taken in that of their names.

    ``before``: the inquiry of fewer runs of the same specimen, whose base and best hypotheses are further starts.

    ``executor`` computes residuals: a `ThreadPoolExecutor` (the compiled model releases the GIL), or a Dask client's
    ``client.get_executor()``. It must outlive later uses of the inquiry.
    """
    names = [n for n in system.causes if library is None or n in library]
    observations = sorted(observations, key=lambda one: one.name)
    system.ready(observations)
    proposal = system.propose(observations, names) if names else None
    campaign = Campaign(observations, system, executor, stop)
    campaign.stop = lambda: stop() or campaign.tally["work"] > SEARCHED * system.most_work
    found = explain(campaign, names, told, proposal, before)
    found.whole, found.spent = not stop(), campaign.tally["work"] > SEARCHED * system.most_work
    campaign.stop = lambda: stop() or campaign.tally["work"] > system.most_work
    restarted = bool(found.contestants) and (found.spent or found.goes_on)
    if restarted:
        told("the best without one of the runs", 1, 1)
        linearise_at_best(found)
        best = finished(campaign, found.contestants[0], ROUNDS)
        found.keep(replace(best, fit=without_a_run(campaign, best.fit)))
        while found.goes_on and to_conditional_mode(found):
            finish(found)
    campaign.stop = stop  # later uses of the inquiry have a budget of their own
    if restarted:
        nested(found)  # unless each cause is fitted alone, one without effect would be named beside the other
    if found.whole:
        accept(found, names)
    return found
