"""What the video shows of how it was made: the exposure time, and the lag of the codec's prediction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.tracking.pose import Poses

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOTION_VECTOR_PX = 0.25  # unit of motion vectors in H.264 and HEVC (8.4.2.2 and 8.5.3.3 there)
FOLLOWED_PX = 0.5  # a frame: from here on a motion vector of whole pixels, all that fast presets search, is not zero
_SMEARED_PX = 1.5  # a frame: edges that move this fast are certainly widened
_FEWEST_SMEARED = 4
_MOST_EXPOSURE = 1.0  # of the frame's period
# Of 60 clips of two painters, H.264 at 30 and 60 Mbit/s; a clip's few keyframes scatter by as much as that:
USUAL_LAG_PX, _USUAL_SIGMA_PX = 0.018, 0.006
_MEDIAN, _MAD = 1.2533, 1.4826  # standard deviation of a median over a mean's; a deviation's over the median one
_WEIGHT = 20.0  # of the usual scatter of a keyframe's jump, in keyframes
_SLOW_PX, _FAST_PX = 0.015, 0.3  # a frame: the lag grows with the motion until motion compensation sets in
# The lag of the board's size in the picture, in lags of its position; it saturates by itself, whatever the shift.
_SIZE, _SLOW_SIZE_PX = 0.6, 0.02


@dataclass(frozen=True)
class Frames:
    """What is kept of each frame to judge the whole: the board's middle (f, 2) in px, the rest as in ``Views``."""

    middle_px: Floats
    widths: Floats
    sweep: Floats
    key: Flags
    jump_px: Floats
    speed_px: Floats
    askew_px: Floats
    rms_px: Floats


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


def lag_of(frames: Frames) -> float:
    """Return how far, px per coordinate, predicted pictures are behind their motion, as the frames show it.

    The part of the change that the quantiser drops is missing alike for all corners that move alike, so no residual of
    a single frame shows it. A keyframe is free of it: there the corners jump ahead, by the usual lag give or take as
    much. Without any, nothing is corrected.
    """
    share = np.where(np.isfinite(frames.jump_px), lag_share(frames.speed_px), 0.0)
    seen = share > 0.3
    keys, others = seen & frames.key, seen & ~frames.key
    count = int(np.count_nonzero(keys))
    if not count or not others.any():
        return 0.0
    # medians: where the motion is not well described by a quintic, jumps are a hundred times larger
    jump = (frames.jump_px[keys] - np.median(frames.jump_px[others])) / share[keys]
    return max(settled(jump, USUAL_LAG_PX, _USUAL_SIGMA_PX, USUAL_LAG_PX)[0], 0.0)


def settled(jump: Floats, usual: float, sigma: float, scatter: float) -> tuple[float, float]:
    """Return the mean of a usual value +- ``sigma`` and of what keyframes' jumps tell, by their variances; its sigma.

    ``scatter``: usual deviation of one jump, as a few tell theirs badly.
    """
    count, middle = len(jump), float(np.median(jump))
    own = (_MAD * float(np.median(np.abs(jump - middle)))) ** 2
    doubt = _MEDIAN**2 * (count * own + _WEIGHT * scatter**2) / (count + _WEIGHT) / count
    weight = doubt / (sigma**2 + doubt)
    return weight * usual + (1 - weight) * middle, float(sigma * np.sqrt(weight))


def usual_lag(key: Flags) -> float:
    """Return the lag, px, where no keyframe (f,) tells it; 0 for pictures that are all coded without prediction."""
    return USUAL_LAG_PX * (not key.all())


