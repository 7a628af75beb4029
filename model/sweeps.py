"""Takes many right sides from the tip to the base and their answers back, cell by cell; columns lie side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.compiled import allocates_nothing, called, compiled
from model.constants import Constants
from model.links import Links
from model.vectors import WIDTH, product4, product8

Floats = NDArray[np.float64]


class Sweeps(NamedTuple):
    """What takes right sides from the tip to the base and answers back; rows of ``block`` in the order of `rows`."""

    back: Floats  # (cells, moving + 3, 6 + 2 moving + slots)
    ahead: Floats  # (cells, moving + dims, 2 moving + slots + dims)
    block: Floats  # (cells, rows, wide) columns and behind them zeros
    flat: Floats  # (cells, rows wide) the same


class Rows(NamedTuple):
    """Where each cell's block has what: wrench and force given, wrench from beyond, known displacement and rate of what
    moves, known displacement of what does not, the force left on what moves, and what the base joint does."""

    force: int
    beyond: int
    q: int
    v: int
    rigid: int
    left: int
    joint: int
    end: int


@allocates_nothing
def rows_of(c: Constants, s: Links) -> Rows:
    """The rows of a block."""
    k, r, dims = 2 * c.active, len(s.slots), s.next.shape[1]
    return Rows(3, 3 + k, 6 + k, 6 + 2 * k, 6 + 3 * k, 6 + 2 * k + r, 6 + 3 * k + r, 6 + 3 * k + r + dims)


@allocates_nothing
def wide(columns: int) -> int:
    """Columns with those that make them a multiple of `WIDTH`."""
    return (columns + WIDTH - 1) // WIDTH * WIDTH


@compiled
def sweeps_for(c: Constants, s: Links, columns: int) -> Sweeps:
    """Room for as many right sides."""
    k, r, dims = 2 * c.active, len(s.slots), s.next.shape[1]
    rows = rows_of(c, s)
    block = np.zeros((c.cells, rows.end, wide(columns)))
    return Sweeps(
        np.zeros((c.cells, k + 3, rows.left)),
        np.zeros((c.cells, k + dims, rows.end - rows.q)),
        block,
        block.reshape((c.cells, rows.end * wide(columns))),
    )


@called
def solve(c: Constants, s: Links, e: Sweeps, accelerations: Floats) -> None:
    """Take the block's right sides from the tip to the base and back: accelerations (cells, moving, wide).

    Given: force, known displacement and rate of all cells, the wrench on the tip (the last cell's ``beyond``) and what
    the first joint does.
    """
    k, rows, column, columns = 2 * c.active, rows_of(c, s), 0, e.block.shape[2]
    while column + 8 <= columns:
        for i in range(c.cells - 1, -1, -1):
            b = e.block[i]
            product8(e.back[i, :k], b[: rows.left], b[rows.left : rows.joint], column)
            if i > 0:
                product8(e.back[i, k:], b[: rows.left], e.block[i - 1, rows.beyond : rows.q], column)
        for i in range(c.cells):
            b = e.block[i, rows.q :]
            product8(e.ahead[i, :k], b, accelerations[i], column)
            if i + 1 < c.cells:
                product8(e.ahead[i, k:], b, e.block[i + 1, rows.joint :], column)
        column += 8
    if column < columns:
        for i in range(c.cells - 1, -1, -1):
            b = e.block[i]
            product4(e.back[i, :k], b[: rows.left], b[rows.left : rows.joint], column)
            if i > 0:
                product4(e.back[i, k:], b[: rows.left], e.block[i - 1, rows.beyond : rows.q], column)
        for i in range(c.cells):
            b = e.block[i, rows.q :]
            product4(e.ahead[i, :k], b, accelerations[i], column)
            if i + 1 < c.cells:
                product4(e.ahead[i, k:], b, e.block[i + 1, rows.joint :], column)
