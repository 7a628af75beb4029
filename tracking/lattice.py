"""Whether a grid of corners is a checkerboard: its squares must alternate, unlike those of printed frames and
bezels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Picture = NDArray[np.uint8]

_LEAST_CORNERS = 4  # a side
_CLEAR = 0.3  # of the contrast between the colours: by how much a square must differ from its neighbours
_LINE, _WHOLE = 0.75, 0.9  # share of squares that must be right in a line at the side, and in all


def chequered(picture: Picture, grid: Floats) -> Floats | None:
    """Return the grid (r, c, 2) of corners in px without lines beside the board; None if it is no board.

    A line printed beside a board makes corners like a T, and a detector may take every second row: in both cases the
    squares between do not alternate.
    """
    while min(grid.shape[:2]) >= _LEAST_CORNERS:
        right = _alternating(picture, grid)
        shares = {
            (0, 0): right[0].mean(),
            (0, -1): right[-1].mean(),
            (1, 0): right[:, 0].mean(),
            (1, -1): right[:, -1].mean(),
        }
        (axis, end), least = min(shares.items(), key=lambda item: float(item[1]))
        if least >= _LINE:
            return grid if right.mean() >= _WHOLE else None
        grid = np.delete(grid, end, axis=axis)
    return None


def _alternating(picture: Picture, grid: Floats) -> Flags:
    """Return which squares (r + 1, c + 1) are darker, or lighter, than those beside them, as their colour is.

    Those around the grid, too, as every corner of the board lies between four; outside the picture they are taken so.
    """
    grid = np.concatenate((2 * grid[:1] - grid[1:2], grid, 2 * grid[-1:] - grid[-2:-1]))
    grid = np.concatenate((2 * grid[:, :1] - grid[:, 1:2], grid, 2 * grid[:, -1:] - grid[:, -2:-1]), axis=1)
    centres = (grid[1:, 1:] + grid[1:, :-1] + grid[:-1, 1:] + grid[:-1, :-1]) / 4
    at_u, at_v = np.round(centres).astype(int).transpose(2, 0, 1)
    height, width = picture.shape
    u, v = np.clip(at_u, 1, width - 2), np.clip(at_v, 1, height - 2)
    level = np.mean([picture[v + dv, u + du].astype(np.float64) for dv in (-1, 0, 1) for du in (-1, 0, 1)], axis=0)
    i, j = np.indices(level.shape)
    colour = np.where((i + j) % 2 == 0, 1.0, -1.0)
    padded = np.pad(level, 1, constant_values=np.nan)
    beside = np.nanmean((padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]), axis=0)
    lead = colour * (level - beside)
    typical = float(np.median(lead))
    return np.asarray((lead * np.sign(typical) > _CLEAR * abs(typical)) | (u != at_u) | (v != at_v))
