"""The inquiry: base fit, every cause alone, the best in pairs, the judgement."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from model.parameters import StrawParameters
from replay.diagnose.contest import Contestant, Look, enter, finish, looks, seen_again, unfitted
from replay.diagnose.hypothesis import REPEATS, REPEATS_MOUNT, Unknown, base_unknowns, causes, hypothesis
from replay.diagnose.judge import Judgement, judge, unexplained
from replay.diagnose.observation import Observation
from replay.diagnose.search import Campaign, Fit, descend, measured_slopes, robust_cost
from replay.diagnose.start import LOOSE_S, base_start, few_of, rough
from replay.errors import ReplayError

Floats = NDArray[np.float64]

#: Said with (what is being done, steps done, steps in all).
Told = Callable[[str, int, int], None]


def _silent(_what: str, _done: int, _total: int) -> None:
    """Say nothing."""


@dataclass(eq=False)
class Inquiry:
    """What has been found so far; usable at any time after the base fit."""

    campaign: Campaign
    null: Fit
    singles: dict[str, Contestant] = field(default_factory=dict)
    pairs: dict[str, Contestant] = field(default_factory=dict)
    whole: bool = False  # whether nothing was cut short

    @property
    def contestants(self) -> list[Contestant]:
        """All fitted hypotheses, best first."""
        return sorted([*self.singles.values(), *self.pairs.values()], key=lambda c: c.cost)

    def judgement(self) -> Judgement:
        """Probabilities with what is known now."""
        return judge(self.campaign, self.null, self.contestants)


#: Gain by linear reckoning below which a cause is not worth a fit when the base already explains everything.
HOPELESS = 12.0
#: What is unexplained up to this, sigmas squared, may be the noise's own.
EXPLAINED = 150.0
#: What the wide search leaves this little above the base may still win when it is finished.
NEARLY = 1.3
#: Constants a dragged base is taken at its word for.
TAKEN_ALONG = ("straw.r_ch_m", "straw.c_zeta_n_s_per_m", "straw.c_phi_n_m_s_per_rad")
#: The given straw is not far off while its misfit is this many times the fitted base's.
OWN = 8.0
#: Starts this far apart, in units of u, are different ones.
ANOTHER = 0.8
#: A rival this much behind is not close, whatever more fitting would bring.
CLOSE = 1000.0
#: What a single cause may leave unexplained before all are looked for from further away; damping looked at there, as
#: logarithms beside the base's.
AFAR_LEFT, AFAR_SHARE = 1500.0, 0.02
AFAR_AXIAL, AFAR_ANGULAR = (-1.0, -0.4, 0.0, 0.4, 1.0), (-0.7, 0.0, 0.7)
#: Causes that are carried to the end, that get partners; pairs tried.
FINISHED, PARTNERS, PAIRS = 3, 1, 2


def inquire(
    observations: Sequence[Observation],
    straw: StrawParameters,
    *,
    library: Sequence[str] | None = None,
    executor: Executor,
    thorough: bool = False,
    told: Told = _silent,
    stop: Callable[[], bool] = lambda: False,
) -> Inquiry:
    """Fit the base and every cause in the library (all by default), alone and in pairs, until done or stopped.

    Raises ReplayError where a run cannot be played at all.

    ``executor`` plays runs: a `ThreadPoolExecutor` (the compiled model releases the GIL), or a Dask client's
    ``client.get_executor()``. It must outlive what is asked of the inquiry later.
    """
    names = [n for n in causes(straw.cells) if library is None or n in library]
    total = len(names) + 5
    campaign = Campaign(observations, straw, executor, stop)
    base = base_unknowns(straw)
    told("base model", 0, total)
    start = base_start(campaign, base)
    null = descend(campaign, base, start, rounds=6, enough=5.0)
    unplayed = [o.name for o, one in zip(observations, campaign.misfits(base, [null.u])[0], strict=True) if one is None]
    if unplayed:
        raise ReplayError(
            f"run {unplayed[0]}: the straw cannot be played from where this run starts, whatever its constants; "
            "check initial_deployed and the straw, or leave the run out"
        )
    allow_repeats(campaign, null)
    null = descend(campaign, base, null.u, rounds=5)
    found = Inquiry(campaign, null)
    told("looking at every cause", 1, total)
    # causes are looked for in few runs, what moves fast counting little: the way down is wider, forms matter less
    wide = campaign.only(few_of(observations)).loose(LOOSE_S)
    known = descend(wide, base, start, rounds=3)
    # what is missing has dragged the base's constants away: other places to start from are damping and channel alone,
    # and the given straw's own constants where they are not far off
    calm = np.where([k.target in TAKEN_ALONG for k in base], known.u, 0.0)
    given = np.zeros(len(base))
    near = robust_cost(wide.residuals(base, [given])[0]) < OWN * known.cost
    others = [calm, given] if near or thorough else [calm]
    for k, group in enumerate(_ranked(looks(wide, known, names, others), known)):
        if stop():
            return found
        told(group[0].name, k + 2, total)
        if thorough or known.cost - group[0].promise > HOPELESS:
            entered = enter(wide, known, group[: 3 if thorough else 2])
        else:
            entered = unfitted(wide, known, min(group, key=lambda look: look.cost))
        found.singles[entered.name] = Contestant(entered.hypothesis, seen_again(campaign, entered.fit))
    told("finishing the best", len(names) + 2, total)
    _finish_best(found, FINISHED + 3 * thorough)
    if thorough and not stop() and _unfinished(found):
        told("looking from further away", len(names) + 2, total)
        if _from_afar(found, wide, base, names, known.u):
            _finish_best(found, FINISHED)
    if found.singles and found.contestants[0].cost < found.null.cost - HOPELESS:
        _weigh_anew(found, len(base))
        told("pairs", len(names) + 3, total)
        if thorough or unexplained(campaign, found.contestants[0].fit) > EXPLAINED:
            _pairs(found, names, thorough)
    told("weighing", len(names) + 4, total)
    found.whole = not stop()
    return found


def _unfinished(found: Inquiry) -> bool:
    """Whether much is left that no single cause explains: it, or the search, is not one of them."""
    if not found.singles:
        return False
    best = min(found.singles.values(), key=lambda c: c.cost)
    best_left = unexplained(found.campaign, best.fit)
    return best_left > AFAR_LEFT and best_left > AFAR_SHARE * unexplained(found.campaign, found.null)


def _from_afar(found: Inquiry, wide: Campaign, base: tuple[Unknown, ...], names: Sequence[str], u: Floats) -> bool:
    """Look for strong causes with elasticity and geometry as given and damping anew; whether one has got better.

    A strong effect drags all of the base's constants to where the way back is lost. Minutes: for the thorough only.
    """
    better, place = False, {k.target: i for i, k in enumerate(base)}
    for name in names:
        what = hypothesis([name], found.campaign.straw.cells)
        unknowns = (*base, *what.unknowns)
        points = []
        for start in what.starts[-2:]:
            for a, b in itertools.product(AFAR_AXIAL, AFAR_ANGULAR):
                point = np.concatenate([np.where([k.target == "straw.r_ch_m" for k in base], u, 0.0), start])
                point[place["straw.c_zeta_n_s_per_m"]] = u[place["straw.c_zeta_n_s_per_m"]] + a
                point[place["straw.c_phi_n_m_s_per_rad"]] = u[place["straw.c_phi_n_m_s_per_rad"]] + b
                points.append(point)
        if found.campaign.stop():
            return better
        best = points[int(np.argmin(rough(wide, unknowns, points)))]
        fit = descend(wide, unknowns, best, rounds=7, share=0.01)
        seen = seen_again(found.campaign, fit)
        if seen.cost < found.singles[name].cost:
            found.singles[name], better = Contestant(what, seen), True
    return better


def _ranked(found: Sequence[Look], known: Fit) -> list[list[Look]]:
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


def allow_repeats(campaign: Campaign, fit: Fit) -> None:
    """From now on allow for what runs of one straw differ by, as felt at this fit."""
    campaign.scatter = None
    residual, moved = (
        campaign.residuals((*fit.unknowns, REPEATS_MOUNT), [np.append(fit.u, turned)])[0] for turned in (0.0, 1.0)
    )
    kept = [k for k, unknown in enumerate(fit.unknowns) if unknown.target in REPEATS]
    slopes = measured_slopes(campaign, fit.unknowns, fit.u, residual, kept)
    scale = [REPEATS[fit.unknowns[k].target] / fit.unknowns[k].scale for k in kept]
    campaign.allow(np.column_stack([moved - residual, slopes * scale]))


def _weigh_anew(found: Inquiry, base: int) -> None:
    """Judge everybody with what repeats differ by at the winner's optimum, and the base from the winner's constants.

    A base fitted less well than its rivals would be no judge of them.
    """
    campaign, winner = found.campaign, min(found.singles.values(), key=lambda c: c.cost)
    allow_repeats(campaign, winner.fit)
    found.singles = {name: Contestant(c.hypothesis, seen_again(campaign, c.fit)) for name, c in found.singles.items()}
    found.singles[winner.name] = finish(campaign, winner, rounds=4)
    found.null = seen_again(campaign, found.null)
    if found.null.cost - found.singles[winner.name].cost < CLOSE:
        nulls = [descend(campaign, found.null.unknowns, u, rounds=4) for u in (found.null.u, winner.fit.u[:base])]
        found.null = min(nulls, key=lambda fit: fit.cost)


def _finish_best(found: Inquiry, most: int) -> None:
    """Carry the best few single causes to their end, as long as one may still overtake the best."""
    done: dict[str, float] = {}
    for _ in range(most):
        waiting = [c for c in found.singles.values() if c.name not in done and c.cost < NEARLY * found.null.cost]
        if not waiting or found.campaign.stop():
            return
        next_one = min(waiting, key=lambda c: c.cost)
        if done:
            best = found.singles[min(done, key=lambda name: done[name])]
            beaten = next_one.cost - best.cost
            if unexplained(found.campaign, best.fit) < EXPLAINED and beaten > CLOSE:
                return
        found.singles[next_one.name] = finish(found.campaign, next_one, rounds=14 if not done else 8)
        done[next_one.name] = found.singles[next_one.name].cost


def _pairs(found: Inquiry, names: Sequence[str], thorough: bool) -> None:
    """Pairs that promise most by linear reckoning at the best single causes' optima."""
    campaign = found.campaign
    first = sorted(found.singles.values(), key=lambda c: c.cost)[: PARTNERS + 2 * thorough]
    promising = []
    for one in first:
        others = [n for n in names if n not in one.hypothesis.causes]
        groups = _ranked(looks(campaign, one.fit, others), one.fit)
        promising += [(group[0].promise, one, group) for group in groups]
    promising.sort(key=lambda row: row[0])
    for _, one, group in promising[: PAIRS + 3 * thorough]:
        if campaign.stop():
            return
        pair = finish(campaign, enter(campaign, one.fit, group[:1], onto=one.hypothesis), rounds=5)
        if pair.name not in found.pairs or pair.cost < found.pairs[pair.name].cost:
            found.pairs[pair.name] = pair
    # a single cause fitted less well than its pairs would make them look needed
    one = first[0]
    if with_it := [c for c in found.pairs.values() if one.name in c.hypothesis.causes]:
        pair = min(with_it, key=lambda c: c.cost)
        at = {k.target: u for k, u in zip(pair.fit.unknowns, pair.fit.u, strict=True)}
        again = descend(campaign, one.fit.unknowns, np.array([at[k.target] for k in one.fit.unknowns]), rounds=4)
        if again.cost < one.cost:
            found.singles[one.name] = Contestant(one.hypothesis, again)
