"""From a coarse fit to all samples: multi-start over the coarse posterior.

Sample by sample, a ringing tip agrees only with one that rings in phase, so the fit to all samples has a minimum for
every missed cycle. All of them lie where the coarse comparison, which ignores phase, is nearly as good as at its best:
starts are drawn there, and the best are followed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, cost_at, fits_from, fitted, moved
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import CALIBRATION, run_by_run, unexplained
from straw.replay.diagnose.random_effects import linearise_at_best
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.settings import (
    COARSE_ROUNDS,
    EXPLAINED,
    FIRST_ROUNDS,
    FOLLOWED,
    NOISE_LEAVES,
    ROUNDS,
    WIDENED,
)
from straw.replay.diagnose.starts import normal
from straw.replay.diagnose.tournament import all_finished, contenders, finished

Floats = NDArray[np.float64]


def refined(campaign: Campaign, coarse: Fit, rounds: int, smooth: Floats | None = None) -> Fit:
    """The fit to all samples from a coarse one, and from draws about it where it leaves more than noise.

    A coarse fit that does not explain the coarse comparison lacks more than the right cycle of a ring: it is continued
    briefly, and without draws, unless a run cannot be simulated where it ends, which has no slope.
    ``smooth``: roughness penalty of a curve, as in `fitted`.
    """
    close = explains(coarse)
    plain = fitted(campaign, coarse.unknowns, coarse.u, rounds=rounds if close else FIRST_ROUNDS, smooth=smooth)
    if campaign.stop() or (not close and follows(campaign, plain)) or unexplained(campaign, plain) <= NOISE_LEAVES:
        return plain
    return min(plain, from_draws(campaign, coarse, rounds, smooth), key=lambda fit: fit.cost)


def from_draws(campaign: Campaign, about: Fit, rounds: int, smooth: Floats | None = None) -> Fit:
    """The best fit from draws about another, which may be of the coarse comparison."""
    points = drawn(about, len(campaign.system.base), smooth)
    residuals = campaign.residuals(about.unknowns, points)
    costs = [cost_at(about.unknowns, u, r, smooth) for u, r in zip(points, residuals, strict=True)]
    best = [points[k] for k in np.argsort(costs, kind="stable")[:FOLLOWED]] or [about.u]
    ends = fits_from(campaign, [(about.unknowns, u) for u in best], rounds=FIRST_ROUNDS, smooth=smooth)
    end = min(ends, key=lambda fit: fit.cost)
    if rounds > FIRST_ROUNDS:
        end = fitted(campaign, about.unknowns, end.u, rounds=rounds, smooth=smooth)
    return end


def without_a_run(campaign: Campaign, fit: Fit, smooth: Floats | None = None) -> Fit:
    """The fit restarted from one that leaves out a run that misfits, the worst first, as long as that ends in another,
    better minimum: by more than the squared sigmas that count as one.

    One run that rings out of phase or snaps in another order can hold a fit to all runs in a local minimum. Leaving out
    what misfits most and fitting again are taken from the concentration steps of least trimmed squares (Rousseeuw and
    Van Driessen, Data Mining and Knowledge Discovery 12, 2006); here all runs count in the end. ``smooth`` as in
    `fitted`.
    """
    waiting = _misfitting(campaign, fit)
    while waiting and not campaign.stop():
        rest = campaign.only([o.name for o in campaign.observations if o.name != waiting[0]])
        start = fitted(rest, fit.unknowns, fit.u, rounds=ROUNDS, smooth=smooth)
        other = fitted(campaign, fit.unknowns, start.u, rounds=ROUNDS, smooth=smooth)
        if other.cost < fit.cost - CALIBRATION.scale:
            fit, waiting = other, _misfitting(campaign, other)
        else:
            waiting = waiting[1:]
    return fit


def _misfitting(campaign: Campaign, fit: Fit) -> list[str]:
    """The runs that differ by more than noise, the worst first, at most FOLLOWED; none where all together do not."""
    left = run_by_run(campaign, fit)
    if sum(left) <= NOISE_LEAVES or len(left) == 1:
        return []
    order = sorted(range(len(left)), key=lambda k: -left[k])
    return [campaign.observations[k].name for k in order if left[k] > 0][:FOLLOWED]


def follows(campaign: Campaign, fit: Fit) -> bool:
    """Whether every run can be simulated at a fit."""
    (row,) = campaign.misfits(fit.unknowns, [fit.u])
    return all(one is not None for one in row)


def explains(coarse: Fit) -> bool:
    """Whether a fit explains the coarse comparison to its noise."""
    return coarse.cost < EXPLAINED * len(coarse.residual)


def drawn(fit: Fit, known: int, smooth: Floats | None = None) -> list[Floats]:
    """Points u about a fit: the first ``known`` unknowns, which determine the frequency, drawn evenly from their
    posterior, ``WIDENED`` times as wide; the others at their conditional mean. ``smooth`` as in `fitted`."""
    if not known:
        return []
    w, sd = weights(fit.residual), np.array([k.sd for k in fit.unknowns])
    information = (fit.slopes * w[:, None]).T @ fit.slopes / WIDENED**2 + np.diag(1 / sd**2)
    if smooth is not None:
        information += smooth.T @ smooth
    covariance = np.linalg.inv(information)
    own = covariance[:known, :known]
    follow = np.linalg.solve(own, covariance[:known]).T  # (unknowns, known), the identity first
    return [moved(fit.unknowns, fit.u, follow @ step) for step in normal(known) @ np.linalg.cholesky(own).T]


def refine(found: Inquiry, coarse: Sequence[Contestant]) -> None:
    """Coarse fits, the best first, continued to all samples. The best two are fitted coarsely to all runs before, as
    the most informative ones may leave others in a local minimum, and continued with draws, where the second costs no
    more above the best than that leaves, beyond which hypotheses are not continued either (`reach`). As long as none
    explains the coarse comparison, they are fitted to it from draws as well: cells that snap in another order are a
    minimum of their own."""
    campaign, wide, explained = found.campaign, found.campaign.coarse(), False
    coarse = contenders(coarse)
    best = coarse[:2]
    for one in best:
        fit = fitted(wide, one.fit.unknowns, one.fit.u, rounds=COARSE_ROUNDS[-1])
        if not explained and not explains(fit) and not wide.stop():
            fit = min(fit, from_draws(wide, fit, COARSE_ROUNDS[-1]), key=lambda fit: fit.cost)
        explained = explained or explains(fit)
        found.keep(Contestant(one.hypothesis, refined(campaign, fit, FIRST_ROUNDS)))
    for one in all_finished(campaign, coarse[len(best) :], FIRST_ROUNDS):
        found.keep(one)


def finish(found: Inquiry) -> None:
    """Finish the best few fits, until no other is close."""
    done: set[str] = set()
    while not found.campaign.stop() and len(done) < FOLLOWED:
        waiting = [c for c in found.contestants if c.name not in done]
        if not waiting or (done and waiting[0].cost > _best_cost(found, done) + reach(found)):
            return
        found.keep(finished(found.campaign, waiting[0], ROUNDS))
        done.add(waiting[0].name)
        if linearise_at_best(found):
            done.clear()


def _best_cost(found: Inquiry, done: set[str]) -> float:
    return min(c.cost for c in found.contestants if c.name in done)


def reach(found: Inquiry) -> float:
    """The largest excess cost over the best with which a hypothesis is still continued: the misfit of the best itself,
    since a search that ended that far from noise may have ended in a local minimum for any of them."""
    return max(NOISE_LEAVES, unexplained(found.campaign, found.best))
