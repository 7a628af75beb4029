"""Explains a campaign: the base model, every cause of the library, the best in pairs; proposed, then fitted exactly.

Every hypothesis goes the same way. Its starts (the library's, the learned proposal's, and the rivals' constants) are
looked at in a coarse comparison of the runs that tell most, the base's constants making room; the best are fitted there
(successive halving: Jamieson and Talwalkar 2016), and what is left of them to all samples of all runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, clipped, cost_at, evaluated, fitted
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.inquiry import Inquiry, Told
from straw.replay.diagnose.judge import COUNTS_AS_ONE, unexplained
from straw.replay.diagnose.propose.proposal import Proposal
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.settings import (
    CLOSE,
    COARSE_ROUNDS,
    FAINT,
    FAR,
    FINISHED,
    FIRST_ROUNDS,
    HALVINGS,
    LONGEST_STEP,
    NOTHING_LEFT,
    PAIRS,
    PROPOSED,
    PROPOSED_PAIRS,
    RIVALS,
    ROUNDS,
    SCREENED,
    STAGES,
    STARTS,
)
from straw.replay.diagnose.starts import check_simulated

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """A hypothesis and a point u (of the base's unknowns and its own) to look from; what it promises to gain there."""

    hypothesis: Hypothesis
    u: Floats
    gain: float = np.inf  # squared sigmas, to first order; not known where nothing says so


def explain(campaign: Campaign, names: Sequence[str], told: Told, proposal: Proposal | None = None) -> Inquiry:
    """Fit the base and every cause, alone and in pairs, until done or stopped.

    A ``proposal`` adds starts, and says which causes come first: where they explain the runs the others are left out,
    but not where it has seen nothing like these runs.
    """
    steps = _Steps(told)
    steps("base model")
    null, wide_known = campaign.system.fit_base(campaign, _base_start(proposal))
    check_simulated(campaign, null)
    random_effects(campaign, null)
    found = Inquiry(campaign, fitted(campaign, null.unknowns, null.u, rounds=ROUNDS))
    hypotheses = [campaign.hypothesis([name]) for name in names]
    far = unexplained(campaign, found.null) > FAR
    if far:  # to first order around a fit that is far off nothing is told
        _large(found, hypotheses, wide_known, proposal, steps)
    if not found.contestants or not far or _unexplained(found):
        steps("causes that are small")
        left = _unexplained(found)
        for start in screen(campaign, found.null, hypotheses)[:SCREENED]:
            if not campaign.stop() and (left or start.gain > COUNTS_AS_ONE):
                found.keep(fitted_contestant(campaign, start, FIRST_ROUNDS))
        finish(found)
    if not far and _unexplained(found):
        _large(found, hypotheses, wide_known, proposal, steps)
    if _unexplained(found):
        steps("pairs")
        in_pairs(found, _telling(found), names, _starts(campaign, proposal))
        finish(found)
    steps("rivals from each other's constants")
    from_each_other(found)
    for hypothesis in hypotheses:
        if hypothesis.name not in found.singles:
            found.keep(absent(found.null, hypothesis))
    found.whole = not campaign.stop()
    return found


def _telling(found: Inquiry) -> Campaign:
    """The runs that tell most, compared coarsely."""
    return found.campaign.only(found.campaign.system.telling(found.campaign, found.null)).coarse()


def _large(
    found: Inquiry, hypotheses: Sequence[Hypothesis], base: Fit, proposal: Proposal | None, steps: _Steps
) -> None:
    """Causes fitted coarsely from their starts, those that the proposal puts first before the others.

    Where the base explains the coarse comparison to noise (reduced chi-square below one), no cause can show there.
    """
    wide = _telling(found)
    known = evaluated(wide, base.unknowns, base.u)
    if known.cost < len(known.residual):
        return
    given = _starts(found.campaign, proposal)
    for group in _in_turn(hypotheses, proposal):
        steps("causes that are large")
        for one in tournament(wide, known, group, given):
            found.keep(finished(found.campaign, one, FIRST_ROUNDS))
        finish(found)
        if not _unexplained(found):
            return


class _Steps:
    """Counts what is said to be done."""

    def __init__(self, told: Told) -> None:
        self.told, self.done = told, 0

    def __call__(self, what: str) -> None:
        self.told(what, self.done, STAGES)
        self.done += 1


def _unexplained(found: Inquiry) -> bool:
    """Whether the best so far leaves more than noise, and nobody asked to stop."""
    return not found.campaign.stop() and unexplained(found.campaign, found.best) > NOTHING_LEFT


def _base_start(proposal: Proposal | None) -> list[Floats]:
    return [] if proposal is None else [np.array([s.u for s in proposal.base])]


def _starts(campaign: Campaign, proposal: Proposal | None) -> list[Start]:
    """The proposal's hypotheses with its starts, in the order to be tried."""
    out: list[Start] = []
    names = [(name,) for name in proposal.scores] if proposal else []
    pairs = [names for names, _ in proposal.hypotheses if len(names) == 2] if proposal else []
    for hypothesis in (*names, *pairs[:PROPOSED_PAIRS]):
        assert proposal is not None
        for way in proposal.start(hypothesis):
            out.append(Start(campaign.hypothesis(hypothesis), np.array([s.u for s in way])))
    return out


def _in_turn(hypotheses: Sequence[Hypothesis], proposal: Proposal | None) -> list[list[Hypothesis]]:
    """The hypotheses that the proposal puts first, and the others."""
    if proposal is None or not proposal.familiar:
        return [list(hypotheses)]
    first = list(proposal.scores)[:PROPOSED]
    groups = [[h for h in hypotheses if (h.name in first) is one] for one in (True, False)]
    return [group for group in groups if group]


def random_effects(campaign: Campaign, fit: Fit) -> None:
    """From now on allow for what repeats differ by, as felt at this fit."""
    campaign.random_effects = None
    directions = campaign.system.repeats(campaign, fit)
    if directions is not None:
        campaign.allow(directions)


def screen(
    campaign: Campaign, known: Fit, hypotheses: Sequence[Hypothesis], beside: Hypothesis | None = None
) -> list[Start]:
    """Where each hypothesis would be added to a fit, to first order in its strengths, the most promising first.

    One Jacobian by the strengths of all hypotheses at none of them (a score test, profiled over the known unknowns:
    Rao 1948), once for each set of shapes among their starts.
    """
    promised: list[Start] = []
    for level in range(2):
        group = [(h, shape) for h in hypotheses for shape in _shapes(h)[level : level + 1]]
        unknowns = tuple(u for h, _ in group for u in h.unknowns)
        if not unknowns:
            continue
        every = (*known.unknowns, *unknowns)
        at = evaluated(campaign, every, np.concatenate([known.u, *(shape for _, shape in group)]))
        first = len(known.unknowns)
        for h, shape in group:
            columns = at.slopes[:, first : first + len(h.unknowns)]
            first += len(h.unknowns)
            u, gain = _added(replace(known, slopes=at.slopes[:, : len(known.unknowns)]), h, shape, columns)
            both = h.beside(beside) if beside else h
            promised.append(Start(both, u, gain))
    return sorted(promised, key=lambda start: -start.gain)


def _shapes(h: Hypothesis) -> list[Floats]:
    """The different shapes among a hypothesis' starts, with no strength: u (unknowns,)."""
    strength = np.array([k.kind == "strength" for k in h.unknowns])
    if not strength.any():
        return []
    out: list[Floats] = []
    for start in h.starts:
        shape = np.where(strength, FAINT, start)
        if not any(np.array_equal(shape, other) for other in out):
            out.append(shape)
    return out


def _added(known: Fit, h: Hypothesis, shape: Floats, columns: Floats) -> tuple[Floats, float]:
    """u with the hypothesis added as linear least squares wants it, and what that gains; strengths keep their sign."""
    w = np.sqrt(weights(known.residual))
    n = len(known.u)
    unknowns = (*known.unknowns, *h.unknowns)
    at = np.concatenate([known.u, shape])
    sd, mean = np.array([k.sd for k in unknowns]), np.array([k.mean for k in unknowns])
    J = np.hstack([known.slopes, columns]) * w[:, None]
    H, g = J.T @ J + np.diag(1 / sd**2), J.T @ (w * known.residual) + (at - mean) / sd**2
    free = [*range(n), *(n + k for k, u in enumerate(h.unknowns) if u.kind == "strength")]
    step = np.zeros(len(at))
    for _ in h.unknowns:
        step[:] = 0.0
        step[free] = -np.linalg.solve(H[np.ix_(free, free)], g[free])
        wrong = [k for k in free if k >= n and at[k] + step[k] < unknowns[k].low]
        if not wrong:
            break
        free = [k for k in free if k not in wrong]
    own = free[:n]
    alone = -np.linalg.solve(H[np.ix_(own, own)], g[own])
    gain = float(-g @ step - step @ H @ step / 2 - (-g[own] @ alone - alone @ H[np.ix_(own, own)] @ alone / 2))
    step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-12))
    return clipped(unknowns, at + step), 2 * gain


