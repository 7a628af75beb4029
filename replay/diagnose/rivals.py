"""Hypotheses fitted from constants that are known: the best rival's, or those found with fewer runs; or not at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from straw.replay.diagnose.fit import Contestant, Fit, clipped, fitted
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import CALIBRATION
from straw.replay.diagnose.screen import Start
from straw.replay.diagnose.settings import FAR, FOLLOWED, ROUNDS
from straw.replay.diagnose.tournament import fitted_contestant


def from_each_other(found: Inquiry) -> None:
    """The base, and the best rivals, fitted again from the constants of the best of all, as a search that ended in
    another local minimum is no evidence against a hypothesis."""
    campaign, n = found.campaign, len(found.null.unknowns)
    best = found.contestants[:FOLLOWED]
    if not best or found.null.cost < best[0].cost + CALIBRATION.scale:
        return  # nothing is better than the base
    for one in best:
        if found.null.cost > best[0].cost + FAR and one is not best[0]:
            break  # the base's constants are not the cause
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


def as_before(found: Inquiry, before: Inquiry, names: Sequence[str]) -> None:
    """The best hypotheses of fewer runs, from their constants there."""
    for one in before.contestants[:FOLLOWED]:
        if set(one.hypothesis.causes) <= set(names) and one.cost < before.null.cost - CALIBRATION.scale:
            hypothesis = found.campaign.hypothesis(one.hypothesis.causes)
            start = Start(hypothesis, clipped((*found.null.unknowns, *hypothesis.unknowns), one.fit.u))
            found.keep(fitted_contestant(found.campaign, start, ROUNDS, found.null.unknowns))
