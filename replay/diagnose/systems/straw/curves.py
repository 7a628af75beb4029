"""The search for curves over the states that a missing force may depend on.

The most promising states to first order (`promising.py`) are fitted to the coarse comparison, and the best of these to
all samples, with their points moved to where the curve bends. A second curve is sought beside the best in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, evaluated
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.refine import refined, without_a_run
from straw.replay.diagnose.settings import COARSE_ROUNDS, ROUNDS
from straw.replay.diagnose.systems.straw.base import telling_runs
from straw.replay.diagnose.systems.straw.curve import (
    FIRST_ROUNDS,
    MOVES,
    SHARE,
    Curve,
    carried_on,
    on_points,
    priced,
)
from straw.replay.diagnose.systems.straw.promising import Start, promising
from straw.replay.diagnose.systems.straw.states import STATES, State
from straw.replay.diagnose.systems.straw.tables import bent_points
from straw.replay.diagnose.systems.straw.toward import towards_a_point

Floats = NDArray[np.float64]

#: States that are fitted, and those that are carried to the end.
FITTED, FINISHED = 4, 2
#: Share of the cost that another move of the points to a bend has to gain.
GAINS = 0.01
#: Another state is a rival while its first fit costs less than this many times the best's.
RIVAL = 1.5
#: Constants of the base that are taken from its fit; elasticity and geometry start as given.
TAKEN_ALONG = ("straw.r_ch_m", "straw.c_zeta_n_s_per_m", "straw.c_phi_n_m_s_per_rad")


def curves(campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES) -> list[Curve]:
    """Curves over the states that promise most, the best first; the best few are carried to their end."""
    wide = campaign.only(telling_runs(campaign, null)).coarse()
    # the missing force has biased the base's constants: only damping and channel are kept
    calm = np.where([k.target in TAKEN_ALONG for k in null.unknowns], null.u, 0.0)
    known, none = evaluated(wide, null.unknowns, calm), np.zeros((0, len(calm)))
    tried, steps = len(states), len(states) + 2 * FITTED
    runs = campaign.observations
    starts = promising(wide, known, none, 0, runs, lambda name, k: told(name, k, steps), states, FITTED)
    first = _first_fits(starts, runs, lambda name, k: told(name, tried + k, steps))
    found: list[Curve] = []
    for k, curve in enumerate(first):
        told(curve.state.name, tried + FITTED + k, steps)
        here = campaign.with_system(curve.campaign.system)
        rival = len(found) < FINISHED and curve.fit.cost < RIVAL * first[0].fit.cost
        found.append(_finished(curve, campaign, wide) if rival else carried_on(curve, here, 0))
    return sorted(found, key=priced)


def beside(
    first: Curve, campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES
) -> Curve | None:
    """A second curve, over another state, fitted together with the first; None where the search was stopped."""
    here = campaign.with_system(first.campaign.system)
    wide = here.only(telling_runs(campaign, null)).coarse()
    known = evaluated(wide, first.fit.unknowns, first.fit.u, first.smooth)
    others = [state for state in states if state.name != first.state.name]
    steps, values, runs = len(others) + 2 * FITTED, len(first.at), campaign.observations
    starts = promising(wide, known, first.smooth, values, runs, lambda name, k: told(name, k, steps), others, FINISHED)
    if campaign.stop() or not starts:
        return None
    tried = _first_fits(starts, runs, lambda name, k: None)
    best = min(one.fit.cost for one in tried)
    finished = []
    for k, one in enumerate(tried, 1):
        told(one.state.name, k, len(tried))
        if one.fit.cost < RIVAL * best:
            finished.append(_finished(one, campaign, wide))
    return min(finished, key=priced)


def restarted(curve: Curve, u: Floats) -> Curve:
    """The curve fitted again from elsewhere."""
    fit = replace(curve.fit, u=u)
    return _moved(carried_on(replace(curve, fit=fit), curve.campaign, ROUNDS), curve.campaign)


def _first_fits(
    starts: Sequence[Sequence[Start]], observations: Sequence[Any], told: Callable[[str, int], None]
) -> list[Curve]:
    """The best fit over each state, the best of all first."""
    found = []
    for k, some in enumerate(starts):
        told(some[0].curve.state.name, k)
        first = some[0].curve
        if first.state.further:
            found.append(towards_a_point([one.curve for one in some], observations))
        else:
            found.append(carried_on(first, first.campaign, FIRST_ROUNDS, SHARE))
    return sorted(found, key=priced)


def _bent(curve: Curve, campaign: Campaign) -> Curve:
    """The curve on points that lie closer where it bends (`bent_points`), to be fitted again."""
    values = np.zeros(len(curve.points))
    values[curve.free] = curve.fit.u[curve.smooth.shape[1] - len(curve.at) :]
    return on_points(curve, campaign, bent_points(curve.state, curve.placed, curve.points, values))


def _finished(curve: Curve, campaign: Campaign, wide: Campaign) -> Curve:
    """The curve with its points moved to where it bends, fitted coarsely to all runs, then to all samples from several
    starts and with one run left out, as a cause of the library is."""
    curve = _moved(curve, wide)
    here = campaign.with_system(curve.campaign.system)
    coarse = carried_on(curve, here.coarse(), COARSE_ROUNDS[-1]).fit
    fit = without_a_run(here, refined(here, coarse, ROUNDS, curve.smooth), curve.smooth)
    return _moved(replace(curve, campaign=here, fit=fit), campaign)


def _moved(curve: Curve, campaign: Campaign) -> Curve:
    """The curve fitted with its points moved to where it bends, until that gains little."""
    for _ in range(MOVES):
        other = _bent(curve, campaign)
        if np.array_equal(other.points, curve.points):
            break
        other = carried_on(other, other.campaign, FIRST_ROUNDS)
        if not other.fit.cost < curve.fit.cost:
            break
        gain, curve = 1 - other.fit.cost / curve.fit.cost, other
        if gain < GAINS:
            break
    return curve
