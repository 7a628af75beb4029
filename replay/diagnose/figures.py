"""Figures of a fit: its constants with their sigmas, the smallest effect seen."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import decisive
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.settings import ONE_DEVIATION
from straw.replay.diagnose.system import System

Floats = NDArray[np.float64]


def constants_of(system: System, best: Contestant) -> dict[str, dict[str, dict[str, Any]]]:
    """The causes' constants with one sigma, by cause and constant."""
    fit = best.fit
    covariance = covariance_of(fit)
    out: dict[str, dict[str, dict[str, Any]]] = {cause: {} for cause in best.hypothesis.causes}
    for k, (unknown, u) in enumerate(zip(fit.unknowns, fit.u, strict=True)):
        cause, name, unit = system.named(unknown)
        if cause in out:
            sigma = abs(unknown.per_u(float(u))) * float(np.sqrt(covariance[k, k]))
            out[cause][name] = {"value": unknown.value(float(u)), "sigma": sigma, "unit": unit}
    return out


def covariance_of(fit: Fit) -> Floats:
    """Of a fit's u, (unknowns, unknowns); residuals beyond noise widen it.

    So many squared sigmas are one deviation here (`ONE_DEVIATION`): every model is incomplete and its constants
    compensate for that, so that instruments' constants were off by up to ten of the likelihood's own deviations.
    """
    w = weights(fit.residual)
    spread = max(1.0, float(np.mean(w * fit.residual**2)))
    prior = np.diag([1 / k.sd**2 for k in fit.unknowns])
    curvature = (fit.slopes * w[:, None]).T @ fit.slopes / (spread * ONE_DEVIATION) + prior
    return np.asarray(np.linalg.pinv(curvature))


def told(constants: dict[str, dict[str, Any]]) -> list[str]:
    """A cause's constants of `constants_of`, each as text; a pure number has no unit."""
    return [
        f"{name} = {found['value']:.4g} ± {found['sigma']:.2g} {found['unit']}".removesuffix(" 1")
        for name, found in constants.items()
    ]


def smallest_seen(
    campaign: Campaign, found: Inquiry, *, beside: Fit | None = None, but: Collection[str] = ()
) -> dict[str, str]:
    """The smallest effect of each cause these runs would have shown: four sigmas, estimated to first order.

    ``beside`` the base's fit or another; ``but``: causes left out.
    """
    null, out = beside or found.null, {}
    w = np.sqrt(weights(null.residual))
    known = null.slopes * w[:, None]
    prior = np.diag([1 / k.sd**2 for k in null.unknowns])
    n = len(null.u)
    for c in found.singles.values():
        unknowns = (*null.unknowns, *c.hypothesis.unknowns)
        strengths = sum(k.kind == "strength" for k in unknowns[n:])
        if c.name in but:
            continue
        if strengths > 4 or unknowns[n].kind != "strength":  # a spread has no single size, a form none
            continue
        # shapes from the prior, as a fitted shape without an effect is arbitrary
        start = np.array(c.hypothesis.starts[0])
        little = [0.3 * u / start[0] if k.kind == "strength" else u for k, u in zip(unknowns[n:], start, strict=True)]
        u = np.concatenate([null.u, little])
        unknown = unknowns[n]
        column = (campaign.residuals(unknowns, [u])[0] - null.residual) * w / unknown.value(0.3)
        shadow = known @ np.linalg.solve(known.T @ known + prior, known.T @ column)
        size = float(np.linalg.norm(column - shadow))
        if size > 0:
            _, name, unit = campaign.system.named(unknown)
            out[c.name] = f"{name} {np.sqrt(decisive()) / size:.2g} {unit}"
    return out