def without_lag(
    poses: Poses, slopes: Floats, rate: Floats, key: Flags, lag_px: float, eye_m: Floats
) -> tuple[Floats, Floats]:
    """Return poses (f, 3) with the codec's lag put right, and the covariance (f, 3, 3) of what is left of it.

    ``slopes`` (f, n, 2, 3): how the corners move with the poses; ``rate`` (f, 3): how the poses change from frame to
    frame; ``key`` (f,): coded without prediction; ``eye_m`` (2,): the camera's x and z. A shift is predicted from the
    last picture, a change of size is not, so that lags by itself.

    How much of the lag there is in one frame depends on which blocks were worth coding since the last keyframe. No
    distribution between none and all has a larger variance than a quarter, for all corners alike however fast they
    move, along their motion, also when that has ended. A picture that is merely copied tells no direction of motion,
    and at a turn it keeps what the one before lacked: the covariance is the mean of the frame's and its neighbours'.
    """
    J, normal = _normal(poses, slopes)
    speed_px = np.sqrt(np.einsum("fi,fij,fj->f", rate, normal, rate) / (2.0 * poses.used.sum(axis=1)))
    along = rate / np.maximum(speed_px, 1e-9)[:, None]
    size, size_px = _by_size(poses, J, normal, rate, eye_m)
    share = size_px / (np.abs(size_px) + _SLOW_SIZE_PX)
    ahead_px, larger_px = (np.where(key, 0.0, lag_px * part) for part in (lag_share(speed_px), _SIZE * share))
    flow = np.einsum("fncm,fm->fnc", J, rate)
    ahead = flow / np.maximum(np.sqrt((flow**2).sum(axis=-1, keepdims=True) / 2.0), 1e-12)  # rms of 1 per coordinate
    moved = np.linalg.solve(normal, np.einsum("fncm,fnc->fm", J, ahead)[..., None])[..., 0]
    left = moved * np.where(key | (speed_px > FOLLOWED_PX), 0.0, lag_px / 2)[:, None]
    right = poses.vector + along * ahead_px[:, None] + size * larger_px[:, None]
    return np.asarray(right), _beside(left[:, :, None] * left[:, None, :], key)


def _beside(spread: Floats, key: Flags) -> Floats:
    """Return the means of covariances (f, 3, 3) of each frame and those before and after it, none for keyframes."""
    total, count = spread.copy(), np.ones((len(spread), 1, 1))
    for to, by in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
        total[to] += spread[by]
        count[to] += 1.0
    return np.where(key[:, None, None], 0.0, total / count)


def off_chord(poses: Poses, slopes: Floats, chord_px: Floats, slow: Flags) -> tuple[Floats, Floats]:
    """Return the correction of poses (f, 3) of B pictures near a reversal of slow motion, and its covariance (f, 3, 3).

    Where the motion is too slow for motion vectors, a block of a B picture is the mean of the pictures around, unless
    the difference is worth coding. The share of such blocks is unknown: half of the full effect is corrected, and no
    distribution between none and all has a larger variance than a quarter. More than a motion vector's unit is coded.
    """
    J, normal = _normal(poses, slopes)
    square = np.where(poses.used[..., None], chord_px**2, 0.0).sum(axis=(1, 2)) / np.maximum(
        2 * poses.used.sum(axis=1), 1
    )
    hidden = np.minimum(1.0, MOTION_VECTOR_PX / np.sqrt(np.maximum(square, 1e-12)))
    right = np.einsum("fncm,fnc->fm", J, chord_px * (hidden * slow)[:, None, None])
    half = np.linalg.solve(normal, right[..., None])[..., 0] / 2
    return -half, half[:, :, None] * half[:, None, :]


def of_rate(poses: Poses, slopes: Floats, late_s: Floats, sigma_px_s: Floats) -> Floats:
    """Return the covariance (f, 3, 3) that a wrong rate adds where the rolling shutter's rows are brought to one time.

    ``late_s`` (f, n): how long after the board's middle corners were exposed; ``sigma_px_s`` (f,): error of the rate.
    """
    J, normal = _normal(poses, slopes)
    moved = np.linalg.solve(normal, np.einsum("fncm,fn->fmc", J, late_s * sigma_px_s[:, None]))
    return np.asarray(moved @ moved.transpose(0, 2, 1))


def _normal(poses: Poses, slopes: Floats) -> tuple[Floats, Floats]:
    """Return the slopes (f, n, 2, 3) of the corners used, and J^T J (f, 3, 3), solvable also without a fit."""
    J = np.where(poses.used[..., None, None], slopes, 0.0)
    return J, np.einsum("fncm,fncp->fmp", J, J) + 1e-9 * np.eye(3)


def _by_size(poses: Poses, J: Floats, normal: Floats, rate: Floats, eye_m: Floats) -> tuple[Floats, Floats]:
    """Return the change of the pose (f, 3) when corners lie 1 px rms farther from their middle, and their rate (f,)."""
    number = poses.used.sum(axis=1)
    sight = np.zeros_like(poses.vector)
    sight[:, :2] = eye_m - poses.vector[:, :2]
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    shift = J.sum(axis=1) / number[:, None, None]
    shape = normal - number[:, None, None] * np.einsum("fci,fcj->fij", shift, shift)
    grown = np.einsum("fij,fj->fi", shape, sight)
    px_per_m = np.sqrt(np.maximum((grown * sight).sum(axis=1), 1e-30) / (2 * number))
    by_size = np.linalg.solve(normal, grown[..., None])[..., 0] / px_per_m[:, None]
    return by_size, (rate * sight).sum(axis=1) * px_per_m
