"""What the video says about its own making: how long the shutter was open, and how much the codec's prediction lags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.pose import Poses

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_SMEARED_PX = 1.5  # a frame: edges that move so fast are widened for certain
_FEWEST_SMEARED = 4
_MOST_EXPOSURE = 1.0  # of the frame's period
_USUAL_LAG_PX = 0.019  # of painted clips at 60 Mbit/s, H.264
_USUAL_WEIGHT = 8.0  # in keyframes: what the usual value counts
_STILL_LAG_PX = 0.004  # what is left of it when nothing moves
_MOVED_PX = 0.05  # over _WINDOW frames: the board moves
_WINDOW = 12
_INCOHERENT = 0.3  # of the lag's variance: as painted clips of both views have it
_SPEEDS_PX = (
    0.02,
    2.0,
)  # a frame, between which the jump at a keyframe is the codec's: slower there is none, faster the
# motion itself is no quintic over seven frames


@dataclass(frozen=True)
class Frames:
    """What is kept of each frame to judge the whole: the board's middle (f, 2) in px, the rest as in ``Views``."""

    middle_px: Floats
    widths: Floats
    sweep: Floats
    key: Flags
    jump_px: Floats


def exposure_by_smear(frames: Frames, period_s: float) -> float:
    """Return the exposure, s, by how much wider moving edges are: w^2 / 5 = w0^2 / 5 + (v T)^2 / 12; 0 if none moves.

    w is the half width of a smooth step, whose slope has the variance w^2 / 5; a smear of length v T has (v T)^2 / 12.
    """
    widths, sweep = frames.widths.ravel(), frames.sweep.ravel()
    still = sweep * period_s < _SMEARED_PX / 20
    moving = sweep * period_s > _SMEARED_PX
    if min(np.count_nonzero(moving), np.count_nonzero(still)) < _FEWEST_SMEARED:
        return 0.0
    square, grown = sweep[moving] ** 2, 2.4 * (widths[moving] ** 2 - np.median(widths[still]) ** 2)
    exposure_s = np.sqrt(max(float((square * grown).sum() / (square**2).sum()), 0.0))
    return float(min(exposure_s, _MOST_EXPOSURE * period_s))


def codec_lag_px(frames: Frames, period_s: float) -> float:
    """Return the codec's error that corners share, px rms per coordinate, by the jumps at its keyframes.

    A predicted picture lags: what the quantiser drops of the change since the last one is missing, the same way for
    all corners that move the same way, so no residual of a single frame shows it. A keyframe is free of it; there the
    corners jump, by more than they do elsewhere.
    """
    speed = np.abs(frames.sweep).max(axis=1) * period_s
    fit = np.isfinite(frames.jump_px) & (speed > _SPEEDS_PX[0]) & (speed < _SPEEDS_PX[1])
    keys, others = frames.jump_px[fit & frames.key], frames.jump_px[fit & ~frames.key]
    square = _USUAL_WEIGHT * _USUAL_LAG_PX**2
    if len(keys) == 0 or len(others) < 4:
        return _USUAL_LAG_PX
    excess = max(float(np.median(keys**2) - np.median(others**2)), 0.0)
    return float(np.sqrt((square + len(keys) * excess) / (_USUAL_WEIGHT + len(keys))))


def shared_px(frames: Frames, lag_px: float) -> Floats:
    """Return the error (f,) that corners share in each frame: the lag where the board moves or has just moved."""
    moved = np.zeros(len(frames.middle_px), np.bool_)
    step = np.abs(frames.middle_px[_WINDOW:] - frames.middle_px[:-_WINDOW]).max(axis=1) > _MOVED_PX
    moved[_WINDOW:] |= step
    after = np.convolve(moved, np.ones(2 * _WINDOW))[: len(moved)] > 0  # it lags on until it is coded anew
    return np.where(after, lag_px, _STILL_LAG_PX)


def with_shared(poses: Poses, lag_px: Floats) -> Floats:
    """Return the covariance (f, 3, 3) of poses with the errors that all corners of a frame share: ``lag_px`` (f,).

    The lag is along the motion, as if the picture were a little late; ``_INCOHERENT`` of its variance is taken to vary
    smoothly over the board, as blocks are coded in different ways.
    """
    good = np.isfinite(poses.rms_px)
    count = 2.0 * poses.used.sum(axis=1)
    motion = np.zeros_like(poses.vector)
    where = np.flatnonzero(good)
    if len(where) > 1:
        reach = min(_WINDOW // 2, len(where) - 1)
        before, after = (
            np.maximum(np.arange(len(where)) - reach, 0),
            np.minimum(np.arange(len(where)) + reach, len(where) - 1),
        )
        motion[where] = poses.vector[where[after]] - poses.vector[where[before]]
    variance = poses.rms_px**2 * count / (count - 3)
    normal = np.linalg.inv(np.where(good[:, None, None], poses.covariance, np.eye(3))) * variance[:, None, None]
    moved_px = np.sqrt(np.einsum("fi,fij,fj->f", motion, normal, motion) / count)
    late = np.where(moved_px[:, None] > _MOVED_PX / 2, motion, 0.0) / np.maximum(moved_px, 1e-9)[:, None]
    shared = np.einsum("fi,fj->fij", late, late) + _INCOHERENT * poses.shared
    return np.asarray(poses.covariance + lag_px[:, None, None] ** 2 * shared)
