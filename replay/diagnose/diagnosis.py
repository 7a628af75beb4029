"""The whole way from observations to an inquiry: what is asked, of whom, with which workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from straw.replay.diagnose.bootstrap import accept
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.explain import explain
from straw.replay.diagnose.inquiry import Inquiry, Told, silent
from straw.replay.diagnose.pairs import nested
from straw.replay.diagnose.system import Recording, System


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

    Raises ReplayError where a run cannot be simulated at all. A search that takes more than the system's
    ``most_work`` steps ends where it is, on every machine at the same place, and says so.

    ``before``: what was found with fewer runs of the same specimen, whose base constants are one more start.

    ``executor`` works out residuals: a `ThreadPoolExecutor` (the compiled model releases the GIL), or a Dask client's
    ``client.get_executor()``. It must outlive what is asked of the inquiry later.
    """
    names = [n for n in system.causes if library is None or n in library]
    system.ready(observations)
    proposal = system.propose(observations, names) if names else None
    campaign = Campaign(observations, system, executor, stop)
    campaign.stop = lambda: stop() or campaign.tally["work"] > system.most_work
    found = explain(campaign, names, told, proposal, before.null.u if before else None)
    found.whole, found.spent = not stop(), campaign.tally["work"] > system.most_work
    campaign.stop = stop  # what is asked of the inquiry later has a budget of its own
    if found.spent:  # without each cause fitted alone, one that does nothing would be named beside the other
        nested(found)
    if found.whole:
        accept(found, names)
    return found