def tournament(
    wide: Campaign,
    known: Fit,
    hypotheses: Sequence[Hypothesis],
    proposed: Sequence[Start],
) -> list[Contestant]:
    """Hypotheses fitted coarsely from their best starts, half of them left out after each round; the best first."""
    begun: list[Contestant] = []
    for h in hypotheses:
        if wide.stop():
            return begun
        given = [
            Start(h, clipped((*known.unknowns, *h.unknowns), s.u)) for s in proposed if s.hypothesis.name == h.name
        ]
        starts = [*look(wide, known, h)[:STARTS], *given]
        fits = [fitted_contestant(wide, start, COARSE_ROUNDS[0], known.unknowns) for start in starts]
        if fits:
            begun.append(min(fits, key=lambda c: c.cost))
    going = sorted(begun, key=lambda c: c.cost)
    for rounds, share in zip(COARSE_ROUNDS[1:], HALVINGS, strict=True):
        going = going[: max(3, round(share * len(hypotheses)))]
        going = sorted((finished(wide, one, rounds) for one in going if not wide.stop()), key=lambda c: c.cost)
    return going


def look(wide: Campaign, known: Fit, h: Hypothesis) -> list[Start]:
    """A hypothesis' starts beside what is known, which makes room for it; those that look best first."""
    unknowns = (*known.unknowns, *h.unknowns)
    points = [clipped(unknowns, np.concatenate([known.u, start])) for start in h.starts]
    residuals = wide.residuals(unknowns, points)
    costs = [cost_at(unknowns, u, r) for u, r in zip(points, residuals, strict=True)]
    for _ in range(2):
        made = [_room(known, unknowns, u, r) for u, r in zip(points, residuals, strict=True)]
        shown = wide.residuals(unknowns, made)
        for k, (u, r) in enumerate(zip(made, shown, strict=True)):
            if (cost := cost_at(unknowns, u, r)) < costs[k]:
                points[k], residuals[k], costs[k] = u, r, cost
    return [Start(h, points[k]) for k in np.argsort(costs, kind="stable")]


