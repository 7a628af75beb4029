"""Where simulation and recordings differ: run, interval between events, channel, part, and constants that vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.recording import Channel, Recording
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.system import Misfit

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Located:
    """One interval of one channel of one run that differs; shares are of the whole campaign's misfit."""

    run: str
    channel: str  # as findings name it
    from_s: float
    to_s: float
    phase: str
    cells: tuple[int, ...]
    share_of_misfit: float
    kind: str  # timing, amplitude or shape
    rms: float  # SI


@dataclass(frozen=True)
class Wandering:
    """A base constant that would vary between runs: each run's deviation (share of its value), and its correlate."""

    constant: str
    equation: str
    wish: dict[str, float]
    spread_sigma: float
    goes_with: str


def locate(campaign: Campaign, fit: Fit, most: int = 12) -> list[Located]:
    """The intervals with most of a fit's misfit, largest first."""
    rows = campaign.misfits(fit.unknowns, [fit.u])[0]
    found: list[Located] = []
    for observed, one in zip(campaign.observations, rows, strict=True):
        if one is None:
            continue
        order = campaign.system.places(campaign, fit, observed)
        for part in observed.stretches():
            here = (observed.time_s >= part.from_s) & (observed.time_s <= part.to_s)
            if not here.any():
                continue
            cells = order[part.event - 1 : part.event] if part.during else ()
            for c, channel in enumerate(campaign.system.channels):
                scaled = one.plain[c, here] / observed.sigma()[c, here]
                beyond = float(np.sum(scaled**2) - np.count_nonzero(here))
                if beyond > 0:
                    kind = kind_of(observed, one, c, here)
                    rms = float(np.sqrt(np.mean(one.plain[c, here] ** 2)))
                    at = part.from_s, part.to_s, part.phase
                    found.append(Located(observed.name, channel.short, *at, tuple(cells), beyond, kind, rms))
    total = sum(f.share_of_misfit for f in found) or 1.0
    found.sort(key=lambda f: -f.share_of_misfit)
    return [
        Located(**{**vars(f), "share_of_misfit": f.share_of_misfit / total})
        for f in found[:most]
        if f.share_of_misfit / total > 0.01
    ]


def kind_of(observed: Recording, one: Misfit, channel: int, here: NDArray[np.bool_]) -> str:
    """Whether a difference is mostly of time (like the rate), of amplitude (like the signal) or of shape."""
    t, y, e = observed.time_s[here], observed.seen[channel, here], one.plain[channel, here]
    if len(t) < 8:
        return "shape"
    step = max(3, round(0.01 / float(np.median(np.diff(t)))))
    smooth = np.convolve(np.pad(y, step, mode="edge"), np.ones(2 * step + 1) / (2 * step + 1), mode="valid")
    rate, size = np.gradient(smooth, t), smooth - smooth[0]
    whole = float(np.sum(e**2)) or 1.0
    explained = {}
    for name, column in (("timing", rate), ("amplitude", size)):
        weight = float(column @ column)
        explained[name] = float((column @ e) ** 2 / weight / whole) if weight > 0 else 0.0
    explained["amplitude"] = max(explained["amplitude"], float(np.mean(e) ** 2 * len(e) / whole))
    best = max(explained, key=lambda name: explained[name])
    return best if explained[best] > 0.5 else "shape"


def wandering(campaign: Campaign, fit: Fit) -> list[Wandering]:
    """Base constants that would have to vary from run to run, to first order, the most significant first."""
    wishes: dict[str, list[float]] = {}
    precision: dict[str, list[float]] = {}
    said: dict[str, tuple[str, str]] = {}
    runs = campaign.observations
    for k, unknown in enumerate(fit.unknowns):
        name, words = unknown.target, campaign.system.equation(unknown)
        if words is None:
            continue
        said[name] = words
        for part in campaign.slices():
            slope = fit.slopes[part, k]
            w = weights(fit.residual[part])
            weight = float(slope @ (w * slope)) + 1e-9
            wishes.setdefault(name, []).append(-float(slope @ (w * fit.residual[part])) / weight * unknown.scale)
            precision.setdefault(name, []).append(weight / unknown.scale**2)
    out = []
    for name, values in wishes.items():
        wish: Floats = np.array(values)
        known: Floats = np.array(precision[name])
        spread = float(np.sqrt(np.sum(known * (wish - np.average(wish, weights=known)) ** 2)))
        told = dict(zip((o.name for o in runs), values, strict=True))
        out.append(Wandering(said[name][1], said[name][0], told, spread, _goes_with(runs, wish, known)))
    return sorted(out, key=lambda w: -w.spread_sigma)


def _goes_with(runs: Sequence[Recording], wish: Floats, weight: Floats) -> str:
    """The run condition with which a constant's variation correlates; else empty."""
    made = [o.conditions() for o in runs]
    candidates = {name: np.array([one[name] for one in made]) for name in made[0]}
    centred = wish - np.average(wish, weights=weight)
    best, most = "", 0.7
    for name, x in candidates.items():
        y = x - np.average(x, weights=weight)
        size = float(np.sum(weight * y**2) * np.sum(weight * centred**2))
        r = abs(float(np.sum(weight * y * centred))) / np.sqrt(size) if size > 0 else 0.0
        if r > most:
            best, most = name, r
    return best


def _with(what: str) -> str:
    return f", in correlation with {what}" if what else ""


def sentence(found: Sequence[Located], wanders: Sequence[Wandering], channels: Sequence[Channel]) -> str:
    """Where the base model and the recordings differ, in words."""
    if not found:
        return "The base model and the recordings differ nowhere beyond noise."
    top = found[0]
    names = {channel.short: channel.symbol for channel in channels}
    same = [f for f in found if f.phase.split(" ")[0] == top.phase.split(" ")[0]]
    share = sum(f.share_of_misfit for f in same)
    cell = f" (cell {top.cells[0]})" if top.cells else ""
    where = f"in {top.run}, which shows no snap" if top.phase == "no snap" else f"{top.phase}{cell} of {top.run}"
    text = (
        f"Base model and recordings differ most {where}, in {names[top.channel]}, mostly in {top.kind}. "
        f"Intervals of this kind contain {100 * share:.0f} % of the misfit."
    )
    if wanders and wanders[0].spread_sigma > 10:
        w = wanders[0]
        text += f" The {w.constant} of the {w.equation} would have to vary from run to run{_with(w.goes_with)}."
    return text
