"""Hypotheses fitted from constants that are known: the best rival's, or those found with fewer runs; or not at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from straw.replay.diagnose.fit import Contestant, Fit, clipped, fits_from, fitted
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import CALIBRATION
from straw.replay.diagnose.refine import reach
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.settings import FAR, FIRST_ROUNDS, FOLLOWED, ROUNDS
from straw.replay.diagnose.tournament import all_finished, fitted_contestants


def from_each_other(found: Inquiry) -> None:
    """The base, and the best rivals, fitted again from the constants of the best of all, as a search that ended in
    another local minimum is no evidence against a hypothesis."""
    campaign, n = found.campaign, len(found.null.unknowns)
    best = found.contestants[:FOLLOWED]
    if not best or found.null.cost < best[0].cost + CALIBRATION.scale:
        return  # nothing is better than the base
    # farther away than FAR, the base's constants are not the cause
    origins = best if found.null.cost <= best[0].cost + FAR else best[:1]
    again = fits_from(campaign, [(found.null.unknowns, one.fit.u[:n]) for one in origins], rounds=FIRST_ROUNDS)
    nearest = min(again, key=lambda fit: fit.cost)
    if nearest.cost < found.null.cost + reach(found):
        nearest = fitted(campaign, nearest.unknowns, nearest.u, rounds=ROUNDS)
    found.null = min(found.null, nearest, key=lambda fit: fit.cost)
    rivals = [one for one in best[1:] if one.cost < best[0].cost + FAR]
    moved = [(one.fit.unknowns, np.concatenate([best[0].fit.u[:n], one.fit.u[n:]])) for one in rivals]
    begun = fits_from(campaign, moved, rounds=FIRST_ROUNDS)
    near = [Contestant(one.hypothesis, fit) for one, fit in zip(rivals, begun, strict=True) if fit.cost < one.cost]
    for other in all_finished(campaign, near, ROUNDS):
        found.keep(other)


def absent(null: Fit, h: Hypothesis) -> Contestant:
    """A hypothesis that was not worth a fit: the base's fit with nothing of it."""
    start = np.where([k.kind == "strength" for k in h.unknowns], 0.0, h.starts[0])
    slopes = np.pad(null.slopes, ((0, 0), (0, len(h.unknowns))))
    return Contestant(
        h, Fit((*null.unknowns, *h.unknowns), np.concatenate([null.u, start]), null.residual, slopes, null.cost)
    )


def as_before(found: Inquiry, before: Inquiry, names: Sequence[str]) -> None:
    """The best hypotheses of fewer runs, from their constants there."""
    starts: list[Start] = []
    for one in before.contestants[:FOLLOWED]:
        if set(one.hypothesis.causes) <= set(names) and one.cost < before.null.cost - CALIBRATION.scale:
            hypothesis = found.campaign.hypothesis(one.hypothesis.causes)
            starts.append(Start(hypothesis, clipped((*found.null.unknowns, *hypothesis.unknowns), one.fit.u)))
    for one in fitted_contestants(found.campaign, starts, ROUNDS, found.null.unknowns):
        found.keep(one)