def _room(known: Fit, unknowns: Sequence[Unknown], u: Floats, residual: Floats) -> Floats:
    """The point with the known unknowns moved as their Jacobian says is best, the new ones held."""
    n, w = len(known.u), weights(residual)
    sd, mean = np.array([k.sd for k in known.unknowns]), np.array([k.mean for k in known.unknowns])
    H = (known.slopes * w[:, None]).T @ known.slopes + np.diag(1 / sd**2)
    step = -np.linalg.solve(H, known.slopes.T @ (w * residual) + (u[:n] - mean) / sd**2)
    step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-12))
    return clipped(unknowns, np.concatenate([u[:n] + step, u[n:]]))


def fitted_contestant(
    campaign: Campaign, start: Start, rounds: int, base: Sequence[Unknown] | None = None
) -> Contestant:
    """A hypothesis fitted from a start."""
    base = campaign.system.base if base is None else base
    fit = fitted(campaign, (*base, *start.hypothesis.unknowns), start.u, rounds=rounds)
    return Contestant(start.hypothesis, fit)


def finished(campaign: Campaign, one: Contestant, rounds: int) -> Contestant:
    """A contestant's fit carried on, perhaps in another campaign of the same runs."""
    return Contestant(one.hypothesis, fitted(campaign, one.fit.unknowns, one.fit.u, rounds=rounds))


