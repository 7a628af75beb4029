"""The whole way from observations to an inquiry: what is asked, of whom, with which workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from model.parameters import StrawParameters
from replay.diagnose.campaign import Campaign
from replay.diagnose.explain import explain
from replay.diagnose.inquiry import Inquiry, Told
from replay.diagnose.library import causes
from replay.diagnose.observation import Observation
from replay.diagnose.propose.proposal import propose


def _silent(_what: str, _done: int, _total: int) -> None:
    """Say nothing."""


def inquire(
    observations: Sequence[Observation],
    straw: StrawParameters,
    *,
    library: Sequence[str] | None = None,
    executor: Executor,
    told: Told = _silent,
    stop: Callable[[], bool] = lambda: False,
) -> Inquiry:
    """Fit the base and every cause in the library (all by default), alone and in pairs, until done or stopped.

    Raises ReplayError where a run cannot be simulated at all.

    ``executor`` works out residuals: a `ThreadPoolExecutor` (the compiled model releases the GIL), or a Dask client's
    ``client.get_executor()``. It must outlive what is asked of the inquiry later.
    """
    names = [n for n in causes(straw.cells) if library is None or n in library]
    for observed in observations:
        observed.rest_of(straw)
    proposal = propose(observations, straw, names) if names else None
    return explain(Campaign(observations, straw, executor, stop), names, told, proposal)
