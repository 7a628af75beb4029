"""Figures of a fit: its constants with their sigmas, how it does on runs held out, the smallest effect seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.terms import TERMS
from straw.replay.compare import CHANNELS
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import Contestant
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import COUNTS_AS_ONE
from straw.replay.diagnose.locate import Located
from straw.replay.diagnose.observation import REPEATABILITY_S
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.search import Fit, descend, measured_slopes

Floats = NDArray[np.float64]

#: Units of what is found in instruments.
UNITS = {
    "clock_offset_s": "s",
    "clock_drift": "1",
    "length_scale": "1",
    "camera_roll_rad": "rad",
    "tip_offset_m": "m",
    "gauge_offset_pa": "Pa",
    "gauge_gain": "1",
}
#: Squared sigmas that are one deviation of a constant: six instruments' constants were 0.04 to 2.2 of these off.
ONE_DEVIATION = 20.0
#: Slopes for sigmas are measured by steps that move the runs by so many sigmas (root mean square).
FELT_SIGMAS = 1.0


@dataclass(frozen=True)
class Held:
    """RMS by channel (m, rad) on runs that were not fitted: base model, improved model, and the recordings' noise."""

    train: tuple[str, ...]
    heldout: tuple[str, ...]
    chi2_before: float
    chi2_after: float
    before: dict[str, float]
    after: dict[str, float]
    floor: dict[str, float]


def constants_of(campaign: Campaign, best: Contestant) -> dict[str, dict[str, dict[str, Any]]]:
    """The causes' constants with one sigma, by cause and constant; residuals beyond noise widen it.

    So many squared sigmas are one deviation here (`ONE_DEVIATION`): no model is nature, and the base's constants make
    up for what it leaves out, so instruments' constants came out up to ten of the likelihood's own deviations wrong.

    The search's own slopes are good enough to go downhill, but what simulations leave out makes them look steeper where
    constants stand in for each other.
    """
    fit, fine = best.fit, campaign.finely()
    residual = fine.residuals(fit.unknowns, [fit.u])[0]
    slopes = measured_slopes(fine, fit.unknowns, fit.u, residual, range(len(fit.u)), FELT_SIGMAS)
    w = weights(fit.residual)
    spread = max(1.0, float(np.mean(w * fit.residual**2)))
    prior = np.diag([1 / k.sd**2 for k in fit.unknowns])
    covariance = np.linalg.pinv((slopes * w[:, None]).T @ slopes / (spread * ONE_DEVIATION) + prior)
    out: dict[str, dict[str, dict[str, Any]]] = {cause: {} for cause in best.hypothesis.causes}
    for k, (unknown, u) in enumerate(zip(fit.unknowns, fit.u, strict=True)):
        cause, name, unit = _named(unknown)
        if cause in out or name in UNITS:
            sigma = abs(unknown.per_u(float(u))) * float(np.sqrt(covariance[k, k]))
            place = next((c for c in out if cause.startswith(c) or name.startswith(c)), None)
            if place:
                out[place][name] = {"value": unknown.value(float(u)), "sigma": sigma, "unit": unit}
    return out


def told(constants: dict[str, dict[str, Any]]) -> list[str]:
    """A cause's constants as `constants_of` has them, each as a person writes it; a pure number has no unit."""
    return [
        f"{name} = {found['value']:.4g} ± {found['sigma']:.2g} {found['unit']}".removesuffix(" 1")
        for name, found in constants.items()
    ]


def _named(unknown: Unknown) -> tuple[str, str, str]:
    """Cause, constant and unit of an unknown."""
    kind, *rest = unknown.target.split(".")
    if kind == "term":
        (terms, name, *cell) = rest
        term = terms.partition("&")[0]
        unit = next(c.unit for c in TERMS[term].constants if c.name == name)
        return term, ".".join([name, *cell]), unit
    name = rest[0] if rest else kind
    return ("odd_frusta_compliance" if name == "odd_E" else name), name, UNITS.get(name, "1")


def hold_out(campaign: Campaign, null: Fit, better: Fit, located: Sequence[Located]) -> Held | None:
    """Base and improved model (or the base again) fitted once more without some runs, and how far each is off on those.

    Held out are runs in which the misfit is, of different kinds, and at most a third; None with fewer than three runs.
    """
    names = [o.name for o in campaign.observations]
    if len(names) < 3:
        return None
    blamed = list(dict.fromkeys(one.run for one in located)) + list(reversed(names))
    configurations: list[Any] = []
    out: list[str] = []
    for name in blamed:
        configuration = next(o.run.initial_deployed for o in campaign.observations if o.name == name)
        if name not in out and configuration not in configurations and len(out) < max(1, len(names) // 4):
            out.append(name)
            configurations.append(configuration)
    train, rest = campaign.only([n for n in names if n not in out]), campaign.only(out)
    fits = [
        (f.unknowns, descend(train, f.unknowns, f.u, rounds=3)) for f in ([null] if better is null else [null, better])
    ]
    rms = [_plain_rms(rest, unknowns, fit.u) for unknowns, fit in fits]
    floor = {
        c: float(np.sqrt(np.mean(np.concatenate([o.sigma(REPEATABILITY_S)[i] ** 2 for o in rest.observations]))))
        for i, c in enumerate(CHANNELS)
    }
    chi2 = [float(np.mean(fit.residual**2)) for _, fit in fits]
    return Held(tuple(n for n in names if n not in out), tuple(out), chi2[0], chi2[-1], rms[0], rms[-1], floor)


def _plain_rms(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats) -> dict[str, float]:
    rows = [one for one in campaign.misfits(unknowns, [u])[0] if one is not None]
    return {
        c: float(np.sqrt(np.mean(np.concatenate([one.plain[i] for one in rows]) ** 2))) if rows else float("nan")
        for i, c in enumerate(CHANNELS)
    }


def smallest_seen(campaign: Campaign, found: Inquiry) -> dict[str, str]:
    """The smallest effect of each cause these runs would have shown: four sigmas, estimated to first order."""
    null, out = found.null, {}
    w = np.sqrt(weights(null.residual))
    known = null.slopes * w[:, None]
    prior = np.diag([1 / k.sd**2 for k in null.unknowns])
    n = len(null.u)
    for c in found.singles.values():
        unknowns = c.fit.unknowns
        strengths = sum(k.kind == "strength" for k in unknowns[n:])
        if strengths > 4 or unknowns[n].kind != "strength":  # a spread has no one size, a form none
            continue
        # as it may act by its own account: what a fit found beside no effect is by chance
        start = np.array(c.hypothesis.starts[0])
        little = [0.3 * u / start[0] if k.kind == "strength" else u for k, u in zip(unknowns[n:], start, strict=True)]
        u = np.concatenate([null.u, little])
        unknown = unknowns[n]
        column = (campaign.residuals(unknowns, [u])[0] - null.residual) * w / unknown.value(0.3)
        shadow = known @ np.linalg.solve(known.T @ known + prior, known.T @ column)
        size = float(np.linalg.norm(column - shadow))
        if size > 0:
            _, name, unit = _named(unknown)
            out[c.name] = f"{name} {4 * np.sqrt(COUNTS_AS_ONE) / size:.2g} {unit}"
    return out
