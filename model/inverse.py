"""Inverse of a small matrix, in compiled code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import fused

Floats = NDArray[np.float64]


@fused
def invert(S: Floats, k: int, out: Floats) -> None:
    """Inverse of the k x k matrix S, which is overwritten, by Gauss and Jordan with pivots."""
    if k == 2:
        over = 1 / (S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0])
        out[0, 0], out[0, 1] = S[1, 1] * over, -S[0, 1] * over
        out[1, 0], out[1, 1] = -S[1, 0] * over, S[0, 0] * over
        return
    for i in range(k):
        for j in range(k):
            out[i, j] = 1.0 if i == j else 0.0
    for i in range(k):
        pivot = i
        for j in range(i + 1, k):
            if abs(S[j, i]) > abs(S[pivot, i]):
                pivot = j
        if pivot != i:
            for j in range(k):
                S[i, j], S[pivot, j] = S[pivot, j], S[i, j]
                out[i, j], out[pivot, j] = out[pivot, j], out[i, j]
        over = 1 / S[i, i]
        for j in range(k):
            S[i, j] *= over
            out[i, j] *= over
        for row in range(k):
            if row != i:
                factor = S[row, i]
                for j in range(k):
                    S[row, j] -= factor * S[i, j]
                    out[row, j] -= factor * out[i, j]
