"""How far edges that run askew to the raster are off in coded pictures: each is predicted from its own course."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.tracking.noise import Frames, settled

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# A block is predicted from the row above it or the column on its left. An edge that runs askew is continued straight
# there, and what it is off is coded only where the quantiser does not drop it: the edge is where it was a few rows
# before. So the error has the sign of the slope, up to a bound, and steep slopes are coded. Of 60 painted clips,
# H.264; tests/benchmarks/README.md has the figures:
_SLIGHT, _STEEP = 0.01, 0.07  # px aside from row to row: from here on the error is bounded; here it is halved
#: Error in keyframes, in lags of the codec, at a slope whose share is 1: between none (x264's "ultrafast", HEVC) and
#: this (H.264 at 30 Mbit/s).
MOST = 0.8
_COPIED, _SLOW_PX = 0.8, 0.003  # share in a picture that copies a keyframe, and the speed (px a frame) that halves it
_TELLING_PX = 0.02, 1.0  # speeds at which a keyframe differs from its neighbours, and these are on a smooth course
_FEWEST = 4  # keyframes


def leaning(grid: Floats) -> Floats:
    """Return the error of each corner (f, nx, ny, 2), in u and v, in shares of the most; ``grid`` alike, px.

    Edges nearer to vertical are off in u, those nearer to horizontal in v.
    """
    one, other = np.gradient(grid, axis=1), np.gradient(grid, axis=2)
    steep = (np.abs(one[..., 1]) > np.abs(one[..., 0]))[..., None]
    down, across = np.where(steep, one, other), np.where(steep, other, one)
    length = np.stack((down[..., 1], across[..., 0]), axis=-1)
    slope = np.stack((down[..., 0], across[..., 1]), axis=-1) / np.where(length == 0, 1.0, length)  # 0: no board
    size = np.abs(slope)
    return np.asarray(-slope / ((size + _SLIGHT) * (1 + size / _STEEP)))


def along(jump: Floats, leans: Floats) -> Floats:
    """Return how far (f,), px, corners jump (f, nx, ny, 2) in the way ``leaning`` says."""
    square = (leans**2).sum(axis=(1, 2, 3))
    return np.asarray((jump * leans).sum(axis=(1, 2, 3)) / np.maximum(square, 1e-12))


def present(key: Flags, speed_px: Floats) -> Floats:
    """Return which share (f,) of a keyframe's error a frame has: what moves is predicted from the picture before."""
    return np.where(key, 1.0, _COPIED / (1 + np.nan_to_num(speed_px) / _SLOW_PX))


def askew_of(frames: Frames, lag_px: float) -> tuple[float, float]:
    """Return the error in keyframes, px at a share of 1, and its standard deviation.

    An encoder has some of it, from none to ``MOST``, of which half is taken off: no distribution between has a larger
    variance than a quarter. Keyframes of the clip itself are weighted with that: they jump by it out of the course of
    frames in motion.
    """
    usual = sigma = MOST / 2 * lag_px
    slow, fast = _TELLING_PX
    tell = frames.key & np.isfinite(frames.askew_px) & (frames.speed_px > slow) & (frames.speed_px < fast)
    if not lag_px or np.count_nonzero(tell) < _FEWEST:
        return usual, sigma
    beside = present(np.zeros_like(frames.key), frames.speed_px)
    jump = (frames.askew_px / (1 - beside))[tell]
    size, doubt = settled(jump, usual, sigma, lag_px)  # one jump scatters by about a lag
    return max(size, 0.0), doubt
