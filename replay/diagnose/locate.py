"""Where simulation and recordings differ: run, stretch between snaps, channel, cell, and what would wander."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.compare import CHANNELS
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import applied
from straw.replay.diagnose.misfit import Misfit, play
from straw.replay.diagnose.observation import Observation
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.search import Fit

Floats = NDArray[np.float64]

#: A snap's stretch begins this long before Phi shows it and ends this long after, s.
BEFORE_S, AFTER_S = 0.12, 0.05
#: Equations by the base's constants: what it says if one of them would have to differ from run to run.
EQUATIONS = {
    "r_ch_m": ("flow through the channel (equation 2)", "channel radius r_ch"),
    "c_zeta_n_s_per_m": ("axial dissipation (equation 4)", "damping c_zeta"),
    "c_phi_n_m_s_per_rad": ("angular dissipation (equation 4)", "damping c_phi"),
    "E_pa": ("elasticity (equations 6, 7)", "modulus E"),
    "h_m": ("elasticity (equations 6, 7)", "wall thickness h"),
    "zeta01": ("geometry of the odd frusta", "height zeta_01"),
    "zeta02": ("geometry of the even frusta", "height zeta_02"),
}


@dataclass(frozen=True)
class Located:
    """One stretch of one channel of one run that differs; shares are of the whole campaign's misfit."""

    run: str
    channel: str  # x, z or phi
    from_s: float
    to_s: float
    phase: str
    cells: tuple[int, ...]
    share_of_misfit: float
    kind: str  # timing, amplitude or shape
    rms: float  # m or rad


@dataclass(frozen=True)
class Wandering:
    """A base constant that runs want to differ in: each run's wish (share of its value), and what it goes with."""

    constant: str
    equation: str
    wish: dict[str, float]
    spread_sigma: float
    goes_with: str


def stretches(observed: Observation) -> list[tuple[str, float, float, int]]:
    """(phase, from, to, number of the snap or 0) of a run: before, during and after each snap."""
    begins, ends = observed.snaps_s[::2], observed.snaps_s[1::2]
    start, end = float(observed.time_s[0]), float(observed.time_s[-1])
    if len(begins) == 0:
        return [("no snap", start, end, 0)]
    out, at = [], start
    for k, begin in enumerate(begins, 1):
        until = float(ends[k - 1]) if k <= len(ends) else end
        first = max(at, float(begin) - BEFORE_S)
        last = min(end, until + AFTER_S)
        out.append((f"before snap {k}" if k == 1 else f"between snaps {k - 1} and {k}", at, first, k))
        out.append((f"during snap {k}", first, last, k))
        at = last
    out.append((f"after snap {len(begins)}", at, end, len(begins)))
    return [row for row in out if row[2] - row[1] > 0.01]


def locate(campaign: Campaign, fit: Fit, most: int = 12) -> list[Located]:
    """The stretches that make most of a fit's misfit, largest first."""
    rows = campaign.misfits(fit.unknowns, [fit.u])[0]
    found: list[Located] = []
    for observed, one in zip(campaign.observations, rows, strict=True):
        if one is None:
            continue
        order = snapping_cells(campaign, fit, observed)
        for phase, a, b, k in stretches(observed):
            here = (observed.time_s >= a) & (observed.time_s <= b)
            if not here.any():
                continue
            cells = order[k - 1 : k] if "during" in phase or "before" in phase or "between" in phase else ()
            for c, channel in enumerate(CHANNELS):
                scaled = one.plain[c, here] / observed.sigma()[c, here]
                beyond = float(np.sum(scaled**2) - np.count_nonzero(here))
                if beyond > 0:
                    kind = kind_of(observed, one, c, here)
                    rms = float(np.sqrt(np.mean(one.plain[c, here] ** 2)))
                    found.append(
                        Located(observed.name, channel.split("_")[0], a, b, phase, tuple(cells), beyond, kind, rms)
                    )
    total = sum(f.share_of_misfit for f in found) or 1.0
    found.sort(key=lambda f: -f.share_of_misfit)
    return [
        Located(**{**vars(f), "share_of_misfit": f.share_of_misfit / total})
        for f in found[:most]
        if f.share_of_misfit / total > 0.01
    ]


def kind_of(observed: Observation, one: Misfit, channel: int, here: NDArray[np.bool_]) -> str:
    """Whether a difference is mostly of time (goes with the rate), of amplitude (with the signal) or of shape."""
    t, y, e = observed.time_s[here], observed.tip[channel, here], one.plain[channel, here]
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


def snapping_cells(campaign: Campaign, fit: Fit, observed: Observation) -> tuple[int, ...]:
    """Cells in the order in which the fitted straw snaps them in this run."""
    straw, instrument = applied(campaign.straw, fit.unknowns, fit.u)
    seen, _ = play(observed, straw, instrument)
    zeta = seen.zeta_m[:, :, 1]
    crossed = [
        (int(np.flatnonzero(np.sign(zeta[:, cell]) != np.sign(zeta[0, cell]))[0]), cell + 1)
        for cell in range(zeta.shape[1])
        if np.any(np.sign(zeta[:, cell]) != np.sign(zeta[0, cell]))
    ]
    return tuple(cell for _, cell in sorted(crossed))


def wandering(campaign: Campaign, fit: Fit) -> list[Wandering]:
    """Base constants that would have to differ from run to run, to first order, the most telling first."""
    wishes: dict[str, list[float]] = {}
    precision: dict[str, list[float]] = {}
    runs = campaign.observations
    for k, unknown in enumerate(fit.unknowns):
        name = unknown.target.split(".")[1]
        if name not in EQUATIONS:
            continue
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
        out.append(Wandering(EQUATIONS[name][1], EQUATIONS[name][0], told, spread, _goes_with(runs, wish, known)))
    return sorted(out, key=lambda w: -w.spread_sigma)


def _goes_with(runs: Sequence[Observation], wish: Floats, weight: Floats) -> str:
    """What a wish from run to run goes with: direction of the pressure, its size, wear; else nothing."""
    pressure = np.array([_extreme(o) for o in runs])
    candidates = {
        "the direction of the pressure": np.sign(pressure),
        "the size of the pressure": np.abs(pressure),
        "the number of cycles before": np.array([float(o.run.cycle) for o in runs]),
        "whether a cell snaps": np.array([float(len(o.snaps_s) > 0) for o in runs]),
    }
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
    return f", with {what}" if what else ""


def _extreme(observed: Observation) -> float:
    log = observed.run.pressure
    assert log is not None
    return float(log.pressure_pa[np.argmax(np.abs(log.pressure_pa))])


def sentence(found: Sequence[Located], wanders: Sequence[Wandering]) -> str:
    """Where the base model and the recordings differ, in one sentence."""
    if not found:
        return "The base model and the recordings differ nowhere beyond noise."
    top = found[0]
    names = {"x": "X", "z": "Z", "phi": "Phi"}
    same = [f for f in found if f.phase.split(" ")[0] == top.phase.split(" ")[0]]
    share = sum(f.share_of_misfit for f in same)
    cell = f" (cell {top.cells[0]})" if top.cells else ""
    where = f"in {top.run}, which shows no snap" if top.phase == "no snap" else f"{top.phase}{cell} of {top.run}"
    text = (
        f"They differ most {where}, in {names[top.channel]}, and mostly in {top.kind}; "
        f"{100 * share:.0f} % of the misfit lies in stretches of that kind"
    )
    if wanders and wanders[0].spread_sigma > 10:
        w = wanders[0]
        text += f"; the {w.constant} would have to differ from run to run{_with(w.goes_with)}: {w.equation}"
    return text + "."
