"""Snaps in the tip's motion: Phi leaves its rest level while a frustum is bent, and returns or stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from straw.replay.diagnose.recording import Stretch

Floats = NDArray[np.float64]

#: Shares of the run's largest excursion of Phi at which a snap begins and ends (a Schmitt trigger: ringing stays
#: between them).
LEAVES, RETURNS = 0.5, 0.25
#: Smallest excursion of Phi that is a snap, rad; a frustum that snaps bends by 0.2.
SMALLEST_RAD = 0.08
#: Phi is averaged over this before it is compared with the levels, s: one picture at 240 Hz.
SMOOTHED_S = 4e-3
#: A snap that begins this soon after another has ended is its ringing, s.
RINGS_S = 0.06
#: A snap's interval begins this long before Phi shows it and ends this long after; shorter ones are ignored, s.
BEFORE_S, AFTER_S, SHORTEST_S = 0.12, 0.05, 0.01
#: A cell has snapped when zeta is beyond this, m; a crossing of Phi this near belongs to it, s.
PASSED_M, NEAR_S = 1e-3, 0.05


@dataclass(frozen=True)
class Levels:
    """Angles (rad) that define a run's snaps: Phi at rest, and the excursions at which snaps begin and end."""

    rest: float
    leaves: float  # signed
    returns: float  # signed

    @property
    def any(self) -> bool:
        """Whether the run moves far enough to show a snap."""
        return abs(self.leaves) >= LEAVES * SMALLEST_RAD


def levels_of(phi_rad: Floats) -> Levels:
    """Levels from the measured Phi (n,) of a run."""
    rest = float(np.median(phi_rad))
    # of all samples but three in a thousand, so that a few wrong ones do not count
    high, low = np.quantile(phi_rad, [0.997, 0.003]) - rest
    most = high if high >= -low else low
    return Levels(rest, LEAVES * float(most), RETURNS * float(most))


def crossings(time_s: Floats, phi_rad: Floats, levels: Levels) -> Floats:
    """Times (s) at which a snap begins, ends, the next begins, ...; empty where none does.

    Phi (n,) at times (n,), evenly spaced or nearly so. Straight lines between samples place the crossing.
    """
    if not levels.any or len(time_s) < 8:
        return np.empty(0)
    step_s = float(np.median(np.diff(time_s)))
    sign = np.sign(levels.leaves)
    height = sign * gaussian_filter1d(phi_rad - levels.rest, SMOOTHED_S / step_s)
    high, low = abs(levels.leaves), abs(levels.returns)
    out: list[float] = []
    at = 0
    while True:
        away = len(out) % 2 == 1
        beyond = np.flatnonzero(height[at:] < low if away else height[at:] > high)
        if len(beyond) == 0:
            return _without_rings(np.array(out))
        k = at + int(beyond[0])
        level = low if away else high
        share = (level - height[k - 1]) / (height[k] - height[k - 1]) if k > 0 else 1.0
        out.append(float(time_s[k - 1] + share * (time_s[k] - time_s[k - 1])) if k > 0 else float(time_s[0]))
        at = k


def _without_rings(crossed_s: Floats) -> Floats:
    """Begins and ends of snaps, where one that follows the last immediately is its ringing."""
    gaps = crossed_s[2::2] - crossed_s[1:-1:2]
    drop = 2 * np.flatnonzero(gaps < RINGS_S) + 1
    return np.delete(crossed_s, np.concatenate([drop, drop + 1]))


def stretches(time_s: Floats, snaps_s: Floats) -> list[Stretch]:
    """Intervals before, during and after each snap of a run with samples at times (n,) and these snap times (k,)."""
    begins, ends = snaps_s[::2], snaps_s[1::2]
    start, end = float(time_s[0]), float(time_s[-1])
    if len(begins) == 0:
        return [Stretch("no snap", start, end)]
    out, at = [], start
    for k, begin in enumerate(begins, 1):
        until = float(ends[k - 1]) if k <= len(ends) else end
        first = max(at, float(begin) - BEFORE_S)
        last = min(end, until + AFTER_S)
        out.append(Stretch(f"before snap {k}" if k == 1 else f"between snaps {k - 1} and {k}", at, first, k, True))
        out.append(Stretch(f"during snap {k}", first, last, k, True))
        at = last
    out.append(Stretch(f"after snap {len(begins)}", at, end, len(begins)))
    return [one for one in out if one.to_s - one.from_s > SHORTEST_S]


def cell_snaps(time_s: Floats, zeta_m: Floats, crossed_s: Floats) -> Floats:
    """Times (s) at which each snap begins and ends, from the cells themselves, in order.

    For a prediction whose frusta snap straight through, so that Phi hardly shows it: ``zeta_m`` (n, cells) of the even
    frusta at times (n,). A snap that Phi shows too (``crossed_s`` as from `crossings`) keeps those times, for another
    both are when zeta changes its sign, on a straight line between samples.
    """
    snaps: list[float] = []
    for zeta in zeta_m.T:
        deep = np.flatnonzero(np.abs(zeta) > PASSED_M)
        side = np.sign(zeta)
        passed = deep[np.diff(side[deep], prepend=side[0]) != 0]
        changes = np.flatnonzero(np.diff(side))
        last = np.searchsorted(changes, passed) - 1
        before, after = zeta[changes], zeta[changes + 1]
        crossed = time_s[changes] + before / (before - after) * np.diff(time_s)[changes]
        snaps += np.where(last >= 0, crossed[last], time_s[passed]).tolist() if len(changes) else []
    begins, ends = crossed_s[::2], crossed_s[1::2]
    out: list[float] = []
    for at in sorted(snaps):
        shown = [k for k in range(len(ends)) if begins[k] - NEAR_S <= at <= ends[k] + NEAR_S]
        out += [float(begins[shown[0]]), float(ends[shown[0]])] if shown else [at, at]
    return np.array(out)
