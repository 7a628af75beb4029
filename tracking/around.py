"""The frames around a frame: which are the nearest, and what the polynomial through them says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


def nearest(good: Flags, n: int, reach: int = 3) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return for each frame the last good ones before (n, reach) and the next after it, nearest first; -1: none."""
    index = np.flatnonzero(good)
    at = np.searchsorted(index, np.arange(n))
    padded = np.concatenate((np.full(reach, -1), index, np.full(reach + 1, -1)))
    before = np.stack([padded[at + reach - 1 - k] for k in range(reach)], axis=1)
    itself = np.zeros(n, np.intp)
    itself[index] = 1
    after = np.stack([padded[at + reach + itself + k] for k in range(reach)], axis=1)
    return before, after


def polynomial(time_s: Floats, course: Floats, at_s: Floats, by: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Return the polynomial through the frames ``by`` (f, m) at ``at_s`` (f,), and the sum of its squared weights."""
    found, gain = np.zeros((len(by), course.shape[1])), np.zeros(len(by))
    lagrange(*(np.ascontiguousarray(each) for each in (time_s, course, at_s, by)), found, gain)
    return found, gain


def _lagrange(time_s: Floats, course: Floats, at_s: Floats, by: NDArray[np.intp], found: Floats, gain: Floats) -> None:
    """Add up what ``polynomial`` returns in ``found`` (f, c) and ``gain`` (f,), which are zeros."""
    for f in range(len(by)):
        for k in range(by.shape[1]):
            own_s, weight = time_s[by[f, k]], 1.0
            for m in range(by.shape[1]):
                if m != k:
                    apart = own_s - time_s[by[f, m]]
                    weight *= (at_s[f] - time_s[by[f, m]]) / (apart if apart != 0 else 1.0)
            gain[f] += weight * weight
            for c in range(course.shape[1]):
                found[f, c] += weight * course[by[f, k], c]


# Assigned rather than decorated: numba has no types, and this keeps the function above checked.
lagrange = compiled(_lagrange)
