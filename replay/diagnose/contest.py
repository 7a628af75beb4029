"""The contest: every cause fitted with the base's constants free, from several starts; the best are finished."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.search import FINELY, LONGEST_STEP, Fit, Straight, clipped, cost_at, descend, measured_slopes

Floats = NDArray[np.float64]

#: A first fit to outlines ends when a round gains less than this share of the cost, one to all that is seen when it
#: gains less than so much: more than what would have it take slopes in other ways, which `tried` does.
LITTLE, WORTH = 1e-2, FINELY + 1.0
#: Starts of a cause that are looked at by all that is seen: there it is small. Outlines are shown all of them.
NEAR_STARTS = 2
#: Starts this far apart, in units of u, are different ones; each is tried for so many rounds, unless the misfit there
#: is this many times what it is without the cause.
ANOTHER, TRIED, TOO_FAR = 1.0, 2, 4.0
#: A look's differences in any share: how much of a cause there may be is not what decides whether it promises anything.
ANY_SHARE = Unknown("share", 1.0, sd=1e3)


@dataclass(frozen=True, eq=False)
class Contestant:
    """A hypothesis and its best fit so far."""

    hypothesis: Hypothesis
    fit: Fit

    @property
    def name(self) -> str:
        """The hypothesis' name."""
        return self.hypothesis.name

    @property
    def cost(self) -> float:
        """Robust misfit with priors."""
        return self.fit.cost


@dataclass(frozen=True, eq=False)
class Look:
    """A cause at one start, not fitted: the point u, its differences and cost, and what a linear reckoning promises."""

    name: str
    point: Floats
    residual: Floats
    cost: float
    promise: float  # the cost it may come down to


def looks(campaign: Campaign, known: Fit, names: Sequence[str]) -> list[Look]:
    """Every cause at its starts beside what is known: as it is, and with room made for it.

    On a walk each start begins where room was made for the one before: what is known follows a growing cause along a
    valley that bends, from which a leap to the cause's full size leads away.
    """
    n, out = len(known.u), []
    whats = {name: campaign.hypothesis([name]) for name in names}
    unknowns = {name: (*known.unknowns, *what.unknowns) for name, what in whats.items()}
    most = None if campaign.rough else NEAR_STARTS
    going = [(name, walk, known.u) for name, what in whats.items() for walk in walks(what, what.starts[:most])]
    promises = dict.fromkeys(names, known.cost)

    def at(rows: list[tuple[str, Floats]]) -> list[tuple[str, Floats, Floats, float]]:
        found = []
        for name, group in itertools.groupby(rows, key=lambda row: row[0]):
            points = [point for _, point in group]
            for point, residual in zip(points, campaign.residuals(unknowns[name], points), strict=True):
                found.append((name, point, residual, cost_at(unknowns[name], point, residual)))
        return found

    while going and not campaign.stop():
        first = at([(name, clipped(unknowns[name], np.concatenate([u, walk[0]]))) for name, walk, u in going])
        for name, _, residual, cost in first:
            # as far as robust weights let it count
            column = np.clip(residual - known.residual, -100, 100)[:, None]
            promises[name] = min(promises[name], cost, known.cost - _gain(known, column, [ANY_SHARE]))
        # the constants known before make room for the new cause: without it a large effect looks hopeless at once
        room = at([(name, _making_room(known, unknowns[name], point, residual)) for name, point, residual, _ in first])
        out += [*first, *room]
        going = [
            (name, walk[1:], min(ends, key=lambda look: look[3])[1][:n])
            for (name, walk, _), *ends in zip(going, first, room, strict=True)
            if len(walk) > 1
        ]
    return [Look(*one, min(promises[one[0]], one[3])) for one in out]


def walks(what: Hypothesis, starts: Sequence[Sequence[float]]) -> list[list[Sequence[float]]]:
    """Starts in turn, those together that have ever more of a cause that is otherwise the same."""
    strength = np.array([k.kind == "strength" for k in what.unknowns])
    out: list[list[Sequence[float]]] = []
    for start in starts:
        last = np.array(out[-1][-1] if out else np.full(len(start), np.nan))
        more = np.array(start) * np.sign(last) >= np.abs(last)
        if np.all(np.where(strength, more, np.array(start) == last)):
            out[-1].append(start)
        else:
            out.append([start])
    return out


