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
# Of 24 clips painted at 60 Mbit/s, H.264, as tests.benchmarks.tracking_sigmas draws them:
_USUAL_LAG_PX = 0.012
_USUAL_WEIGHT = 4.0  # in keyframes: what the usual value counts
_SCATTER_PX = 0.010  # of the lag about its mean
_SLOW_PX, _FAST_PX = 0.015, 0.6  # a frame: the lag grows with the motion, until so much changes that all is coded anew
_CALM_PX, _BUSY_PX, _HALF_BUSY_PX = 0.0030, 0.020, 0.2  # what varies over the board: at rest, moving; half way there


@dataclass(frozen=True)
class Frames:
    """What is kept of each frame to judge the whole: the board's middle (f, 2) in px, the rest as in ``Views``."""

    middle_px: Floats
    widths: Floats
    sweep: Floats
    key: Flags
    jump_px: Floats
    speed_px: Floats


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


def lag_share(speed_px: Floats) -> Floats:
    """Return which share (f,) of the codec's lag there is in a frame whose corners move by so much (rms, px)."""
    return speed_px / (speed_px + _SLOW_PX) * np.clip(1 - (speed_px / _FAST_PX) ** 2, 0, None)


def codec_lag_px(frames: Frames) -> tuple[float, float]:
    """Return by how much corners lag behind their motion because of the codec, px rms per coordinate, and its sigma.

    A predicted picture lags: what the quantiser drops of the change since the last one is missing, the same way for
    all corners that move the same way, so no residual of a single frame shows it. A keyframe is free of it; there the
    corners jump ahead; few jumps are weighed with the usual lag. Without any nothing is corrected, but the usual lag is
    in sigma.
    """
    share = np.where(np.isfinite(frames.jump_px), lag_share(frames.speed_px), 0.0)
    seen = share > 0.3
    keys, others = seen & frames.key, seen & ~frames.key
    count, lag_px = int(np.count_nonzero(keys)), 0.0
    if count and others.any():  # medians: where the motion itself is no quintic, jumps are a hundred times larger
        ahead_px = float(np.median((frames.jump_px[keys] - np.median(frames.jump_px[others])) / share[keys]))
        lag_px = (max(ahead_px, 0.0) * count + _USUAL_LAG_PX * _USUAL_WEIGHT) / (count + _USUAL_WEIGHT)
    # the usual lag is taken to be as uncertain as it is large
    unknown_px = _USUAL_LAG_PX * _USUAL_WEIGHT / (count + _USUAL_WEIGHT)
    return lag_px, float(np.hypot(unknown_px, _SCATTER_PX))


def without_lag(poses: Poses, rate: Floats, key: Flags, lag: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return poses (f, 3) with the codec's lag put right, and their covariance (f, 3, 3) with what is left of it.

    ``rate`` (f, 3): how the poses change from frame to frame; ``key`` (f,): coded without prediction; ``lag``: as
    ``codec_lag_px`` says. Besides, blocks are coded in different ways: an error that varies smoothly over the board.
    """
    good = np.isfinite(poses.rms_px)
    count = 2.0 * poses.used.sum(axis=1)
    variance = poses.rms_px**2 * count / (count - 3)
    normal = np.linalg.inv(np.where(good[:, None, None], poses.covariance, np.eye(3))) * variance[:, None, None]
    speed_px = np.sqrt(np.einsum("fi,fij,fj->f", rate, normal, rate) / count)
    along = rate / np.maximum(speed_px, 1e-9)[:, None]
    ahead_px = lag[0] * lag_share(speed_px) * ~key
    late_px = lag[1] * speed_px / (speed_px + _SLOW_PX)
    smooth_px = _CALM_PX + (_BUSY_PX - _CALM_PX) * speed_px / (speed_px + _HALF_BUSY_PX)
    late = np.einsum("fi,fj->fij", along, along) * late_px[:, None, None] ** 2
    spread = poses.covariance + late + poses.shared * smooth_px[:, None, None] ** 2
    return poses.vector + along * ahead_px[:, None], np.asarray(spread)
