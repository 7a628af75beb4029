"""Which detections to reject: repeated pictures, pictures built on lost packets, boards that jump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.stats import chi2

from straw.tracking.around import nearest, polynomial

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

REPEATED = "the picture repeats the one before"
JUMPS = "the board jumps out of the motion before and after"
LOST = "the picture is built on a lost packet"
MISFIT = "the corners miss the board by far more than in the video's other frames"

COURSE = 6  # numbers that describe the board's course: its middle, and how it is stretched, sheared and turned
_FALSE_ALARM = 1e-6  # a good frame refused in an hour of 240 frames/s
_FAR = float(chi2.isf(_FALSE_ALARM, COURSE))
_MOVED = float(chi2.isf(1e-3, COURSE))  # certainly not noise
_MEDIAN = float(chi2.median(COURSE))
_LEAST_REPEATED = 1e-4  # share of frames that repeat another, before any is found
_CALM = 0.1  # share of all steps from frame to frame: the smallest show what a codec makes of a repeated picture
_HALT = 6.0  # times slower than before and after, then on the same way: no motion of a body does so
_SURE = 100.0  # odds; before any is found that is a false alarm in a million good frames (Markov's inequality)
_MOST_REPEATS = 6  # of one picture, one after another
_MOST_AT_TURNS = 3  # likewise, beside a reversal: a longer halt may be a rest, in which a codec drops small vibrations
_ALIKE = 50  # frames next slower and next faster, by which it is judged what is usual; a sixteenth of a short video
_MAD = 1.4826  # times the median absolute deviation is a standard deviation
_SMOOTH = 0.2  # share of the jump that neighbours may be off by without it; beside an impact they are off by half of it
_AROUND = 10  # frames on either side, of which some may be refused
_HOLE = 8.0  # periods: a prediction over more is worthless
_LEAST_PX = 1e-3
_INDEPENDENT = 10.0  # effective number of corners: errors of neighbours are correlated
_FEWEST = 12  # moving frames that tell the proportion
_CALMEST = 0.5


@dataclass(frozen=True)
class Courses:
    """What is known of f sightings, in order of time.

    ``course`` (f, 6): px, see ``course_of``; ``rms_px`` (f,) what the best board leaves; ``lost`` (f,): a packet was
    lost since the last picture that stands by itself.
    """

    time_s: Floats
    course: Floats
    rms_px: Floats
    lost: Flags


def course_of(grid: Floats) -> Floats:
    """Return the six numbers (f, 6), px, of the affine motion of boards whose corners are at ``grid`` (f, nx, ny, 2).

    Scaled so that the sum of their squared changes is the corners' mean squared motion.
    """
    nx, ny = grid.shape[1:3]
    i, j = np.meshgrid(np.linspace(-1, 1, nx), np.linspace(-1, 1, ny), indexing="ij")
    base = np.stack((np.ones(nx * ny), i.ravel() / i.std(), j.ravel() / j.std()))
    return np.asarray(np.einsum("kn,fnc->fkc", base / (nx * ny), grid.reshape(-1, nx * ny, 2)).reshape(-1, COURSE))


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
    usual = _usual_variance(seen, reasons == "")
    for k, count in _repeats(seen, usual, reasons == ""):
        reasons[k : k + count] = REPEATED
    reasons[_misfits(seen) & (reasons == "")] = MISFIT
    _refuse_jumps(seen, usual, reasons)
    reasons[seen.lost] = LOST  # until the next keyframe; a damaged picture may look sound and drift away slowly
    return reasons


def _refuse_jumps(seen: Courses, usual: Floats, reasons: NDArray[np.object_]) -> None:
    """Mark frames that lie off a motion that is smooth without them, the farthest first."""
    far = np.nan_to_num(_misses(seen, usual, reasons == "")[0])
    for k in np.argsort(-far):
        if far[k] <= _FAR:
            return
        if reasons[k]:
            continue
        near = slice(max(k - _AROUND, 0), k + _AROUND + 1)
        part = Courses(seen.time_s[near], seen.course[near], seen.rms_px[near], seen.lost[near])
        good, at = reasons[near] == "", k - near.start
        if np.nan_to_num(_misses(part, usual[near], good)[0, at]) <= _FAR:
            continue  # its neighbour was the outlier
        own = _missed(part, good, at)
        good[at] = False
        beside = [m for m in (at - 1, at + 1) if 0 <= m < len(good) and good[m]]
        if beside and max(_missed(part, good, m) for m in beside) < _SMOOTH**2 * own:
            reasons[k] = JUMPS


def _missed(part: Courses, good: Flags, k: int) -> float:
    """Return the squared distance (px^2) of a frame from the prediction of three on either side; infinite without
    those."""
    before, after = nearest(good, len(good))
    by = np.concatenate((before[k], after[k]))[None]
    if (by < 0).any():
        return np.inf
    guess, _ = polynomial(part.time_s, part.course, part.time_s[k : k + 1], by)
    return float(((part.course[k] - guess[0]) ** 2).sum())


def _speed(seen: Courses) -> Floats:
    """Return the corners' rms motion (f,) per frame, px, by the frames on either side alone."""
    n = len(seen.time_s)
    if n < 3:
        return np.zeros(n)
    speed = np.empty(n)
    speed[1:-1] = np.linalg.norm(seen.course[2:] - seen.course[:-2], axis=1) / 2
    speed[0], speed[-1] = speed[1], speed[-2]
    return speed


