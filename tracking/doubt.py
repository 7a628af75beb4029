"""Which detections to reject: repeated pictures, pictures built on lost packets, boards that jump."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from straw.tracking.course import AROUND, COURSE, SMOOTH, Courses, by_speed, missed, misses, speed_of, usual_variance
from straw.tracking.repeats import repeats

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

REPEATED = "the picture repeats the one before"
JUMPS = "the board jumps out of the motion before and after"
LOST = "the picture is built on a lost packet"
MISFIT = "the corners miss the board by far more than in the video's other frames"

_FALSE_ALARM = 1e-6  # a good frame refused in an hour of 240 frames/s
_FAR = float(chi2.isf(_FALSE_ALARM, COURSE))
_MAD = 1.4826  # times the median absolute deviation is a standard deviation


def doubted(seen: Courses) -> NDArray[np.object_]:
    """Return why each sighting is rejected, "" where it is not.

    A sighting is compared with a prediction from the frames around it. The prediction's variance is the usual one at
    that speed in this video plus the squared difference from the next simpler prediction. A sighting is rejected if a
    good frame would be so far off once in a million, and if the motion is smooth without it, which it is not at an
    impact.
    A repeated picture is recognised by its likelihood ratio against a halt.
    """
    reasons = np.full(len(seen.time_s), "", dtype=object)
    if not len(reasons):
        return reasons
    usual = usual_variance(seen, reasons == "")
    for k, count in repeats(seen, usual, reasons == ""):
        reasons[k : k + count] = REPEATED
    reasons[_misfits(seen) & (reasons == "")] = MISFIT
    _refuse_jumps(seen, usual, reasons)
    reasons[seen.lost] = LOST  # until the next keyframe; a damaged picture may look sound and drift away slowly
    return reasons


def _refuse_jumps(seen: Courses, usual: Floats, reasons: NDArray[np.object_]) -> None:
    """Mark frames that lie off a motion that is smooth without them, the farthest first."""
    far = np.nan_to_num(misses(seen, usual, reasons == "")[0])
    for k in np.argsort(-far):
        if far[k] <= _FAR:
            return
        if reasons[k]:
            continue
        near = slice(max(k - AROUND, 0), k + AROUND + 1)
        part = Courses(seen.time_s[near], seen.course[near], seen.rms_px[near], seen.lost[near])
        good, at = reasons[near] == "", k - near.start
        if np.nan_to_num(misses(part, usual[near], good)[0, at]) <= _FAR:
            continue  # its neighbour was the outlier
        own = missed(part, good, at)
        good[at] = False
        beside = [m for m in (at - 1, at + 1) if 0 <= m < len(good) and good[m]]
        if beside and max(missed(part, good, m) for m in beside) < SMOOTH**2 * own:
            reasons[k] = JUMPS


def _misfits(seen: Courses) -> Flags:
    """Return which residuals are far above those of frames of similar speed; in logarithms, as a residual is a
    scale."""
    size = np.log(np.maximum(seen.rms_px, 1e-6))
    speed = speed_of(seen)
    usual = np.maximum(by_speed(speed, size), np.median(size))  # at rest a codec may repeat its best picture
    spread = _MAD * np.maximum(by_speed(speed, np.abs(size - usual)), 0.1)  # chi over 80 degrees of freedom: 0.08
    return np.asarray(size - usual > np.sqrt(_FAR) * spread)
