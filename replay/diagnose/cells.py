"""Constants that differ from cell to cell: a few runs do not tell them all, and no descent swaps which cell snaps."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from replay.diagnose.campaign import Campaign
from replay.diagnose.contest import LITTLE, Contestant, finish
from replay.diagnose.hypothesis import Unknown
from replay.diagnose.search import clipped, cost_at, descend

Floats = NDArray[np.float64]

#: Knocks in units of u: of one cell, and of two against each other; how many of the best are followed; and what share
#: of the cost the best must leave at most to be worth another round.
ALONE, AGAINST, FOLLOWED, WORTH = 1.0, 0.8, 3, 0.97
MOST = 6


def cell_by_cell(unknowns: Sequence[Unknown]) -> list[int]:
    """Which of the unknowns belong to one cell each."""
    return [k for k, unknown in enumerate(unknowns) if unknown.target.rpartition(".")[2].isdigit()]


def swapped(outlines: Campaign, one: Contestant, rounds: int, share: float) -> Contestant:
    """A fit to outlines of few runs carried on in those of all, and knocked about as long as that gains.

    Of two cells that are about as strong, one snaps at a time; where the fit has them the wrong way round, both paths
    to the right way lead uphill.
    """
    one = finish(outlines, one, rounds=rounds, share=share)
    for _ in range(MOST):
        if outlines.stop():
            break
        fit = one.fit
        points = [clipped(fit.unknowns, fit.u + knock) for knock in _knocks(cell_by_cell(fit.unknowns), len(fit.u))]
        costs = [
            cost_at(fit.unknowns, u, residual)
            for residual, u in zip(outlines.residuals(fit.unknowns, points), points, strict=True)
        ]
        tried = [
            descend(outlines, fit.unknowns, points[k], slopes=fit.slopes, rounds=3, share=LITTLE)
            for k in np.argsort(costs)[:FOLLOWED]
        ]
        best = min(tried, key=lambda fit: fit.cost)
        if best.cost > WORTH * fit.cost:
            break
        one = finish(outlines, Contestant(one.hypothesis, best), rounds=rounds, share=share)
    return one


def _knocks(cells: Sequence[int], size: int) -> list[Floats]:
    """Steps in u: each cell to either side, and each two against each other."""
    e = np.eye(size)
    alone = [sign * ALONE * e[k] for k in cells for sign in (1, -1)]
    return alone + [AGAINST * (e[a] - e[b]) for a, b in itertools.permutations(cells, 2)]
