"""Hypotheses fitted coarsely from many starts by successive halving (Jamieson and Talwalkar 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, clipped, cost_at, fits_from, normal_equations
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.settings import COARSE_ROUNDS, LONGEST_STEP, SHORTLIST, STARTS

Floats = NDArray[np.float64]

#: A hypothesis that leaves this many times as much as the best in a coarse comparison is not followed: in 24 opened
#: cases a concealed cause leaves at most 1.02 times the least of all (`python -m tests.benchmarks.coarse_search`).
OUT = 2.0


def tournament(
    wide: Campaign, known: Fit, hypotheses: Sequence[Hypothesis], begun: Sequence[Contestant] = ()
) -> list[Contestant]:
    """Hypotheses fitted coarsely from their best starts, half of them left out after each round, the last time among
    those that are ``begun``, too; the best first."""
    starts: list[Start] = []
    for h in hypotheses:
        if wide.stop():
            break
        starts += look(wide, known, h)[:STARTS]
    fits = fitted_contestants(wide, starts, COARSE_ROUNDS[0], known.unknowns, brief=True)
    some = halved(wide, best_of_each(fits), len(hypotheses), COARSE_ROUNDS[1:2])
    given = [one for one in begun if one.name in {h.name for h in hypotheses}]
    return halved(wide, best_of_each([*some, *given]), len(hypotheses) // 2, COARSE_ROUNDS[2:])


def by_cost(some: Sequence[Contestant]) -> list[Contestant]:
    """The best first."""
    return sorted(some, key=lambda one: one.cost)


def best_of_each(fits: Sequence[Contestant]) -> list[Contestant]:
    """The best fit of each hypothesis."""
    best: dict[str, Contestant] = {}
    for one in fits:
        if one.name not in best or one.cost < best[one.name].cost:
            best[one.name] = one
    return list(best.values())


def halved(
    wide: Campaign, begun: Sequence[Contestant], among: int, each: Sequence[int] = COARSE_ROUNDS[1:]
) -> list[Contestant]:
    """Contestants fitted on in rounds, the worse half of ``among`` and what is no contender left out after each; to
    their ends only those that are `near`. The best first."""
    going, left = by_cost(begun), list[Contestant]()
    for k, rounds in enumerate(each, 1):
        going = contenders(going[: max(3, round(among / 2**k))])
        if rounds == COARSE_ROUNDS[-1]:
            left = [one for one in going if not near(one)]
            going = [one for one in going if near(one)]
        if not wide.stop():
            going = by_cost(all_finished(wide, going, rounds))
    return by_cost([*going, *left])


def contenders(ranked: Sequence[Contestant]) -> list[Contestant]:
    """Those that leave less than `OUT` times as much as the best, which is the first."""
    return [one for one in ranked if one.cost < OUT * ranked[0].cost]


def near(one: Contestant) -> bool:
    """Whether a coarse fit's differences are of the size of their sigmas: it may become one that explains them."""
    return one.cost < len(one.fit.residual)


def look(wide: Campaign, known: Fit, h: Hypothesis) -> list[Start]:
    """A hypothesis' starts, profiled over the known unknowns; the best first."""
    unknowns = (*known.unknowns, *h.unknowns)
    points = [clipped(unknowns, np.concatenate([known.u, start])) for start in h.starts]
    residuals = wide.residuals(unknowns, points)
    costs = [cost_at(unknowns, u, r) for u, r in zip(points, residuals, strict=True)]
    # room for all of them, of unlike cells' 81 for the best, and once more for the best of these
    for going in (2 * SHORTLIST, 2 * STARTS):
        best = np.argsort(costs, kind="stable")[:going]
        made = [_room(known, unknowns, points[k], residuals[k]) for k in best]
        shown = wide.residuals(unknowns, made)
        for k, u, r in zip(best, made, shown, strict=True):
            if (cost := cost_at(unknowns, u, r)) < costs[k]:
                points[k], residuals[k], costs[k] = u, r, cost
    return [Start(h, points[k]) for k in np.argsort(costs, kind="stable")]


def _room(known: Fit, unknowns: Sequence[Unknown], u: Floats, residual: Floats) -> Floats:
    """The point after a Gauss-Newton step of the known unknowns, with the new ones held."""
    n = len(known.u)
    H, g = normal_equations(known.unknowns, u[:n], residual, known.slopes)
    step = -np.linalg.solve(H, g)
    step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-12))
    return clipped(unknowns, np.concatenate([u[:n] + step, u[n:]]))


def fitted_contestants(
    campaign: Campaign,
    starts: Sequence[Start],
    rounds: int,
    base: Sequence[Unknown] | None = None,
    *,
    brief: bool = False,
) -> list[Contestant]:
    """Hypotheses fitted from starts; ``brief`` as in `fits_from`."""
    base = campaign.system.base if base is None else base
    fits = fits_from(campaign, [((*base, *s.hypothesis.unknowns), s.u) for s in starts], rounds=rounds, brief=brief)
    return [Contestant(start.hypothesis, fit) for start, fit in zip(starts, fits, strict=True)]


def all_finished(campaign: Campaign, some: Sequence[Contestant], rounds: int) -> list[Contestant]:
    """Contestants' fits continued, perhaps in another campaign of the same runs."""
    fits = fits_from(campaign, [(one.fit.unknowns, one.fit.u) for one in some], rounds=rounds)
    return [Contestant(one.hypothesis, fit) for one, fit in zip(some, fits, strict=True)]


def finished(campaign: Campaign, one: Contestant, rounds: int) -> Contestant:
    """A contestant's fit continued, perhaps in another campaign of the same runs."""
    return all_finished(campaign, [one], rounds)[0]


def briefly_fitted(wide: Campaign, base: Fit, groups: Sequence[Sequence[Start]]) -> Contestant:
    """A hypothesis fitted for a few rounds from the best start of each group, which may lie in other basins."""
    firsts: list[Start] = []
    for starts in groups:
        if starts:
            unknowns = (*base.unknowns, *starts[0].hypothesis.unknowns)
            points = [clipped(unknowns, start.u) for start in starts]
            costs = [cost_at(unknowns, u, r) for u, r in zip(points, wide.residuals(unknowns, points), strict=True)]
            firsts.append(replace(starts[0], u=points[int(np.argmin(costs))]))
    return min(fitted_contestants(wide, firsts, COARSE_ROUNDS[0], base.unknowns, brief=True), key=lambda c: c.cost)


def proposed(base: Fit, hypothesis: Hypothesis, proposal: Proposal | None) -> list[Start]:
    """Starts from the proposal's constants, ordered as the unknowns; two where a sign is open, none without one."""
    unknowns = (*base.unknowns, *hypothesis.unknowns)
    ways = proposal.start(hypothesis.causes) if proposal else ()
    at = [{one.unknown.target: one.u for one in way} for way in ways]
    return [Start(hypothesis, np.array([way[one.target] for one in unknowns])) for way in at]
