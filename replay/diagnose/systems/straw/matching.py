"""Which of a prediction's snaps is which of a recording's, where one shows some that the other does not.

Phi of a snap that rings may just reach the level at which it counts, in the recording and not in the prediction; told
by their number, all that follow would then be taken for each other. Nor does the nearest do, by which
`straw.replay.metrics` pairs whole snaps to report them: where a model is late, its first snap may be nearest to the
second one recorded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: To leave out one crossing costs as much as to take one for another that is this late, s.
LEFT_OUT_S = 0.3
#: What is this much later or earlier than the others may be a ring taken for an end, s.
ODD_S = 0.03


def matched(seen_s: Floats, told_s: Floats) -> tuple[Indices, Indices]:
    """Crossings of a recording (n,) and a prediction (k,) that belong to each other, as indices of both.

    Both begin, end, begin, ...: begins go with begins. As many belong to each other one by one, however late; else
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
    """Which of matched crossings (k,) are about as late as the others, or as the first of two."""
    usual = float(np.median(late_s)) if len(late_s) > 2 else late_s[:1]
    return np.asarray(np.abs(late_s - usual) <= ODD_S)
