"""The moment of largest difference between two models, or of one model's largest error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Window shown first: this share of a recording, with as much again before and after it.
CLOSE = 0.06
#: Its smallest number of samples.
FEWEST = 8


def parting(time_s: Floats, one: Floats, other: Floats) -> tuple[float, tuple[float, float]]:
    """When (s) two lines (channels, n) differ most, in shares of each channel's range, and a window (s) around it.

    The window holds the largest sum of differences of any `CLOSE` of the samples; the moment is the largest in it.
    """
    ranges = np.nanmax(other, axis=1, keepdims=True) - np.nanmin(other, axis=1, keepdims=True)
    apart = np.sum(np.abs(np.nan_to_num((one - other) / np.where(ranges > 0, ranges, np.inf))), axis=0)
    width = min(len(time_s), max(FEWEST, round(CLOSE * len(time_s))))
    first = int(np.argmax(np.convolve(apart, np.ones(width), mode="valid")))
    moment = float(time_s[first + int(np.argmax(apart[first : first + width]))])
    low, high = max(0, first - width), min(len(time_s) - 1, first + 2 * width)
    return moment, (float(time_s[low]), float(time_s[high]))
