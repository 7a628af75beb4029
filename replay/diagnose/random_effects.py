"""Random effects: every run may differ a little from the others; linearised at the best fit that is known.

As in first-order conditional estimation of mixed-effects models (Lindstrom and Bates, Biometrics 46, 1990): what a
repeat's own damping or elasticity does near a bifurcation depends on where the fit is, and a base that lacks a strong
cause is far from it.
"""

from __future__ import annotations

from dataclasses import replace

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, cost_at
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.settings import NOISE_LEAVES


def linearise(campaign: Campaign, fit: Fit) -> None:
    """Include random effects of the runs, linearised at this fit, from here on."""
    campaign.random_effects = None
    directions = campaign.system.repeats(campaign, fit)
    if directions is not None:
        campaign.allow(directions)


def linearise_at_best(found: Inquiry) -> bool:
    """Linearise random effects at the best fit where it leaves less than the last by more than noise; all fits are
    whitened for them anew. Returns whether it was."""
    campaign, before = found.campaign, found.campaign.random_effects
    if before is None or found.campaign.stop() or found.linearised_at - found.best.cost <= NOISE_LEAVES:
        return False
    linearise(campaign, found.best)

    def again(fit: Fit) -> Fit:
        residual, slopes = (campaign.decorrelated(campaign.correlated(x, before)) for x in (fit.residual, fit.slopes))
        return replace(fit, residual=residual, slopes=slopes, cost=cost_at(fit.unknowns, fit.u, residual))

    found.null = again(found.null)
    for kept in (found.singles, found.pairs):
        for name, one in kept.items():
            kept[name] = replace(one, fit=again(one.fit))
    found.linearised_at = found.best.cost
    return True
