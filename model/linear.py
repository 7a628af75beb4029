"""Small dense linear algebra for the compiled model: LU with partial pivoting, faster than a LAPACK call here."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def factor(W: Floats, order: NDArray[np.int64]) -> None:
    """LU factors of W in place, with partial pivoting; the order of the rows goes into ``order``."""
    n = len(W)
    for k in range(n):
        order[k] = k
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(W[i, k]) > abs(W[pivot, k]):
                pivot = i
        if pivot != k:
            order[k], order[pivot] = order[pivot], order[k]
            for j in range(n):
                W[k, j], W[pivot, j] = W[pivot, j], W[k, j]
        for i in range(k + 1, n):
            f = W[i, k] / W[k, k]
            W[i, k] = f
            if f != 0.0:
                for j in range(k + 1, n):
                    W[i, j] -= f * W[k, j]


@compiled
def substitute(LU: Floats, order: NDArray[np.int64], b: Floats, x: Floats) -> None:
    """Solution x of W x = b from the factors of W; x is another array than b."""
    n = len(b)
    for i in range(n):
        total = b[order[i]]
        for j in range(i):
            total -= LU[i, j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, n):
            total -= LU[i, j] * x[j]
        x[i] = total / LU[i, i]
