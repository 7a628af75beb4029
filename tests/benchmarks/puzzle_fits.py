"""Fits of the paper's puzzle: every run by itself or all with one set, from starts without knowledge of the truth."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, evaluated, fitted
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.random_effects import linearise
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.systems.straw.base import C_PHI, C_ZETA, R_CH, base_fit, different_runs, logarithmic
from straw.replay.diagnose.systems.straw.constants import REPEATS, REPEATS_MOUNT, base_unknowns
from straw.replay.diagnose.systems.straw.library import causes, hypothesis
from straw.replay.diagnose.systems.straw.observation import Observation
from straw.replay.diagnose.systems.straw.of import straw_of
from straw.replay.progress import say

Floats = NDArray[np.float64]

TERMS = ("squeeze_film", "fluid_inertia", "cohesion", "frustum_spread")
#: What the paper fitted to each run by itself; targets without ``straw.``.
WISHED = ("c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad", "r_ch_m")
DELAY = "instrument.clock_offset_s"
#: Starting values of the four laws by constant: a few sizes each.
LOOKED_AT: dict[str, tuple[float, ...]] = {
    "straw.c_zeta_n_s_per_m": (2.0, 10.0),
    "straw.c_phi_n_m_s_per_rad": (2e-3, 5e-3),
    "term.squeeze_film.folded_n_s_per_m": (1e3, 5e3, 20e3),
    "term.squeeze_film.gap_m": (0.1e-3, 0.2e-3),
    "term.cohesion.force_n": (2.0, 6.0),
    "term.fluid_inertia.inertance_kg_per_m4": (1e7, 6e7),
}
WEAKER = -0.06
#: Cells of one straw differ by about 3 %, and by a tenth at most: those that never snap in these runs would otherwise
#: absorb residuals of the other laws' forms.
ALIKE, AT_MOST = 1.0, 0.10
#: Number of starts that are fitted briefly for each cell that may be weaker.
FOLLOWED = 3


@dataclass(frozen=True)
class Number:
    """A constant found, with one sigma."""

    value: float
    sigma: float

    def away(self, other: Number) -> float:
        """Distance from another in sigmas."""
        return abs(self.value - other.value) / float(np.hypot(self.sigma, other.sigma))


def numbers(fit: Fit) -> dict[str, Number]:
    """The fitted constants by target; residuals beyond noise widen sigma."""
    w = weights(fit.residual)
    spread = max(1.0, float(np.mean(w * fit.residual**2)))
    curvature = (fit.slopes * w[:, None]).T @ fit.slopes / spread + np.diag([1 / k.sd**2 for k in fit.unknowns])
    sd = np.sqrt(np.diag(np.linalg.inv(curvature)))
    return {
        k.target: Number(k.value(float(u)), abs(k.per_u(float(u))) * float(s))
        for k, u, s in zip(fit.unknowns, fit.u, sd, strict=True)
    }


def alone_unknowns(straw_unknowns: tuple[Unknown, ...]) -> tuple[Unknown, ...]:
    """Unknowns of a single run's fit: the paper's three constants, a delay, and the differences between repeats."""
    three = tuple(k for k in straw_unknowns if k.target.removeprefix("straw.") in WISHED)
    (delay,) = causes(1)["clock_offset"][0]
    stiffness = Unknown("straw.E_pa", REPEATS["straw.E_pa"], 1.0, "log")
    return (*three, delay, stiffness, REPEATS_MOUNT)


def at(unknowns: Sequence[Unknown], values: Mapping[str, float], else_u: Floats | None = None) -> Floats:
    """u of given values, SI; of the others ``else_u``, by default their prior's mean."""
    u = np.array([k.mean for k in unknowns]) if else_u is None else else_u.copy()
    for i, k in enumerate(unknowns):
        if k.target in values:
            x = values[k.target]
            u[i] = np.log(x / k.start) / k.scale if k.kind == "log" else k.at(x / k.scale)
    return u


def tightened(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats, rounds: int = 10) -> Fit:
    """The fit from u, first to slow parts and envelopes, then to all samples."""
    for here in (campaign.coarse(), campaign):
        fit = fitted(here, unknowns, u, rounds=rounds)
        u = fit.u
    return fit


def settled(campaign: Campaign, fit: Fit, rounds: int = 6) -> Fit:
    """The fit repeated with an allowance for the scatter of repeats."""
    linearise(campaign, fit)
    return fitted(campaign, fit.unknowns, fit.u, rounds=rounds)


