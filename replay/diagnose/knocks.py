"""Out of a valley that is not the deepest: a fit is knocked about, and followed where that leads further down."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import LITTLE, Contestant, finish
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.search import Fit, clipped, cost_at, descend
from straw.replay.diagnose.start import dampings

Floats = NDArray[np.float64]

#: Knocks in units of u: of one unknown, and of two cells against each other; how many of the best are followed; and
#: what share of the cost the best must leave at most to be worth another round.
ALONE, AGAINST, FOLLOWED, WORTH = 1.0, 0.8, 3, 0.97
MOST = 6
#: Cost for each difference between outlines up to which they agree; the truth leaves 0.2.
DEEP = 0.25


def deep(fit: Fit) -> bool:
    """Whether a fit to outlines leaves hardly more than noise, which is small beside what an outline may be off by."""
    return fit.cost < DEEP * len(fit.residual)


def cell_by_cell(unknowns: Sequence[Unknown]) -> list[int]:
    """Which of the unknowns belong to one cell each."""
    return [k for k, unknown in enumerate(unknowns) if unknown.target.rpartition(".")[2].isdigit()]


def knocked(outlines: Campaign, one: Contestant, rounds: int, share: float) -> Contestant:
    """A fit to outlines carried on, and knocked about as long as that gains.

    Of two cells that are about as strong, one snaps at a time, and a damping that is far too small rings through the
    same snaps: where the fit has them wrong, every path to the right way leads uphill.
    """
    one = finish(outlines, one, rounds=rounds, share=share)
    for _ in range(MOST):
        if outlines.stop() or deep(one.fit) or outlines.leaves_out():
            break
        fit = one.fit
        points = [clipped(fit.unknowns, u) for u in (*dampings(fit.unknowns, fit.u), *_knocks(fit.unknowns, fit.u))]
        costs = [
            cost_at(fit.unknowns, u, residual)
            for residual, u in zip(outlines.residuals(fit.unknowns, points), points, strict=True)
        ]
        tried = [
            descend(outlines, fit.unknowns, points[k], slopes=fit.slopes, rounds=3, share=LITTLE)
            for k in np.argsort(costs, kind="stable")[:FOLLOWED]
        ]
        best = min(tried, key=lambda fit: fit.cost)
        if best.cost > WORTH * fit.cost:
            break
        one = finish(outlines, replace(one, fit=best), rounds=rounds, share=share)
    return one


def _knocks(unknowns: Sequence[Unknown], u: Floats) -> list[Floats]:
    """Points around u: each unknown but damping to either side, and each two cells against each other."""
    e = np.eye(len(u))
    others = [k for k, unknown in enumerate(unknowns) if not unknown.target.startswith("straw.c_")]
    alone = [u + sign * ALONE * min(unknowns[k].sd, 1.0) * e[k] for k in others for sign in (1, -1)]
    return alone + [u + AGAINST * (e[a] - e[b]) for a, b in itertools.permutations(cell_by_cell(unknowns), 2)]