def nothing_yet(campaign: Campaign, known: Fit, names: Sequence[str]) -> list[Look]:
    """Every cause that has a strength with nothing of it yet, from where a search finds its sign by itself, and what
    its strengths' slopes there promise. No answer by themselves: they would share in the base's own probability."""
    out = []
    for name in names:
        what = campaign.hypothesis([name])
        own = [k for k, unknown in enumerate(what.unknowns) if unknown.kind == "strength"]
        if not own:
            continue
        unknowns, n = (*known.unknowns, *what.unknowns), len(known.u)
        start = [0.0 if k in own else x for k, x in enumerate(what.starts[0])]
        point = clipped(unknowns, np.concatenate([known.u, start]))
        slopes = measured_slopes(campaign, unknowns, point, known.residual, [n + k for k in own])
        cost = cost_at(unknowns, point, known.residual)
        gain = _gain(known, slopes, [what.unknowns[k] for k in own])
        out.append(Look(name, point, known.residual, cost, cost - gain))
    return out


def _gain(known: Fit, columns: Floats, new: Sequence[Unknown]) -> float:
    """How much new unknowns that move the differences by these columns would lower the cost, by linear reckoning."""
    w, n = np.sqrt(weights(known.residual)), len(known.u)
    sd = np.array([k.sd for k in (*known.unknowns, *new)])
    slopes = np.concatenate([known.slopes, columns], axis=1) * w[:, None]
    A, g = slopes.T @ slopes + np.diag(1 / sd**2), slopes.T @ (w * known.residual)
    step = -np.linalg.solve(A, g)
    # what would have to be negative, and may not, is left out
    free = [*range(n), *(n + k for k, unknown in enumerate(new) if unknown.low < 0 or step[n + k] > 0)]
    A, g = A[np.ix_(free, free)], g[free]
    # the constants known are at their optimum: what they alone would still gain does not count
    return float(g @ np.linalg.solve(A, g) - g[:n] @ np.linalg.solve(A[:n, :n], g[:n]))


def enter(
    campaign: Campaign, known: Fit, found: Sequence[Look], *, rounds: int = 7, onto: Hypothesis | None = None
) -> Contestant:
    """A first fit of a cause beside what is known, from the given looks.

    Slopes by the constants known before are taken over at first; only the new ones' are measured. With nothing of the
    cause yet they all hold.
    """
    what = campaign.hypothesis([found[0].name])
    unknowns = (*known.unknowns, *what.unknowns)
    n, best = len(known.u), None
    enough, share = _until(campaign)
    own = range(n, len(unknowns))
    for look in found:
        slopes = np.concatenate(
            [
                known.slopes,
                measured_slopes(campaign, unknowns, look.point, look.residual, own, known.felt_sigmas),
            ],
            axis=1,
        )
        fit = descend(
            campaign,
            unknowns,
            look.point,
            slopes=slopes,
            residual=look.residual,
            fresh=known.fresh and _nothing_of(look, known),
            rounds=rounds,
            enough=enough,
            share=share,
        )
        best = fit if best is None or fit.cost < best.cost else best
        if campaign.stop():
            break
    assert best is not None
    return Contestant(what.beside(onto) if onto else what, best)


def ranked(found: Sequence[Look], known: Fit) -> list[list[Look]]:
    """Looks by cause, the most promising cause first; of each the best look and then others of another size."""
    groups: dict[str, list[Look]] = {}
    for look in sorted(found, key=lambda look: look.cost):
        groups.setdefault(look.name, []).append(look)
    n = len(known.u)
    for name, group in groups.items():
        chosen = [group[0]]
        for look in group[1:]:
            if all(np.max(np.abs(look.point[n:] - other.point[n:])) > ANOTHER for other in chosen):
                chosen.append(look)
        groups[name] = chosen
    return sorted(groups.values(), key=lambda group: min(look.promise for look in group))


def tried(
    campaign: Campaign, known: Sequence[Fit], group: Sequence[Look], onto: Hypothesis | None = None
) -> Contestant:
    """A cause fitted a little way from each of several starts, and the best of them. Which is best shows only after
    some rounds: where a law decides to which side a cell snaps, the right start can look as bad as the wrong one.

    ``known`` is one fit; with slopes known in several ways, a start with nothing of the cause is tried with each.
    """
    first = known[0]
    hopeful = [look for look in group if look.cost < TOO_FAR * first.cost] or group[:1]
    ways = [(look, one) for look in hopeful for one in (known if _nothing_of(look, first) else known[:1])]
    return min((enter(campaign, one, [look], rounds=TRIED, onto=onto) for look, one in ways), key=lambda c: c.cost)