def finish(found: Inquiry) -> None:
    """Carry the best few to their end, until no other is close."""
    done: set[str] = set()
    while not found.campaign.stop() and len(done) < FINISHED:
        waiting = [c for c in found.contestants if c.name not in done]
        if not waiting or (done and waiting[0].cost > _best_cost(found, done) + reach(found)):
            return
        found.keep(finished(found.campaign, waiting[0], ROUNDS))
        done.add(waiting[0].name)


def _best_cost(found: Inquiry, done: set[str]) -> float:
    return min(c.cost for c in found.contestants if c.name in done)


def reach(found: Inquiry) -> float:
    """How much more than the best a hypothesis may cost that is still carried on."""
    return max(CLOSE, unexplained(found.campaign, found.best))


def in_pairs(found: Inquiry, wide: Campaign, names: Sequence[str], proposed: Sequence[Start]) -> None:
    """Second causes beside the best: by first order in all that is seen, and by a coarse tournament."""
    campaign = found.campaign
    for first in found.contestants[:2]:
        others = [campaign.hypothesis([name]) for name in names if name not in first.hypothesis.causes]
        for start in screen(campaign, first.fit, others, first.hypothesis)[:PAIRS]:
            unknowns = (*first.fit.unknowns, *start.hypothesis.unknowns[len(first.hypothesis.unknowns) :])
            found.keep(Contestant(start.hypothesis, fitted(campaign, unknowns, start.u, rounds=FIRST_ROUNDS)))
    two = [s for s in proposed if len(s.hypothesis.causes) == 2]
    base = found.null.unknowns
    for start in two[:PAIRS]:
        coarse = fitted_contestant(wide, start, sum(COARSE_ROUNDS), base)
        found.keep(finished(campaign, coarse, FIRST_ROUNDS))


def from_each_other(found: Inquiry) -> None:
    """The base, and the best rivals, once more from the constants that the best of all leaves: that a search ended in
    another valley is no evidence against a hypothesis."""
    campaign, n = found.campaign, len(found.null.unknowns)
    best = found.contestants[:RIVALS]
    if not best or found.null.cost < best[0].cost + COUNTS_AS_ONE:
        return  # nothing is better than the base
    for one in best:
        if found.null.cost > best[0].cost + FAR and one is not best[0]:
            break  # it is not the base's constants that are wrong
        again = fitted(campaign, found.null.unknowns, one.fit.u[:n], rounds=ROUNDS)
        found.null = min(found.null, again, key=lambda fit: fit.cost)
    for one in best[1:]:
        if one.cost < best[0].cost + FAR:
            u = np.concatenate([best[0].fit.u[:n], one.fit.u[n:]])
            found.keep(Contestant(one.hypothesis, fitted(campaign, one.fit.unknowns, u, rounds=ROUNDS)))


def absent(null: Fit, h: Hypothesis) -> Contestant:
    """A hypothesis that was not worth a fit: the base's fit with nothing of it."""
    start = np.where([k.kind == "strength" for k in h.unknowns], 0.0, h.starts[0])
    slopes = np.pad(null.slopes, ((0, 0), (0, len(h.unknowns))))
    return Contestant(
        h, Fit((*null.unknowns, *h.unknowns), np.concatenate([null.u, start]), null.residual, slopes, null.cost)
    )
