"""How far apart two predictions of a run are: registered at their snaps, as recordings and predictions are compared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.settings import MISSING_EVENT_SIGMAS, SIMULATED_EVERY_S
from straw.replay.diagnose.systems.straw.constants import REPEATS
from straw.replay.diagnose.systems.straw.matching import matched
from straw.replay.diagnose.systems.straw.misfit import bend_basis
from straw.replay.diagnose.systems.straw.observation import REPEATABILITY_S
from straw.replay.diagnose.systems.straw.snaps import Levels, crossings, levels_of

Floats = NDArray[np.float64]

#: Unit of the difference: m, m, rad, including differences between repeats; and the noise's correlation time, s.
SIGMA, LASTS_S = np.array([40e-6, 60e-6, 3e-3]), 0.1
#: Standard deviations between repeats by which a repeat that snaps later than most is stiffer: 2, so that a run near
#: the threshold of a snap is recognised.
STIFF_SD = 2.0
#: Its elasticity as a factor.
STIFF = 1.0 + STIFF_SD * REPEATS["straw.E_pa"]


def snap_scatter(usual: Floats, stiff: Floats) -> Floats | None:
    """Standard deviation between repeats of the times at which snaps begin and end (k,), s, from the tip (3, n) of a
    straw and of one `STIFF` times as stiff; None where the number of snaps differs, so that a run does not repeat."""
    levels = levels_of(usual[2])
    mine, other = snap_times(usual, levels), snap_times(stiff, levels)
    return np.abs(other - mine) / STIFF_SD if len(mine) == len(other) else None


def separation(a: Floats, b: Floats, scatter_s: Floats) -> float:
    """Separation of two predicted tips (3, n) in sigmas; ``scatter_s`` (k,) of the snaps' times, as of `snap_scatter`.

    The times of snaps differ between repeats by a common factor in elasticity, besides independent noise, with
    covariance R = sigma^2 1 + g g'; the inverse is that of Sherman and Morrison. In the remaining difference an
    interval of the noise's correlation time counts once.
    """
    n = min(a.shape[1], b.shape[1])
    time_s = SIMULATED_EVERY_S * np.arange(n, dtype=np.float64)
    levels = levels_of(a[2])
    snaps_s, others_s = snap_times(a[:, :n], levels), snap_times(b[:, :n], levels)
    mine, others = matched(snaps_s, others_s)
    at_s, late_s = snaps_s[mine], others_s[others] - snaps_s[mine]
    look_s = time_s + bend_basis(time_s, at_s, late_s) @ late_s
    bent = np.stack([np.interp(look_s, time_s, row[:n]) for row in b])
    shape = np.sum(((bent - a[:, :n]) / SIGMA[:, None]) ** 2) * SIMULATED_EVERY_S / LASTS_S
    if len(scatter_s) != len(snaps_s):  # of a hypothesis with other snaps
        scatter_s = np.full(len(snaps_s), np.max(scatter_s, initial=0.0))
    g = scatter_s[mine] / REPEATABILITY_S
    late = late_s / REPEATABILITY_S
    timing = late @ late - (g @ late) ** 2 / (1 + g @ g)
    unmatched = len(snaps_s) + len(others_s) - 2 * len(mine)
    return float(np.sqrt(shape + timing + MISSING_EVENT_SIGMAS**2 * unmatched))


def snap_times(tip: Floats, levels: Levels | None = None) -> Floats:
    """Times (k,) at which snaps begin and end in a predicted tip (3, n), s; by its own levels unless told."""
    time_s = SIMULATED_EVERY_S * np.arange(tip.shape[1], dtype=np.float64)
    return crossings(time_s, tip[2], levels or levels_of(tip[2]))
