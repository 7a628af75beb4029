"""Solves for many right-hand sides, from the tip to the base and back, cell by cell; columns are contiguous."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, compiled, exposed
from straw.model.constants import Constants
from straw.model.links import Links
from straw.model.vectors import WIDTH, product4, product8

Floats = NDArray[np.float64]


class Sweeps(NamedTuple):
    """Arrays of the sweeps from the tip to the base and back; rows of ``block`` in the order of `rows`."""

    back: Floats  # (cells, moving + 3, 6 + 2 moving + slots)
    ahead: Floats  # (cells, moving + dims, 2 moving + slots + dims)
    block: Floats  # (cells, rows, wide) columns and behind them zeros
    flat: Floats  # (cells, rows wide) the same
    spare: Floats  # (dims, wide) scratch for solutions that are not used: beyond the base, beyond the tip


class Rows(NamedTuple):
    """First rows of the parts of each cell's block: wrench and force given, wrench from beyond, known displacement and
    rate of what moves, known displacement of what does not, the force left on what moves, and what the base joint
    does."""

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


@exposed
def wide(columns: int) -> int:
    """Columns with those that make them a multiple of `WIDTH`."""
    return (columns + WIDTH - 1) // WIDTH * WIDTH


@compiled
def sweeps_for(c: Constants, s: Links, columns: int) -> Sweeps:
    """Allocate for so many right-hand sides."""
    k, dims, rows = 2 * c.active, s.next.shape[1], rows_of(c, s)
    block = np.zeros((c.cells, rows.end, wide(columns)))
    return Sweeps(
        np.zeros((c.cells, k + 3, rows.left)),
        np.zeros((c.cells, k + dims, rows.end - rows.q)),
        block,
        block.reshape((c.cells, rows.end * wide(columns))),
        np.zeros((dims, wide(columns))),
    )


@allocates_nothing
def solve(c: Constants, s: Links, e: Sweeps, accelerations: Floats) -> None:
    """Solve for the block's right-hand sides from the tip to the base and back: accelerations (cells, moving, wide).

    Given: force, known displacement and rate of all cells, the wrench on the tip (the last cell's ``beyond``) and what
    the first joint does.
    """
    k, rows, n, column, columns = 2 * c.active, rows_of(c, s), c.cells, 0, e.block.shape[2]
    while column < columns:
        eight = column + 8 <= columns
        for i in range(n - 1, -1, -1):
            b, left = e.block[i, : rows.left], e.block[i, rows.left : rows.joint]
            beyond = e.block[i - 1, rows.beyond : rows.q] if i > 0 else e.spare[:3]
            if eight:
                product8(e.back[i], b, left, beyond, k, column)
            else:
                product4(e.back[i], b, left, beyond, k, column)
        for i in range(n):
            b = e.block[i, rows.q :]
            joint = e.block[i + 1, rows.joint :] if i + 1 < n else e.spare
            if eight:
                product8(e.ahead[i], b, accelerations[i], joint, k, column)
            else:
                product4(e.ahead[i], b, accelerations[i], joint, k, column)
        column += 8 if eight else 4
