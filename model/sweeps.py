"""Takes many right sides from the tip to the base and their answers back, cell by cell; columns lie side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, called, compiled
from straw.model.constants import Constants
from straw.model.links import Links

Floats = NDArray[np.float64]


class Sweeps(NamedTuple):
    """What takes right sides from the tip to the base and answers back; rows of ``block`` in the order of `rows`."""

    back: Floats  # (cells, moving + 3, 6 + moving + 2 slots)
    ahead: Floats  # (cells, moving + dims, 2 slots + moving + dims)
    block: Floats  # (cells, rows, columns)


class Rows(NamedTuple):
    """Where each cell's block has what: wrench and force given, wrench from beyond, known displacement and rate, the
    force left on what moves, and what the base joint does."""

    force: int
    beyond: int
    q: int
    v: int
    left: int
    joint: int
    end: int


@allocates_nothing
def rows_of(c: Constants, s: Links) -> Rows:
    """The rows of a block."""
    k, r, dims = 2 * c.active, len(s.slots), s.next.shape[1]
    return Rows(3, 3 + k, 6 + k, 6 + k + r, 6 + k + 2 * r, 6 + 2 * k + 2 * r, 6 + 2 * k + 2 * r + dims)


@compiled
def sweeps_for(c: Constants, s: Links, columns: int) -> Sweeps:
    """Room for as many right sides."""
    k, r, dims = 2 * c.active, len(s.slots), s.next.shape[1]
    rows = rows_of(c, s)
    return Sweeps(
        np.zeros((c.cells, k + 3, 6 + k + 2 * r)),
        np.zeros((c.cells, k + dims, 2 * r + k + dims)),
        np.zeros((c.cells, rows.end, columns)),
    )


@called
def product(matrix: Floats, block: Floats, out: Floats) -> None:
    """out = matrix @ block, row by row, several at a time: the inner loops run over columns and vectorise."""
    many, columns = matrix.shape[1], np.uint64(block.shape[1])
    for row in range(matrix.shape[0]):
        k, target = matrix[row], out[row]
        k0, k1, k2, k3 = k[0], k[1], k[2], k[3]
        b0, b1, b2, b3 = block[0], block[1], block[2], block[3]
        for p in range(columns):
            target[p] = (k0 * b0[p] + k1 * b1[p]) + (k2 * b2[p] + k3 * b3[p])
        x = 4
        while x + 4 <= many:
            k0, k1, k2, k3 = k[x], k[x + 1], k[x + 2], k[x + 3]
            b0, b1, b2, b3 = block[x], block[x + 1], block[x + 2], block[x + 3]
            for p in range(columns):
                target[p] += (k0 * b0[p] + k1 * b1[p]) + (k2 * b2[p] + k3 * b3[p])
            x += 4
        while x < many:
            k0, b0 = k[x], block[x]
            for p in range(columns):
                target[p] += k0 * b0[p]
            x += 1


@called
def solve(c: Constants, s: Links, e: Sweeps, accelerations: Floats) -> None:
    """Take the block's right sides from the tip to the base and back: accelerations (cells, moving, columns).

    Given: force, known displacement and rate of all cells, the wrench on the tip (the last cell's ``beyond``) and what
    the first joint does.
    """
    k, rows = 2 * c.active, rows_of(c, s)
    for i in range(c.cells - 1, -1, -1):
        b = e.block[i]
        product(e.back[i, :k], b[: rows.left], b[rows.left : rows.joint])
        if i > 0:
            product(e.back[i, k:], b[: rows.left], e.block[i - 1, rows.beyond : rows.q])
    for i in range(c.cells):
        b = e.block[i, rows.q :]
        product(e.ahead[i, :k], b, accelerations[i])
        if i + 1 < c.cells:
            product(e.ahead[i, k:], b, e.block[i + 1, rows.joint :])