def _by_speed(speed: Floats, values: Floats) -> Floats:
    """Return the running median of values among frames of about the same speed."""
    order = np.argsort(speed, kind="stable")
    found = np.empty(len(values))
    size = min(max(len(values) // 16, 2), _ALIKE) * 2 + 1
    found[order] = median_filter(values[order], size, mode="nearest")
    return found


def _misfits(seen: Courses) -> Flags:
    """Return which residuals are far above those of frames of similar speed; in logarithms, as a residual is a
    scale."""
    size = np.log(np.maximum(seen.rms_px, 1e-6))
    speed = _speed(seen)
    usual = np.maximum(_by_speed(speed, size), np.median(size))  # at rest a codec may repeat its best picture
    spread = _MAD * np.maximum(_by_speed(speed, np.abs(size - usual)), 0.1)  # chi over 80 degrees of freedom: 0.08
    return np.asarray(size - usual > np.sqrt(_FAR) * spread)


_WAYS = (  # frames before and after that predict, and those of the simpler prediction
    ((3, 3), (2, 2)),
    ((2, 2), (1, 1)),
    ((3, 0), (2, 0)),
    ((0, 3), (0, 2)),
)


def _misses(seen: Courses, usual: Floats, good: Flags) -> Floats:
    """Return the squared distance (ways, f) of each frame from its predictions; NaN where there are none."""
    n = len(seen.time_s)
    before, after = nearest(good, n)
    period_s = float(np.median(np.diff(seen.time_s))) if n > 1 else 1.0
    found = np.full((len(_WAYS), n), np.nan)
    for way, ((some, more), (few, less)) in enumerate(_WAYS):
        by = np.concatenate((before[:, :some], after[:, :more]), axis=1)
        times = seen.time_s[by]
        known = (by >= 0).all(axis=1) & (np.ptp(np.column_stack((times, seen.time_s)), axis=1) < _HOLE * period_s)
        if not known.any():
            continue
        simpler = np.concatenate((before[:, :few], after[:, :less]), axis=1)[known]
        at_s = seen.time_s[known]
        guess, gain = polynomial(seen.time_s, seen.course, at_s, by[known])
        other, _ = polynomial(seen.time_s, seen.course, at_s, simpler)
        doubt = np.full((n, COURSE), np.nan)
        doubt[known] = (guess - other) ** 2
        if more and some:  # where the difference happens to vanish, that of the neighbouring frames does not
            beside = np.concatenate((doubt[:1], doubt[:-1])), doubt, np.concatenate((doubt[1:], doubt[-1:]))
            doubt = np.nanmax(np.nan_to_num(np.stack(beside)), axis=0)
        variance = usual[known, None] * (1 + gain[:, None]) + doubt[known]
        found[way, known] = ((seen.course[known] - guess) ** 2 / variance).sum(axis=1)
    return found


def _distance(seen: Courses, usual: Floats, good: Flags) -> Floats:
    """Return each frame's chi square (f,) against its best prediction; 0 without any."""
    misses = _misses(seen, usual, good)
    least = np.where(np.isnan(misses), np.inf, misses).min(axis=0)
    return np.asarray(np.where(np.isinf(least), 0.0, least))


def _usual_variance(seen: Courses, good: Flags) -> Floats:
    """Return the variance (f,), px^2, of one of the six numbers, without the predictions' error about the motion.

    Proportional to the corners' residual in frames of that speed. The factor comes from prediction errors in moving
    frames: errors of neighbouring corners are correlated, and at rest a codec repeats its errors.
    """
    square = np.exp(2 * _by_speed(_speed(seen), np.log(np.maximum(seen.rms_px, _LEAST_PX))))
    before, after = nearest(good, len(square))
    by = np.concatenate((before, after), axis=1)
    moving = (by >= 0).all(axis=1) & good & (_speed(seen) > np.sqrt(square))
    share = 1 / _INDEPENDENT
    if np.count_nonzero(moving) >= _FEWEST:
        guess, gain = polynomial(seen.time_s, seen.course, seen.time_s[moving], by[moving])
        miss = ((seen.course[moving] - guess) ** 2).sum(axis=1) / (_MEDIAN * (1 + gain))
        share = max(float(np.quantile(miss / square[moving], _CALMEST)), share)
    return np.asarray(share * square)


def _repeats(seen: Courses, usual: Floats, good: Flags) -> list[tuple[int, int]]:
    """Return (first, how many) of frames that repeat the picture before them.

    Two hypotheses: repeated, so that nothing moved beyond what a codec makes of the same picture twice; or not, so that
    the board is where the frames around predict it. The first must be far more probable, with a prior estimated from
    the video, and the board must be off the prediction. Beside a reversal, as at an impact, or a near halt, the motion
    must also be smooth without the frames in question.
    """
    n, share = len(seen.time_s), _LEAST_REPEATED
    found: list[tuple[int, int]] = []
    if n < _FEWEST:
        return found
    steps = (np.diff(seen.course, axis=0) ** 2).sum(axis=1) / COURSE
    calm = np.maximum(np.minimum(np.quantile(steps, _CALM), 2 * usual), _LEAST_PX**2)
    turns = _distance(seen, usual, good)
    for count in range(1, _MOST_REPEATS + 1):
        first = np.arange(3, n - count - 2)
        if not len(first):
            break
        halts = np.stack([seen.course[first + k] - seen.course[first - 1] for k in range(count)])
        still = ((halts**2).sum(axis=2) / calm[first] + COURSE * np.log(calm[first])).max(axis=0)
        before, onward = (seen.course[first + k] - seen.course[first - 1] for k in (-2, count))
        far = 2 * usual[first] * _MOVED
        moving = ((before**2).sum(axis=1) > far) & ((onward**2).sum(axis=1) > far)
        # As at a turn just before or after; but what rests for longer is at rest, and a blow may end that.
        longer = seen.course[first - 3] - seen.course[first - 1], seen.course[first + count + 2] - seen.course[first]
        turning = np.all([(way**2).sum(axis=1) > far for way in longer], axis=0)
        away, moved = _run_distance(seen, usual, first, count)
        backwards = (before * onward).sum(axis=1) > 0  # ``before`` leads back
        size = np.sqrt(np.minimum((before**2).sum(axis=1), (onward**2).sum(axis=1)))
        halted = np.sqrt((halts**2).sum(axis=2)).max(axis=0) * _HALT < size
        whole = np.all([good[first + k] for k in range(-2, count + 1)], axis=0)
        plain = moving & (~backwards | (turns[first] > _MOVED))
        told = plain | ((count <= _MOST_AT_TURNS) & (moving | turning))
        gain = np.where(told & (away > _MOVED) & whole, (moved - still) / 2, -np.inf)
        gain = np.where(moving & whole & halted & ~backwards, np.inf, gain)
        for k in np.argsort(-gain):
            if gain[k] < np.log(_SURE / share):
                break
            apart = all(abs(first[k] - other) > max(count, many) for other, many in found)
            if apart and (plain[k] or _smooth_without(seen, good, int(first[k]), count)):
                found.append((int(first[k]), count))
                share = max(share, len(found) / n)
    return found


def _smooth_without(seen: Courses, good: Flags, first: int, count: int) -> bool:
    """Return whether the motion is smooth but for the frames of a run."""
    near = slice(max(first - _AROUND, 0), first + count + _AROUND)
    part = Courses(seen.time_s[near], seen.course[near], seen.rms_px[near], seen.lost[near])
    start, others = first - near.start, good[near].copy()
    others[start : start + count] = False
    own = max(_missed(part, others, start + k) for k in range(count))
    return max(_missed(part, others, k) for k in (start - 1, start + count)) < _SMOOTH**2 * own


def _run_distance(seen: Courses, usual: Floats, first: NDArray[np.intp], count: int) -> tuple[Floats, Floats]:
    """Return the chi square (f,) of a run of frames from ``first`` on against the prediction of those around it.

    The largest of the run; then the same with the logarithm of the variance's determinant. The difference from a
    simpler prediction adds variance in one direction, along the motion.
    """
    n, square, likely = len(seen.time_s), np.zeros(len(first)), np.full(len(first), -np.inf)
    by = np.stack([first - 3, first - 2, first - 1, first + count, first + count + 1, first + count + 2], axis=1)
    by = np.where(by < n, by, (first - 4)[:, None])
    for k in range(count):
        at_s = seen.time_s[first + k]
        guess, gain = polynomial(seen.time_s, seen.course, at_s, by)
        other, _ = polynomial(seen.time_s, seen.course, at_s, by[:, 1:5])
        miss, doubt, white = seen.course[first + k] - guess, guess - other, usual[first] * (1 + gain)
        along = 1 + (doubt**2).sum(axis=1) / white
        here = ((miss**2).sum(axis=1) - (miss * doubt).sum(axis=1) ** 2 / (white * along)) / white
        square = np.maximum(square, here)
        likely = np.maximum(likely, here + COURSE * np.log(white) + np.log(along))
    return square, likely
