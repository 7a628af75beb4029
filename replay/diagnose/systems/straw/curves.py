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
from straw.replay.diagnose.fit import Fit, evaluated, fitted
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.refine import refined, without_a_run
from straw.replay.diagnose.settings import COARSE_ROUNDS, ROUNDS
from straw.replay.diagnose.systems.straw.base import telling_runs
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.curve import Curve, searched, with_points
from straw.replay.diagnose.systems.straw.of import straw_of
from straw.replay.diagnose.systems.straw.promising import Start, promising
from straw.replay.diagnose.systems.straw.states import STATES, State
from straw.replay.diagnose.systems.straw.tables import bent_points, points

Floats = NDArray[np.float64]

#: States that are fitted, that are carried to the end; rounds of the first fit.
FITTED, FINISHED, FIRST_ROUNDS = 4, 2, 8
#: How often the points of a curve are moved at most, to where it bends, which halves the distance of a point from a
#: kink each time, or where the runs pass; and the share of the cost that another move to a bend has to gain.
MOVES, GAINS = 4, 0.01
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
        found.append(_finished(curve, campaign, wide) if rival else _carried_on(curve, here, 0))
    return sorted(found, key=_priced)


def _priced(curve: Curve) -> float:
    """Cost of a curve's fit with the price of the constants besides its values: each the logarithm of the number of
    samples (Schwarz, Annals of Statistics 6, 1978)."""
    return curve.fit.cost + len(curve.state.further) * float(np.log(len(curve.fit.residual)))


def beside(
    first: Curve, campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES
) -> Curve | None:
    """A second curve, over another state, fitted together with the first; None where the search was stopped."""
    here = campaign.with_system(first.campaign.system)
    wide = here.only(telling_runs(campaign, null)).coarse()
    known = evaluated(wide, first.fit.unknowns, first.fit.u, first.smooth)
    others = [state for state in states if state.name != first.state.name]
    steps, values, runs = len(others) + 2 * FITTED, len(first.at), campaign.observations
    report: Callable[[str, int], None] = lambda name, k: told(name, k, steps)  # noqa: E731
    starts = promising(wide, known, first.smooth, values, runs, report, others, FINISHED)
    if campaign.stop() or not starts:
        return None
    tried = _first_fits(starts, runs, lambda name, k: None)
    best = min(one.fit.cost for one in tried)
    finished = []
    for k, one in enumerate(tried, 1):
        told(one.state.name, k, len(tried))
        if one.fit.cost < RIVAL * best:
            finished.append(_finished(one, campaign, wide))
    return min(finished, key=_priced)


def restarted(curve: Curve, u: Floats) -> Curve:
    """The curve fitted again from elsewhere."""
    fit = replace(curve.fit, u=u)
    return _moved(_carried_on(replace(curve, fit=fit), curve.campaign, ROUNDS), curve.campaign)


def _first_fits(
    starts: Sequence[Sequence[Start]], observations: Sequence[Any], told: Callable[[str, int], None]
) -> list[Curve]:
    """The best fit over each state, the best of all first."""
    found = []
    for k, some in enumerate(starts):
        told(some[0].curve.state.name, k)
        fits = [_carried_on(one.curve, one.curve.campaign, FIRST_ROUNDS, 0.01) for one in some]
        if some[0].curve.state.further:
            fits = [_placed_where_runs_pass(one, observations) for one in fits]
        best = min(fits, key=_priced)
        for _ in range(MOVES if best.state.further else 0):
            best = _placed_where_runs_pass(best, observations)
        found.append(best)
    return sorted(found, key=_priced)


def _placed_where_runs_pass(curve: Curve, observations: Sequence[Any]) -> Curve:
    """The curve fitted on points placed where the runs pass, by its further constants as found so far."""
    fit, names = curve.fit, [k.target for k in curve.fit.unknowns]
    places = [names.index(one.target) for one in curve.state.further]
    assert curve.state.sought_from is not None
    state = curve.state.sought_from(*(fit.unknowns[k].value(float(fit.u[k])) for k in places))
    unknowns = list(fit.unknowns)
    for k, one in zip(places, state.further, strict=True):
        unknowns[k] = one
    straw, _ = applied(straw_of(curve.campaign), fit.unknowns, fit.u)
    at = points(state, [state.visited(straw, o, None) for o in observations])
    curve = replace(curve, state=state, fit=replace(fit, unknowns=tuple(unknowns)))
    if at is not None:
        curve = replace(_on_points(curve, curve.campaign, at), placed=at)
    return _carried_on(curve, curve.campaign, FIRST_ROUNDS, 0.01)


def _bent(curve: Curve, campaign: Campaign) -> Curve:
    """The curve on points that lie closer where it bends (`bent_points`), to be fitted again."""
    values = np.zeros(len(curve.points))
    values[curve.free] = curve.fit.u[curve.smooth.shape[1] - len(curve.at) :]
    return _on_points(curve, campaign, bent_points(curve.state, curve.placed, curve.points, values))


def _on_points(curve: Curve, campaign: Campaign, at: Floats) -> Curve:
    """The curve on other points (n,), to be fitted again."""
    state, fit, base = curve.state, curve.fit, curve.smooth.shape[1] - len(curve.at)
    values = np.zeros(len(curve.points))
    values[curve.free] = fit.u[base:]
    here, unknowns, smooth = with_points(campaign, fit.unknowns[:base], curve.beneath, state, at)
    scale = fit.unknowns[-1].scale
    unknowns = (*unknowns[:base], *(replace(k, scale=scale) for k in unknowns[base:]))
    where, known = (np.append(0.0, x) if state.odd else x for x in (curve.points, values))
    u = np.concatenate([fit.u[:base], np.interp(at, where, known)[searched(state, at)]])
    return replace(curve, campaign=here, smooth=smooth, points=at, fit=replace(fit, unknowns=unknowns, u=u))


def _carried_on(curve: Curve, campaign: Campaign, rounds: int, share: float = 1e-4) -> Curve:
    """The curve's fit continued, perhaps on other runs; with no rounds only evaluated there."""
    fit, smooth = curve.fit, curve.smooth
    fit = fitted(campaign, fit.unknowns, fit.u, rounds=rounds, share=share, smooth=smooth)
    return replace(curve, campaign=campaign, fit=fit)


def _finished(curve: Curve, campaign: Campaign, wide: Campaign) -> Curve:
    """The curve with its points moved to where it bends, fitted coarsely to all runs, then to all samples from several
    starts and with one run left out, as a cause of the library is."""
    curve = _moved(curve, wide)
    here = campaign.with_system(curve.campaign.system)
    coarse = _carried_on(curve, here.coarse(), COARSE_ROUNDS[-1]).fit
    fit = without_a_run(here, refined(here, coarse, ROUNDS, curve.smooth), curve.smooth)
    return _moved(replace(curve, campaign=here, fit=fit), campaign)


def _moved(curve: Curve, campaign: Campaign) -> Curve:
    """The curve fitted with its points moved to where it bends, until that gains little."""
    for _ in range(MOVES):
        other = _bent(curve, campaign)
        if np.array_equal(other.points, curve.points):
            break
        other = _carried_on(other, other.campaign, FIRST_ROUNDS)
        if not other.fit.cost < curve.fit.cost:
            break
        gain, curve = 1 - other.fit.cost / curve.fit.cost, other
        if gain < GAINS:
            break
    return curve
