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
# Of 48 clips painted at 60 Mbit/s, as tests.benchmarks.tracking_sigmas draws them, H.264 by two ways of coding:
_USUAL_LAG_PX = 0.012
_USUAL_WEIGHT = 4.0  # in keyframes: what the usual value counts
_SLOW_PX, _FAST_PX = 0.015, 0.3  # a frame: the lag grows with the motion, until what moves is found in the last picture
# The board's size in the picture lags by so many lags, known to so many, and saturates by itself, however it shifts.
_SIZE, _SIZE_LATE, _SLOW_SIZE_PX = 0.6, 0.2, 0.02
_CALM_PX, _MOVING_PX = 0.03, 1.0  # a frame: slower is at rest; between them prediction costs most
_USUAL_LOSS_PX, _LEAST_LOSS_PX, _FEWEST_LOST = 0.005, 0.002, 10
_BUSY_PX, _HALF_BUSY_PX = 0.024, 0.2  # what varies over the board when it moves; half way there


@dataclass(frozen=True)
class Frames:
    """What is kept of each frame to judge the whole: the board's middle (f, 2) in px, the rest as in ``Views``."""

    middle_px: Floats
    widths: Floats
    sweep: Floats
    key: Flags
    jump_px: Floats
    speed_px: Floats
    rms_px: Floats


@dataclass(frozen=True)
class Codec:
    """What the codec did to the corners, px per coordinate.

    ``lag_px``: how far they are behind their motion, ``doubt_px`` how well that is known; ``loss_px``: what prediction
    from the last picture loses, by how much more residuals there are than without it.
    """

    lag_px: float
    doubt_px: float
    loss_px: float


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


def codec_of(frames: Frames) -> Codec:
    """Return what the codec does, as the frames show it.

    A predicted picture lags: what the quantiser drops of the change since the last one is missing, the same way for
    all corners that move the same way, so no residual of a single frame shows it. A keyframe is free of it; there the
    corners jump ahead; few jumps are weighed with the usual lag. Without any nothing is corrected, but the usual lag is
    in its doubt. How much is dropped, how unevenly and how long differs threefold between encoders at the same bitrate,
    and residuals show it: ``loss_px``.
    """
    share = np.where(np.isfinite(frames.jump_px), lag_share(frames.speed_px), 0.0)
    seen = share > 0.3
    keys, others = seen & frames.key, seen & ~frames.key
    count, lag_px = int(np.count_nonzero(keys)), 0.0
    if count and others.any():  # medians: where the motion itself is no quintic, jumps are a hundred times larger
        ahead_px = float(np.median((frames.jump_px[keys] - np.median(frames.jump_px[others])) / share[keys]))
        lag_px = (max(ahead_px, 0.0) * count + _USUAL_LAG_PX * _USUAL_WEIGHT) / (count + _USUAL_WEIGHT)
    # the usual lag is taken to be as uncertain as it is large
    unknown_px, loss_px = _USUAL_LAG_PX * _USUAL_WEIGHT / (count + _USUAL_WEIGHT), _loss_px(frames)
    return Codec(lag_px, float(np.hypot(unknown_px, loss_px)), loss_px)


def _loss_px(frames: Frames) -> float:
    """Return by how much residuals are larger where pictures are predicted from moving ones."""
    own = frames.key | (frames.speed_px < _CALM_PX)
    lost = ~frames.key & (frames.speed_px > _CALM_PX) & (frames.speed_px < _MOVING_PX)
    if min(np.count_nonzero(own), np.count_nonzero(lost)) < _FEWEST_LOST:
        return _USUAL_LOSS_PX
    own_px, lost_px = (float(np.median(frames.rms_px[which])) for which in (own, lost))
    return float(np.sqrt(max(lost_px**2 - own_px**2, _LEAST_LOSS_PX**2)))


def without_lag(poses: Poses, rate: Floats, key: Flags, codec: Codec, eye_m: Floats) -> tuple[Floats, Floats]:
    """Return poses (f, 3) with the codec's lag put right, and their covariance (f, 3, 3) with what is left of it.

    ``rate`` (f, 3): how the poses change from frame to frame; ``key`` (f,): coded without prediction; ``eye_m``
    (2,): the camera's x and z. A shift is predicted from the last picture, a change of size is not, so that lags by
    itself. Besides, blocks are coded in different ways: an error that varies smoothly over the board.
    """
    good = np.isfinite(poses.rms_px)
    count = 2.0 * poses.used.sum(axis=1)
    variance = poses.rms_px**2 * count / (count - 3)
    normal = np.linalg.inv(np.where(good[:, None, None], poses.covariance, np.eye(3))) * variance[:, None, None]
    speed_px = np.sqrt(np.einsum("fi,fij,fj->f", rate, normal, rate) / count)
    along = rate / np.maximum(speed_px, 1e-9)[:, None]
    ahead_px = codec.lag_px * lag_share(speed_px) * ~key
    late_px = codec.doubt_px * speed_px / (speed_px + _SLOW_PX)
    size, size_px = _by_size(poses, normal, rate, eye_m)
    share = size_px / (np.abs(size_px) + _SLOW_SIZE_PX)
    larger_px, size_late_px = _SIZE * codec.lag_px * share * ~key, _SIZE_LATE * codec.doubt_px * share
    smooth_px = codec.loss_px + (_BUSY_PX - codec.loss_px) * speed_px / (speed_px + _HALF_BUSY_PX)
    spread = poses.covariance + poses.shared * smooth_px[:, None, None] ** 2
    for way, px in ((along, late_px), (size, size_late_px)):
        spread = spread + np.einsum("fi,fj->fij", way, way) * px[:, None, None] ** 2
    return poses.vector + along * ahead_px[:, None] + size * larger_px[:, None], np.asarray(spread)


def _by_size(poses: Poses, normal: Floats, rate: Floats, eye_m: Floats) -> tuple[Floats, Floats]:
    """Return what corners that lie 1 px rms farther from their middle do to the pose (f, 3), and their rate (f,)."""
    number = poses.used.sum(axis=1)
    sight = np.zeros_like(poses.vector)
    sight[:, :2] = eye_m - poses.vector[:, :2]
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    shape = normal - number[:, None, None] * np.einsum("fci,fcj->fij", poses.shift, poses.shift)
    grown = np.einsum("fij,fj->fi", shape, sight)
    px_per_m = np.sqrt(np.maximum((grown * sight).sum(axis=1), 1e-30) / (2 * number))
    by_size = np.linalg.solve(normal, grown[..., None])[..., 0] / px_per_m[:, None]
    return by_size, (rate * sight).sum(axis=1) * px_per_m
