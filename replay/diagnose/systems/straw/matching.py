"""Matches a prediction's snaps with a recording's, where one shows some that the other does not.

Phi of a ringing snap may just reach the threshold in the recording and not in the prediction; if snaps were matched by
their number, all later ones would be mismatched. Matching the nearest, as `straw.replay.metrics` does to report whole
snaps, fails too: where a model is late, its first snap may be nearest to the second one recorded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Cost of an unmatched crossing, as the lateness of a match, s.
LEFT_OUT_S = 0.3
#: A crossing this much later or earlier than the others may be a ring taken for an end, s.
ODD_S = 0.03


def matched(seen_s: Floats, told_s: Floats) -> tuple[Indices, Indices]:
    """Matching crossings of a recording (n,) and a prediction (k,), as indices of both.

    Both alternate between begin and end, and begins match begins. Equal numbers match one by one, however late; else
    with least lateness in all, in order (dynamic programming, as sequences are aligned by Needleman and Wunsch).
    """
    n, k = len(seen_s), len(told_s)
    if n == k:
        return np.arange(n), np.arange(n)
    least = np.zeros((n + 1, k + 1))
    least[:, 0], least[0, :] = LEFT_OUT_S * np.arange(n + 1), LEFT_OUT_S * np.arange(k + 1)
    for i in range(1, n + 1):
        for j in range(1, k + 1):
            least[i, j] = min(least[i - 1, j], least[i, j - 1]) + LEFT_OUT_S
            if (i - j) % 2 == 0:
                least[i, j] = min(least[i, j], least[i - 1, j - 1] + abs(seen_s[i - 1] - told_s[j - 1]))
    pairs = []
    i, j = n, k
    while i and j:
        if (i - j) % 2 == 0 and least[i, j] == least[i - 1, j - 1] + abs(seen_s[i - 1] - told_s[j - 1]):
            i, j = i - 1, j - 1
            pairs.append((i, j))
        elif least[i, j] == least[i - 1, j] + LEFT_OUT_S:
            i -= 1
        else:
            j -= 1
    both = np.array(pairs[::-1], dtype=np.intp).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def without_odd(late_s: Floats) -> NDArray[np.bool_]:
    """Which matched crossings (k,) are about as late as the others, or as the first of two."""
    usual = float(np.median(late_s)) if len(late_s) > 2 else late_s[:1]
    return np.asarray(np.abs(late_s - usual) <= ODD_S)
