"""All causes at once, and which one or two of them explain as much: best subsets of a saturated model.

Where two causes act, forward selection fails: beside a wrong first one no second explains much. So the base and all
causes are fitted together, with priors that shrink what is not needed, and every subset of one or two is rated by the
quadratic expansion of the cost there with the other causes absent (Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, clipped, cost_at, fitted, moved, normal_equations, step_to
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.refine import explains
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.settings import COARSE_ROUNDS, FAINT, LONGEST_STEP

Floats = NDArray[np.float64]

#: Deviation of a strength's prior, u: the longest step, ten times what is well seen, is two of them.
SHRUNK = LONGEST_STEP / 2


@dataclass(frozen=True, eq=False)
class Saturated:
    """The base with all causes that have a strength; ``own`` are the indices of each cause's unknowns, ``absent`` (n,)
    is u with no strength of any."""

    unknowns: tuple[Unknown, ...]
    base: int
    causes: tuple[Hypothesis, ...]
    own: tuple[tuple[int, ...], ...]
    absent: Floats

    def with_causes(self, starts: Sequence[Start]) -> Floats:
        """u (n,) with the base's constants of the first of these starts and the causes of all, the others faint."""
        u = np.where(self._strength, FAINT, self.absent)
        names = [cause.name for cause in self.causes]
        for start in starts:
            if start is starts[0]:
                u[: self.base] = start.u[: self.base]
            if start.hypothesis.name in names:
                u[list(self.own[names.index(start.hypothesis.name)])] = start.u[self.base :]
        return clipped(self.unknowns, u)

    @property
    def _strength(self) -> NDArray[np.bool_]:
        return np.array([one.kind == "strength" for one in self.unknowns])


def saturated(known: Fit, hypotheses: Sequence[Hypothesis]) -> Saturated:
    """A fit's unknowns and those of all these causes, each once, at the shape of its first start."""
    unknowns, absent = list(known.unknowns), known.u.tolist()
    causes, own = [], []
    for cause in hypotheses:
        targets = {one.target for one in cause.unknowns}
        strength = [one.kind == "strength" for one in cause.unknowns]
        if any(strength) and not targets & {one.target for one in unknowns}:
            causes.append(cause)
            own.append(tuple(range(len(unknowns), len(unknowns) + len(cause.unknowns))))
            unknowns += [
                replace(one, sd=min(one.sd, SHRUNK)) if strong else one
                for one, strong in zip(cause.unknowns, strength, strict=True)
            ]
            absent += np.where(strength, 0.0, cause.starts[0]).tolist()
    return Saturated(tuple(unknowns), len(known.u), tuple(causes), tuple(own), np.array(absent))


def subsets(
    campaign: Campaign, known: Fit, hypotheses: Sequence[Hypothesis], likely: Sequence[Start]
) -> list[list[Start]]:
    """Starts for every single cause and every pair, the most promising first, from each fit of all at once.

    One fit starts with the ``likely`` causes, one from ``known`` with nothing of any. They go only as far as the ranks
    need; the other one is left out where the nearer explains the comparison.
    """
    model = saturated(known, hypotheses)
    if not model.causes:
        return []
    points = [model.with_causes([]), *([model.with_causes(likely)] if likely else [])]
    residuals = campaign.residuals(model.unknowns, points)
    costs = [cost_at(model.unknowns, u, r) for u, r in zip(points, residuals, strict=True)]
    rankings: list[list[Start]] = []
    for k in np.argsort(costs, kind="stable"):
        # in two opened pairs (20261129-093, -097) the true one was first or second after six evaluations; with ten, the
        # same pairs are most probable in 20261129-097 and 20261130-092
        fit = fitted(campaign, model.unknowns, points[k], rounds=COARSE_ROUNDS[1])
        rankings.append(_ranked(model, fit, known.cost))
        if explains(fit) or campaign.stop():
            break
    return rankings


def _ranked(model: Saturated, fit: Fit, before: float) -> list[Start]:
    """Every single cause and every pair by the expansion of the cost about a fit of all, gains over ``before``."""
    H, g = normal_equations(fit.unknowns, fit.u, fit.residual, fit.slopes)
    every = range(len(model.causes))
    some = [*((k,) for k in every), *itertools.combinations(every, 2)]
    found = [_without_others(model, fit.u, H, g, one, before - fit.cost) for one in some]
    return sorted(found, key=lambda start: -start.gain)


def _without_others(model: Saturated, u: Floats, H: Floats, g: Floats, some: tuple[int, ...], gained: float) -> Start:
    """The minimum of the quadratic expansion about u, where all causes together have ``gained``, with ``some`` of them
    only."""
    free = [*range(model.base), *(k for cause in some for k in model.own[cause])]
    held = np.setdiff1d(np.arange(len(u)), free)
    step = np.zeros(len(u))
    step[held] = step_to(model.unknowns, u, model.absent)[held]
    step[free] = -np.linalg.solve(H[np.ix_(free, free)], g[free] + H[np.ix_(free, held)] @ step[held])
    first, *others = (model.causes[k] for k in some)
    hypothesis = others[0].beside(first) if others else first
    return Start(hypothesis, moved(model.unknowns, u, step)[free], gained + float(-2 * g @ step - step @ H @ step))
