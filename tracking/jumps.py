"""How far a clip's poses jump off their smooth course, against what is stated of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from straw.tracking.noise import FOLLOWED_PX, Frames

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.intp]

# Motion vectors have a unit, a quarter of a pixel at the finest, and a fast encoder searches only halves or wholes. By
# how much a vector misses the motion, and how much of that is coded, differs with the encoder's settings. It changes
# from frame to frame with the motion, so frames tell it by their jumps. Slower frames repeat each other's errors, which
# then look like a course; in faster ones, above FOLLOWED_PX, the course itself is not a quintic.
_SWIFT_PX = 0.1  # a frame
_FASTEST_PX = 1.0  # a frame: errors of faster ones are no larger than stated (figures in tests/benchmarks/README.md)
#: Share of the variance of swift frames that their jumps show, as neighbours share the rest; it is printed by
#: python -m tests.benchmarks.tracking_jumps
SHOWN = 0.55
_FEWEST = 20  # frames: the median of as many squares, chi square of 3 degrees of freedom, is good to a quarter
_RUN, _RUNS = 16, 16  # frames one after another, and how many such stretches are judged; the median is good to 7 %
_MEDIAN = float(chi2.median(3))


def swift(frames: Frames) -> Places:
    """Return predicted frames whose errors are seen in their jumps, some of them in a long clip."""
    speed_px = frames.speed_px
    tell = ~frames.key & np.isfinite(frames.jump_px) & (speed_px > _SWIFT_PX) & (speed_px < FOLLOWED_PX)
    runs = np.array_split(np.flatnonzero(tell), max(int(np.count_nonzero(tell)) // _RUN, 1))
    chosen = np.unique(np.linspace(0, len(runs) - 1, min(len(runs), _RUNS)).astype(np.intp))
    return np.concatenate([runs[k] for k in chosen])


def gain_of(jumps: Floats, covariance: Floats) -> float:
    """Return by how much the covariance of swift frames is stated too small, from their poses' jumps (f, 3).

    ``covariance`` (f, 3, 3): what is stated of the jumps if errors are independent from frame to frame. Errors that
    frames share are not seen, as in pictures that are copied; so jumps smaller than stated say nothing.
    """
    if len(jumps) < _FEWEST:
        return 1.0
    return max(of_stated(jumps, covariance) / SHOWN, 1.0)


def of_stated(jumps: Floats, covariance: Floats) -> float:
    """Return the squares of jumps (f, 3) over what is stated of them; by a median, as at an impact they are larger."""
    square = np.einsum("fi,fij,fj->f", jumps, np.linalg.inv(covariance), jumps)
    return float(np.median(square)) / _MEDIAN


def gains(gain: float, key: Flags, speed_px: Floats) -> Floats:
    """Return the factor (f,) for each of the frames, in order of time.

    A frame after a swift one copies it: at a turn, and where a snap begins. One of unknown speed, beside a rejected
    one, counts as swift.
    """
    moved = ~(key | (speed_px <= _SWIFT_PX) | (speed_px >= _FASTEST_PX))
    return np.where(~key & (moved | np.concatenate((moved[:1], moved[:-1]))), gain, 1.0)
