"""The frames around a frame: which are the nearest, and what the polynomial through them says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    times = time_s[by]
    weights = np.ones(by.shape)
    for k in range(by.shape[1]):
        for m in range(by.shape[1]):
            if m != k:
                apart = times[:, k] - times[:, m]
                weights[:, k] *= (at_s - times[:, m]) / np.where(apart == 0, 1.0, apart)
    return np.einsum("fk,fkc->fc", weights, course[by]), (weights**2).sum(axis=1)
