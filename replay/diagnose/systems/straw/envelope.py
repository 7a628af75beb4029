"""A signal's slow part and the envelope of its ringing, which vary smoothly with a straw's constants.

Sample by sample, a ringing tip agrees only with a straw that rings in phase, so damping and frequency can be found only
from close starts. The amplitude has no phase: its logarithm is nearly linear in damping over a wide range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Floats = NDArray[np.float64]

#: The averages' standard deviation, s: longer than half a period of the tip's slowest swing, some 10 Hz.
AVERAGED_S = 0.035
#: Averages vary slowly: one value is kept every so many of these.
KEPT_S = 0.025
#: Tolerance of motion in time, s, and of an amplitude in its logarithm.
LATE_S, SWING = 5e-3, 0.15
#: Channels whose amplitude is compared: X, which is axial, and Phi, which bends.
SWINGING = (0, 2)


@dataclass(frozen=True, eq=False)
class Envelope:
    """Of tip (3, n): slow (3, k) m, m, rad, and swing (2, k), logarithms; with the sigma of each at ``time_s`` (n,)."""

    time_s: Floats  # even grid of the comparison
    floor: Floats  # (3, 1) noise, which has an amplitude as well
    slow: Floats
    swing: Floats
    sigma: Floats  # (3, k) of slow
    sigma_swing: Floats  # (2, k)

    def differs(self, tip: Floats) -> Floats:
        """Differences of slow part and envelope from another tip (3, n), at ``time_s``: in sigmas, one vector."""
        slow, swing = _parts(self.time_s, tip, self.floor)
        swing = np.log(np.hypot(np.exp(swing), self.floor[SWINGING, :]))  # the other has no noise of its own
        slow, swing = (slow - self.slow) / self.sigma, (swing - self.swing) / self.sigma_swing
        return np.concatenate([slow.ravel(), swing.ravel()])

    def tangent(self, tip: Floats, d_tip: Floats) -> Floats:
        """Derivative of `differs`, (size, columns), along derivatives of the tip, (3, n, columns)."""
        step_s = float(self.time_s[1] - self.time_s[0])
        width, every = AVERAGED_S / step_s, max(1, round(KEPT_S / step_s))
        slow, d_slow = gaussian_filter1d(tip, width, axis=1), gaussian_filter1d(d_tip, width, axis=1)
        fast, d_fast = (tip - slow)[SWINGING, :], (d_tip - d_slow)[SWINGING, :]
        power = gaussian_filter1d(fast**2, width, axis=1)[:, ::every]
        d_power = gaussian_filter1d(2 * fast[:, :, None] * d_fast, width, axis=1)[:, ::every]
        floor2 = self.floor[SWINGING, :] ** 2
        d_power[power < floor2 / 4] = 0.0  # below the noise the envelope is unknown
        total = np.maximum(power, floor2 / 4) + floor2
        d_swing = d_power / (2 * total[:, :, None] * self.sigma_swing[:, :, None])
        columns = d_tip.shape[-1]
        return np.concatenate(
            [
                (d_slow[:, ::every] / self.sigma[:, :, None]).reshape(-1, columns),
                d_swing.reshape(-1, columns),
            ]
        )

    @property
    def size(self) -> int:
        """Length of what `differs` returns."""
        return int(self.slow.size + self.swing.size)


def envelope_of(time_s: Floats, tip: Floats, at_rest: Floats) -> Envelope:
    """Envelope of a recorded tip (3, n) at times (n,) with noise ``at_rest`` (3, n)."""
    grid = np.arange(time_s[0], time_s[-1], float(np.median(np.diff(time_s))))
    floor = np.median(at_rest, axis=1, keepdims=True)
    even = np.stack([np.interp(grid, time_s, row) for row in tip])
    slow, swing = _parts(grid, even, floor)
    rate = np.gradient(slow, KEPT_S, axis=1)
    noise = floor[SWINGING, :] / np.exp(swing)  # an amplitude below the noise is not informative
    return Envelope(grid, floor, slow, swing, np.hypot(floor, rate * LATE_S), np.hypot(SWING, noise))


def _parts(grid: Floats, tip: Floats, floor: Floats) -> tuple[Floats, Floats]:
    """Slow part and logarithm of the swing, each KEPT_S."""
    step_s = float(grid[1] - grid[0])
    slow = gaussian_filter1d(tip, AVERAGED_S / step_s, axis=1)
    fast = (tip - slow)[SWINGING, :]
    swing = np.sqrt(gaussian_filter1d(fast**2, AVERAGED_S / step_s, axis=1))
    every = max(1, round(KEPT_S / step_s))
    return slow[:, ::every], np.log(np.maximum(swing, 0.5 * floor[SWINGING, :]))[:, ::every]