def by_itself(campaign: Campaign) -> Fit:
    """One run fitted by itself with the campaign's straw, from a grid of the three constants with the delay that
    brings the first snap to its time and without one."""
    unknowns = alone_unknowns(base_unknowns(straw_of(campaign)))
    points = [
        at(unknowns, dict(zip((f"straw.{name}" for name in WISHED), values, strict=True)))
        for values in itertools.product(C_ZETA[::2], C_PHI[::2], R_CH[2::2])
    ]
    delayed = []
    for point, (one,) in zip(points, campaign.misfits(unknowns, points), strict=True):
        if one is not None and np.isfinite(one.late_s[:1]).any():
            delayed.append(at(unknowns, {DELAY: -float(np.clip(one.late_s[0], -1.5, 1.5))}, point))
    points += delayed
    looks = logarithmic(campaign.coarse(), unknowns, points)
    best = [points[k] for k in np.argsort(looks, kind="stable")[: FOLLOWED + 1]]
    ends = [fitted(campaign.coarse(), unknowns, u, rounds=6) for u in best]
    return tightened(campaign, unknowns, min(ends, key=lambda fit: fit.cost).u)


def near_own(campaign: Campaign) -> Fit:
    """One run fitted by itself from the constants of the campaign's straw without delay, without a wider search."""
    unknowns = alone_unknowns(base_unknowns(straw_of(campaign)))
    return fitted(campaign, unknowns, np.zeros(len(unknowns)), rounds=8)


def base_for_all(campaign: Campaign) -> Fit:
    """The base model with one set of its own constants for all runs, no delay."""
    return settled(campaign, base_fit(campaign)[0])


def improved_for_all(campaign: Campaign) -> Fit:
    """The model with the four laws and one set for all runs, no delay.

    The weakest cell snaps first, and no local search crosses from one order of snaps to another: each cell that snaps
    in the runs is tried as the weaker one, and none.
    """
    laws = hypothesis(TERMS, straw_of(campaign).cells).unknowns
    laws = tuple(_alike(k) if ".frustum_spread." in k.target else k for k in laws)
    unknowns = (*base_unknowns(straw_of(campaign)), *laws)
    loose = campaign.coarse()
    few = loose.only(different_runs(campaign.observations))
    ends = []
    for cell in (None, *snapping(campaign.observations)):
        weaker = {} if cell is None else {f"term.frustum_spread.E_relative.{cell}": WEAKER}
        points = [
            at(unknowns, {**dict(zip(LOOKED_AT, sizes, strict=True)), **weaker})
            for sizes in itertools.product(*LOOKED_AT.values())
        ]
        best = np.argsort(logarithmic(few, unknowns, points), kind="stable")[:FOLLOWED]
        first = [fitted(few, unknowns, points[k], rounds=4, share=0.02) for k in best]
        u = min(first, key=lambda fit: fit.cost).u
        ends.append(fitted(loose, unknowns, u, rounds=8, share=0.01))
        say(f"weaker cell {cell or 'none'}: from {[round(fit.cost) for fit in first]} to {ends[-1].cost:.0f}")
    return settled(campaign, tightened(campaign, unknowns, min(ends, key=lambda fit: fit.cost).u, rounds=12))


def _alike(spread: Unknown) -> Unknown:
    """One cell's share of a spread, with a prior that keeps it near the others."""
    most = spread.at(AT_MOST / spread.scale)
    return replace(spread, sd=ALIKE, low=-most, high=most)


def one_delay(campaign: Campaign, fit: Fit) -> tuple[Number, float]:
    """The common delay (s) of all runs beside this fit, to first order, constants free, and the misfit it removes."""
    (delay,) = causes(1)["clock_offset"][0]
    unknowns, u = (*fit.unknowns, delay), np.append(fit.u, 0.0)
    at_fit = evaluated(campaign, unknowns, u)
    residual, slopes = at_fit.residual, at_fit.slopes
    w = weights(residual)
    # at the optimum the fit itself has nothing to gain: a remaining gradient is numerical error
    gradient = np.append(np.zeros(len(fit.u)), slopes[:, -1] @ (w * residual))
    spread = max(1.0, float(np.mean(w * residual**2)))
    inverse = np.linalg.inv((slopes * w[:, None]).T @ slopes + np.diag([1 / k.sd**2 for k in unknowns]))
    sigma = float(np.sqrt(spread * inverse[-1, -1]))
    per_u = delay.per_u(0.0)
    return Number(-float(inverse[-1] @ gradient) * per_u, sigma * per_u), float(gradient @ inverse @ gradient)


def snapping(observations: Sequence[Observation]) -> list[int]:
    """Cells that the runs say may have snapped: deployed ones in a run that folds, folded ones in one that deploys."""
    cells: set[int] = set()
    for o in observations:
        assert o.run.initial_deployed is not None
        deployed = set(o.run.initial_deployed)
        folds = float(o.tip[0, -1]) < float(o.tip[0, 0])
        cells |= deployed if folds else set(range(1, o.run.cells + 1)) - deployed
    return sorted(cells)
