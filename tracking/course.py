"""A board's course through the picture in six numbers, and how far a frame lies off what the others predict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.stats import chi2

from straw.tracking.around import nearest, polynomial

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

COURSE = 6  # numbers that describe the board's course: its middle, and how it is stretched, sheared and turned
_MEDIAN = float(chi2.median(COURSE))
_ALIKE = 50  # frames next slower and next faster, by which it is judged what is usual; a sixteenth of a short video
_HOLE = 8.0  # periods: a prediction over more is worthless
LEAST_PX = 1e-3
_INDEPENDENT = 10.0  # effective number of corners: errors of neighbours are correlated
FEWEST = 12  # moving frames that tell the proportion
_CALMEST = 0.5
SMOOTH = 0.2  # share of the jump that neighbours may be off by without it; beside an impact they are off by half of it
AROUND = 10  # frames on either side, of which some may be refused


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


def missed(part: Courses, good: Flags, k: int) -> float:
    """Return the squared distance (px^2) of a frame from the prediction of three on either side; infinite without
    those."""
    before, after = nearest(good, len(good))
    by = np.concatenate((before[k], after[k]))[None]
    if (by < 0).any():
        return np.inf
    guess, _ = polynomial(part.time_s, part.course, part.time_s[k : k + 1], by)
    return float(((part.course[k] - guess[0]) ** 2).sum())


def speed_of(seen: Courses) -> Floats:
    """Return the corners' rms motion (f,) per frame, px, by the frames on either side alone."""
    n = len(seen.time_s)
    if n < 3:
        return np.zeros(n)
    speed = np.empty(n)
    speed[1:-1] = np.linalg.norm(seen.course[2:] - seen.course[:-2], axis=1) / 2
    speed[0], speed[-1] = speed[1], speed[-2]
    return speed


def by_speed(speed: Floats, values: Floats) -> Floats:
    """Return the running median of values among frames of about the same speed."""
    order = np.argsort(speed, kind="stable")
    found = np.empty(len(values))
    size = min(max(len(values) // 16, 2), _ALIKE) * 2 + 1
    found[order] = median_filter(values[order], size, mode="nearest")
    return found


_WAYS = (  # frames before and after that predict, and those of the simpler prediction
    ((3, 3), (2, 2)),
    ((2, 2), (1, 1)),
    ((3, 0), (2, 0)),
    ((0, 3), (0, 2)),
)


def misses(seen: Courses, usual: Floats, good: Flags) -> Floats:
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


def distance(seen: Courses, usual: Floats, good: Flags) -> Floats:
    """Return each frame's chi square (f,) against its best prediction; 0 without any."""
    each = misses(seen, usual, good)
    least = np.where(np.isnan(each), np.inf, each).min(axis=0)
    return np.asarray(np.where(np.isinf(least), 0.0, least))


def usual_variance(seen: Courses, good: Flags) -> Floats:
    """Return the variance (f,), px^2, of one of the six numbers, without the predictions' error about the motion.

    Proportional to the corners' residual in frames of that speed. The factor comes from prediction errors in moving
    frames: errors of neighbouring corners are correlated, and at rest a codec repeats its errors.
    """
    square = np.exp(2 * by_speed(speed_of(seen), np.log(np.maximum(seen.rms_px, LEAST_PX))))
    before, after = nearest(good, len(square))
    by = np.concatenate((before, after), axis=1)
    moving = (by >= 0).all(axis=1) & good & (speed_of(seen) > np.sqrt(square))
    share = 1 / _INDEPENDENT
    if np.count_nonzero(moving) >= FEWEST:
        guess, gain = polynomial(seen.time_s, seen.course, seen.time_s[moving], by[moving])
        miss = ((seen.course[moving] - guess) ** 2).sum(axis=1) / (_MEDIAN * (1 + gain))
        share = max(float(np.quantile(miss / square[moving], _CALMEST)), share)
    return np.asarray(share * square)
