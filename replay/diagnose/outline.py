"""A signal's outline: where it is once its swinging is averaged out, and how strongly it swings.

Point by point, a ringing tip agrees only with a straw that rings in phase, so damping and frequency can be found only
from close by. How strongly it swings has no phase: its logarithm is nearly linear in damping, from afar too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Floats = NDArray[np.float64]

#: The averages' standard deviation, s: longer than half a period of the tip's slowest swing, some 10 Hz.
AVERAGED_S = 0.035
#: What is averaged is slow: every so many of these one value is kept.
KEPT_S = 0.025
#: What moves may be off by this in time, s, and a swing by this in its logarithm.
LATE_S, SWING = 5e-3, 0.15
#: Channels whose swing is looked at: X, which is axial, and Phi, which bends.
SWINGING = (0, 2)


@dataclass(frozen=True, eq=False)
class Outline:
    """Of tip (3, n): slow (3, k) m, m, rad, and swing (2, k), logarithms; with the sigma of each at ``time_s`` (n,)."""

    time_s: Floats  # even grid on which it is looked at
    floor: Floats  # (3, 1) noise, which swings as well
    slow: Floats
    swing: Floats
    sigma: Floats  # (3, k) of slow
    sigma_swing: Floats  # (2, k)

    def differs(self, tip: Floats) -> Floats:
        """How far the outline of another tip (3, n), at ``time_s``, is off: in sigmas, one vector."""
        slow, swing = _parts(self.time_s, tip, self.floor)
        swing = np.log(np.hypot(np.exp(swing), self.floor[SWINGING, :]))  # the other has no noise of its own
        slow, swing = (slow - self.slow) / self.sigma, (swing - self.swing) / self.sigma_swing
        return np.concatenate([slow.ravel(), swing.ravel()])

    @property
    def size(self) -> int:
        """Length of what `differs` returns."""
        return int(self.slow.size + self.swing.size)


def outline_of(time_s: Floats, tip: Floats, at_rest: Floats) -> Outline:
    """Outline of a recorded tip (3, n) at times (n,) with noise ``at_rest`` (3, n)."""
    grid = np.arange(time_s[0], time_s[-1], float(np.median(np.diff(time_s))))
    floor = np.median(at_rest, axis=1, keepdims=True)
    even = np.stack([np.interp(grid, time_s, row) for row in tip])
    slow, swing = _parts(grid, even, floor)
    rate = np.gradient(slow, KEPT_S, axis=1)
    noise = floor[SWINGING, :] / np.exp(swing)  # what is no louder than noise says nothing of a swing
    return Outline(grid, floor, slow, swing, np.hypot(floor, rate * LATE_S), np.hypot(SWING, noise))


def _parts(grid: Floats, tip: Floats, floor: Floats) -> tuple[Floats, Floats]:
    """Slow part and logarithm of the swing, each KEPT_S."""
    step_s = float(grid[1] - grid[0])
    slow = gaussian_filter1d(tip, AVERAGED_S / step_s, axis=1)
    fast = (tip - slow)[SWINGING, :]
    swing = np.sqrt(gaussian_filter1d(fast**2, AVERAGED_S / step_s, axis=1))
    every = max(1, round(KEPT_S / step_s))
    return slow[:, ::every], np.log(np.maximum(swing, 0.5 * floor[SWINGING, :]))[:, ::every]
