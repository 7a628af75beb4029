"""Small dense linear algebra for the compiled model: LU with partial pivoting, faster than a LAPACK call here."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.compiled import allocates_nothing

Floats = NDArray[np.float64]


@allocates_nothing
def factor(W: Floats, order: NDArray[np.int64]) -> None:
    """LU factors of W in place, with partial pivoting; the order of the rows goes into ``order``.

    L has ones on its diagonal; U's is kept inverted. Runs down columns: fastest in Fortran order.
    """
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
        W[k, k] = 1 / W[k, k]
        # an unsigned index cannot count from the end, which lets the compiler use vectors
        below = range(np.uint64(k + 1), np.uint64(n))
        for i in below:
            W[i, k] *= W[k, k]
        for j in below:
            for i in below:
                W[i, j] -= W[k, j] * W[i, k]


@allocates_nothing
def substitute(LU: Floats, order: NDArray[np.int64], b: Floats, x: Floats) -> None:
    """Solution x of W x = b from the factors of W; x is another array than b."""
    n = len(b)
    for i in range(n):
        x[i] = b[order[i]]
    for k in range(n):
        known = x[k]
        for i in range(np.uint64(k + 1), np.uint64(n)):
            x[i] -= LU[i, k] * known
    for k in range(n - 1, -1, -1):
        known = x[k] * LU[k, k]
        x[k] = known
        for i in range(np.uint64(k)):
            x[i] -= LU[i, k] * known
