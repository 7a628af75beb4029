"""Which pictures repeat the one before, told by their likelihood ratio against a halt of the board."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from straw.tracking.around import polynomial
from straw.tracking.course import AROUND, COURSE, FEWEST, LEAST_PX, SMOOTH, Courses, distance, missed
from straw.tracking.noise import USUAL_LAG_PX

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_MOVED = float(chi2.isf(1e-3, COURSE))  # certainly not noise
_LEAST_REPEATED = 1e-4  # share of frames that repeat another, before any is found
_CALM = 0.1  # share of all steps from frame to frame: the smallest show what a codec makes of a repeated picture
_HALT = 6.0  # times slower than before and after, then on the same way: no motion of a body does so
# What halving and doubling the next four does is in tests/benchmarks/README.md.
_LEAP = 1.5  # times a leap is larger than the steps before and after it; after one repeat of steady motion it is 2
# Catching up after still frames; in 30 clips of H.264 and HEVC without repeats at most 2.3 times the usual lag.
_HIDDEN_PX = 3 * np.sqrt(2) * USUAL_LAG_PX
_STILL = 20.0  # times smaller than a leap are steps between repeats
_GATHERS = 1.5  # times larger than the first is the second step of a start from rest; 3 at constant acceleration
_SURE = 100.0  # odds; before any is found that is a false alarm in a million good frames (Markov's inequality)
_MOST_REPEATS = 6  # of one picture, one after another
_MOST_AT_TURNS = 3  # likewise, beside a reversal: a longer halt may be a rest, in which a codec drops small vibrations


def repeats(seen: Courses, usual: Floats, good: Flags) -> list[tuple[int, int]]:
    """Return (first, how many) of frames that repeat the picture before them.

    Two hypotheses: repeated, so that nothing moved beyond what a codec makes of the same picture twice; or not, so that
    the board is where the frames around predict it. The first must be far more probable, with a prior estimated from
    the video, and the board must be off the prediction. Beside a reversal, as at an impact, or a near halt, the motion
    must also be smooth without the frames in question. A halt that no body makes needs no odds (`_halts`).
    """
    n, share = len(seen.time_s), _LEAST_REPEATED
    found: list[tuple[int, int]] = []
    if n < FEWEST:
        return found
    steps = (np.diff(seen.course, axis=0) ** 2).sum(axis=1) / COURSE
    calm = np.maximum(np.minimum(np.quantile(steps, _CALM), 2 * usual), LEAST_PX**2)
    turns = distance(seen, usual, good)
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
        impossible = _halts(seen, first, count)
        plain = (moving & (~backwards | (turns[first] > _MOVED))) | impossible
        told = plain | ((count <= _MOST_AT_TURNS) & (moving | turning))
        gain = np.where(told & (away > _MOVED) & whole, (moved - still) / 2, -np.inf)
        gain = np.where(whole & ((moving & halted & ~backwards) | impossible), np.inf, gain)
        for k in np.argsort(-gain):
            if gain[k] < np.log(_SURE / share):
                break
            apart = all(abs(first[k] - other) > max(count, many) for other, many in found)
            if apart and (plain[k] or _smooth_without(seen, good, int(first[k]), count)):
                found.append((int(first[k]), count))
                share = max(share, len(found) / n)
    return found


def _halts(seen: Courses, first: NDArray[np.intp], count: int) -> Flags:
    """Return which runs (f,) of still frames, from ``first`` on, are no motion of a body.

    Either the board leaps after them, by more than in the frames before and after and than what a codec hides in slow
    motion: no body speeds up and slows down within one frame, but of repeats the last step is all the way since the
    first. Or two or three rest amid a reversal: a turning point lasts for one, and a start from rest gathers speed.
    """
    step = np.sqrt((np.diff(seen.course, axis=0) ** 2).sum(axis=1))
    rest = np.max([step[first - 1 + k] for k in range(count)], axis=0)
    into, before, out, after, later = (step[first + k] for k in (-2, -3, count - 1, count, count + 1))
    leap = (into > out / _STILL) & (out > _LEAP * np.max([into, before, after, later], axis=0)) & (out > _HIDDEN_PX)
    size = np.minimum(into, out)
    turn = (1 < count <= _MOST_AT_TURNS) & (size > _HIDDEN_PX) & (after < _GATHERS * out)
    return np.asarray((rest < np.where(leap, out, size) / _STILL) & (leap | turn))


def _smooth_without(seen: Courses, good: Flags, first: int, count: int) -> bool:
    """Return whether the motion is smooth but for the frames of a run."""
    near = slice(max(first - AROUND, 0), first + count + AROUND)
    part = Courses(seen.time_s[near], seen.course[near], seen.rms_px[near], seen.lost[near])
    start, others = first - near.start, good[near].copy()
    others[start : start + count] = False
    own = max(missed(part, others, start + k) for k in range(count))
    return max(missed(part, others, k) for k in (start - 1, start + count)) < SMOOTH**2 * own


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
