"""Random effects: every run may differ a little from the others; linearised at the best fit that is known.

As in first-order conditional estimation of mixed-effects models (Lindstrom and Bates, Biometrics 46, 1990): what a
repeat's own damping or elasticity does near a bifurcation depends on where the fit is, and a base that lacks a strong
cause is far from it. A run that goes the other way at a bifurcation is not reached by any expansion about the constants
of the others; its own ones are then sought, and the expansion is about these (the conditional mode).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign, RandomEffects
from straw.replay.diagnose.fit import Fit, cost_at, evaluated, fits_from
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import run_by_run
from straw.replay.diagnose.robust import robust_cost
from straw.replay.diagnose.settings import FIRST_ROUNDS, FOLLOWED, NOISE_LEAVES
from straw.replay.diagnose.starts import normal

Floats = NDArray[np.float64]

#: Draws of a run's own constants are this many times as wide as repeats differ: in 20261129-000 a run goes as recorded
#: three deviations from the others.
SPREAD = 3.0
#: Deviation in u of the constants that are held meanwhile: none to speak of.
HELD = 1e-6


def linearise(campaign: Campaign, fit: Fit) -> None:
    """Include random effects of the runs, linearised at this fit and the runs' own constants, from here on."""
    campaign.random_effects = None
    directions = campaign.system.repeats(campaign, fit)
    if directions is not None:
        campaign.allow(directions, _offset(campaign, fit) if campaign.own else None)


def _offset(campaign: Campaign, fit: Fit) -> Floats:
    """What the derivatives at a fit say of the runs' own constants, (m,)."""
    slopes = evaluated(campaign, fit.unknowns, fit.u).slopes
    steps = [campaign.own.get(o.name, {}) for o in campaign.observations]
    parts = zip(campaign.slices(), steps, strict=True)
    return np.concatenate([slopes[part] @ [own.get(k.target, 0.0) for k in fit.unknowns] for part, own in parts])


def linearise_at_best(found: Inquiry) -> bool:
    """Linearise random effects at the best fit where it leaves less than the last by more than noise; all fits are
    whitened for them anew. Returns whether it was.

    What they leave once whitened does not count: two expansions of which each favours the other's fit would alternate.
    """
    campaign, before, left = found.campaign, found.campaign.random_effects, found.best.cost
    if before is None or campaign.stop() or found.linearised_at - left <= NOISE_LEAVES:
        return False
    linearise(campaign, found.best)
    _whiten_anew(found, before)
    found.linearised_at = left
    return True


def _whiten_anew(found: Inquiry, before: Sequence[RandomEffects], changed: str | None = None) -> None:
    """Whiten all fits for the present random effects; only a run whose own constants changed is simulated."""
    campaign = found.campaign
    offset = np.concatenate([one.offset for one in before])

    def again(fit: Fit) -> Fit:
        residual = campaign.whitened(campaign.correlated(fit.residual, before) + offset)
        slopes = campaign.decorrelated(campaign.correlated(fit.slopes, before))
        for part, observed in zip(campaign.slices(), campaign.observations, strict=True):
            if observed.name == changed:
                there = evaluated(campaign.only([changed]), fit.unknowns, fit.u)
                residual[part], slopes[part] = there.residual, there.slopes
        return replace(fit, residual=residual, slopes=slopes, cost=cost_at(fit.unknowns, fit.u, residual))

    found.null = again(found.null)
    for kept in (found.singles, found.pairs):
        for name, one in kept.items():
            kept[name] = replace(one, fit=again(one.fit))


def one_run_misfits(campaign: Campaign, fit: Fit) -> bool:
    """Whether a fit explains all of three or more runs but one: an effect that is missing shows in more than one, while
    one run may go the other way at a bifurcation."""
    left = run_by_run(campaign, fit)
    return len(left) > 2 and sum(left) - max(left) <= NOISE_LEAVES < max(left)


@dataclass(frozen=True)
class _Mode:
    """Constants of a run's own beside a fit, by target, steps in u, and the fit's cost with them."""

    run: str
    own: dict[str, float]
    fit: Fit
    cost: float


def to_conditional_mode(found: Inquiry) -> bool:
    """Give the run that misfits most beside one of the best fits, of the base where there is no other, constants of its
    own where that fit then leaves less than the best, by more than noise, and nothing of that run; it is then simulated
    with them in all fits. Returns whether it was done."""
    campaign, before, most = found.campaign, found.campaign.random_effects, found.best.cost - NOISE_LEAVES
    if before is None:
        return False
    fits = [c.fit for c in found.contestants[:FOLLOWED]] or [found.null]
    modes = [one for fit in fits if (one := _mode(campaign, fit)) and one.cost < most]
    if not modes:
        return False
    best = min(modes, key=lambda one: one.cost)
    campaign.own[best.run] = best.own
    linearise(campaign, best.fit)
    _whiten_anew(found, before, best.run)
    found.linearised_at = found.best.cost
    return True


def _mode(campaign: Campaign, fit: Fit) -> _Mode | None:
    """The conditional mode of the run that misfits most, from draws; None where none misfits, or it still does."""
    left, steps = run_by_run(campaign, fit), campaign.system.repeat_steps(fit.unknowns)
    worst = int(np.argmax(left))
    run, part = campaign.observations[worst].name, campaign.slices()[worst]
    if not steps or left[worst] <= NOISE_LEAVES or run in campaign.own or campaign.stop():
        return None
    alone = campaign.only([run])
    alone.random_effects = None
    # the other constants are held where they are by their priors
    held = tuple(
        replace(one, mean=float(u), sd=steps.get(k, HELD))
        for k, (one, u) in enumerate(zip(fit.unknowns, fit.u, strict=True))
    )
    draws = SPREAD * normal(len(steps)) * list(steps.values())
    points = list(np.tile(fit.u, (len(draws), 1)))
    for u, draw in zip(points, draws, strict=True):
        u[list(steps)] += draw
    costs = [cost_at(held, u, r) for u, r in zip(points, alone.residuals(held, points), strict=True)]
    starts = [(held, points[k]) for k in np.argsort(costs, kind="stable")[:FOLLOWED]]
    best = min(fits_from(alone, starts, rounds=FIRST_ROUNDS), key=lambda one: one.cost)
    own = {fit.unknowns[k].target: float(best.u[k] - fit.u[k]) for k in steps}
    alone.own = {run: own}
    linearise(alone, fit)
    there = evaluated(alone, fit.unknowns, fit.u)
    if sum(run_by_run(alone, there)) > NOISE_LEAVES:
        return None
    return _Mode(run, own, fit, fit.cost - robust_cost(fit.residual[part]) + robust_cost(there.residual))
