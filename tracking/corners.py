"""Finds a checkerboard's inner corners in a picture, sharpens them to sub-pixel, and measures its black and white."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

_WINDOW = 0.45  # half-window / smallest pitch: as much edge as fits without the next corner's edges
_BLUR_PX = 1.0  # cornerSubPix leans towards whole pixels: 0.037 px on perfect pictures, 0.018 px after this blur
_SQUARE_SPREAD = 0.4  # of the contrast: room for uneven light, none for a finger
_SHARPEN = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 20, 0.005)


def find_board(picture: Picture, shape: tuple[int, int], *, halve: bool) -> Floats | None:
    """Search a picture for a board of ``shape`` (rows, columns) of inner corners: (rows, columns, 2) px, or None.

    ``halve`` searches at half resolution: 0.1 s for 1080p. Never cv2.findChessboardCorners: on a bright noisy frame
    it was measured to search for minutes. Order, turn and handedness of the corners are the detector's own.
    """
    rows, columns = shape
    view = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) if halve else picture
    if min(view.shape) < 8:
        return None
    found, corners = cv2.findChessboardCornersSB(view, (columns, rows), flags=cv2.CALIB_CB_EXHAUSTIVE)
    if not found or corners is None or corners.size != rows * columns * 2:
        return None
    grid = np.asarray(corners.reshape(rows, columns, 2), dtype=np.float64)
    return 2 * grid + 0.5 if halve else grid  # the centre of a halved pixel lies between two whole ones


def smallest_pitch(grid: Floats) -> float:
    """Return the smallest distance between neighbours in a grid (rows, columns, 2), in px."""
    along, down = np.diff(grid, axis=0), np.diff(grid, axis=1)
    return float(np.sqrt(min((along**2).sum(axis=-1).min(), (down**2).sum(axis=-1).min())))


def sharpen(picture: Picture, grid: Floats) -> Floats | None:
    """Move each corner (rows, columns, 2) to the sub-pixel saddle near it; None when the grid leaves the picture.

    A corner on bare ground stays where it was: that is no measurement, and only ``read_squares`` can tell.
    """
    half = max(2, round(_WINDOW * smallest_pitch(grid)))
    flat = grid.reshape(-1, 2)
    low, high = np.floor(flat.min(axis=0)).astype(int) - half - 4, np.ceil(flat.max(axis=0)).astype(int) + half + 5
    height, width = picture.shape
    if low.min() < 0 or high[0] > width or high[1] > height:
        return None
    region = cv2.GaussianBlur(picture[low[1] : high[1], low[0] : high[0]], (0, 0), _BLUR_PX)
    start = (flat - low).astype(np.float32).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(region, start, (half, half), (-1, -1), _SHARPEN)
    return np.asarray(found.reshape(grid.shape) + low.astype(np.float64), dtype=np.float64)


def read_squares(picture: Picture, centres: Floats) -> tuple[float, NDArray[np.bool_]]:
    """Read the squares at their centres (n, n, 2) px: contrast in grey levels, and which corners (n-1, n-1) are whole.

    The contrast is positive when square (0, 0) is dark; a grid slipped by one square reads it with the other sign. A
    corner is whole when all four squares around it look like others of their colour: not covered, not glared out.
    """
    height, width = picture.shape
    column = np.clip(np.rint(centres[..., 0]), 1, width - 2).astype(np.intp)
    row = np.clip(np.rint(centres[..., 1]), 1, height - 2).astype(np.intp)
    near = ((0, 0), (0, 1), (1, 0), (0, -1), (-1, 0))  # five pixels: noise averages out, blur stays away
    grey = np.mean([picture[row + down, column + across] for down, across in near], axis=0)
    first = np.indices(grey.shape).sum(axis=0) % 2 == 0  # squares of the colour of square (0, 0)
    one, other = np.median(grey[first]), np.median(grey[~first])
    good = np.abs(grey - np.where(first, one, other)) < _SQUARE_SPREAD * abs(other - one)
    return float(other - one), good[:-1, :-1] & good[:-1, 1:] & good[1:, :-1] & good[1:, 1:]


def right_handed(grid: Floats) -> Floats:
    """Return the grid (n, n, 2) with its axes ordered as the board's, whose z comes towards the camera."""
    (ax, ay), (bx, by) = grid[-1, 0] - grid[0, 0], grid[0, -1] - grid[0, 0]
    # Seen along -z with image y down, board x to board y turns counter-clockwise, which is a negative product.
    return grid if ax * by - ay * bx < 0 else grid.transpose(1, 0, 2)


def quarter_turns(grid: Floats) -> list[Floats]:
    """Return the four ways (n, n, 2) to lay the board's axes on a right-handed grid."""
    return [np.rot90(grid, k) for k in range(4)]