def _nothing_of(look: Look, known: Fit) -> bool:
    return np.array_equal(look.residual, known.residual)


def _until(campaign: Campaign) -> tuple[float, float]:
    """When a search that only shall show what a cause promises ends: at what gain, and at what share of the cost."""
    return (1.0, LITTLE) if campaign.rough else (WORTH, 0.0)


def released(one: Contestant, free: tuple[Unknown, ...]) -> Contestant:
    """The same fit with the base's constants free, as far as their own priors let them."""
    fit, unknowns = one.fit, (*free, *one.hypothesis.unknowns)
    cost = cost_at(unknowns, fit.u, fit.residual)
    return Contestant(one.hypothesis, replace(fit, unknowns=unknowns, cost=cost, fresh=False))


def followed(campaign: Campaign, one: Contestant) -> Contestant:
    """A cause that was tried, fitted some rounds more."""
    fit = one.fit
    enough, share = _until(campaign)
    done = descend(campaign, fit.unknowns, fit.u, rounds=4, enough=enough, share=share, resumed=fit)
    return Contestant(one.hypothesis, done)


def unfitted(campaign: Campaign, known: Fit, look: Look) -> Contestant:
    """A cause that promises too little to be fitted, with what it shows at its best look, or as without it."""
    what = campaign.hypothesis([look.name])
    # nothing is known of how its constants tell, so nothing but their priors bounds them
    slopes = np.pad(known.slopes, ((0, 0), (0, len(what.unknowns))))
    fit = Fit((*known.unknowns, *what.unknowns), look.point, look.residual, slopes, look.cost, False)
    return Contestant(what, fit)


def taken_out(fit: Fit, kept: tuple[Unknown, ...]) -> Floats:
    """u of the unknowns ``kept`` where linear reckoning sees least misfit with nothing of the fit's other strengths."""
    own = _places(fit, kept)
    gone = Straight(fit.unknowns).way(fit.u, np.zeros(len(fit.u)))
    gone *= [unknown.kind == "strength" and k not in own for k, unknown in enumerate(fit.unknowns)]
    return Straight(kept).step(fit.u[own], fit.slopes[:, own], fit.residual + fit.slopes @ gone, 0.0).end


def _places(fit: Fit, some: tuple[Unknown, ...]) -> list[int]:
    """Where some unknowns stand among the fit's."""
    targets = [unknown.target for unknown in fit.unknowns]
    return [targets.index(unknown.target) for unknown in some]


def only(campaign: Campaign, fit: Fit, kept: tuple[Unknown, ...]) -> Fit:
    """The fit with only the unknowns ``kept``, where they are, as the campaign shows it."""
    own = _places(fit, kept)
    return seen_again(campaign, replace(fit, unknowns=kept, u=fit.u[own], slopes=fit.slopes[:, own]))


def _making_room(known: Fit, unknowns: tuple[Unknown, ...], point: Floats, residual: Floats) -> Floats:
    """The point with the constants known before moved as their slopes say is best, the new cause held."""
    n = len(known.u)
    w = weights(residual)
    sd, mean = np.array([k.sd for k in known.unknowns]), np.array([k.mean for k in known.unknowns])
    slopes = known.slopes[:, :n]
    A = (slopes * w[:, None]).T @ slopes + np.diag(1 / sd**2)
    step = np.linalg.solve(A, -(slopes.T @ (w * residual) + (point[:n] - mean) / sd**2))
    step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-12))
    return clipped(unknowns, np.concatenate([point[:n] + step, point[n:]]))


def seen_again(campaign: Campaign, fit: Fit) -> Fit:
    """The same fit, its differences and cost as the campaign counts them now."""
    residual = campaign.residuals(fit.unknowns, [fit.u])[0]
    cost = cost_at(fit.unknowns, fit.u, residual)
    return replace(fit, residual=residual, cost=cost, fresh=False)


def narrowed(fit: Fit, rows: NDArray[np.intp]) -> Fit:
    """A fit as only some of its differences show it."""
    residual = fit.residual[rows]
    cost = cost_at(fit.unknowns, fit.u, residual)
    return replace(fit, residual=residual, slopes=fit.slopes[rows], cost=cost)


def finish(campaign: Campaign, contestant: Contestant, rounds: int = 8, share: float = 0.0) -> Contestant:
    """The contestant's fit carried on from where it is, with slopes measured there, until a round gains little."""
    fit = contestant.fit
    done = descend(campaign, fit.unknowns, fit.u, rounds=rounds, share=share)
    return Contestant(contestant.hypothesis, done)
