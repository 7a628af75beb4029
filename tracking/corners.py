"""Corners of a checkerboard: found in a picture, and refined on a board whose place is roughly known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.board import Board
from straw.tracking.edges import measure_all
from straw.tracking.kernels import locate_all
from straw.tracking.lens import Lens
from straw.tracking.print_check import agreement, drift
from straw.tracking.sharpen import FEWEST_CORNERS, REASONS, sharpened

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Flags = NDArray[np.bool_]

_COARSE = 0.3  # of the pitch: the half width of edges that sees corners from 0.4 pitches away
_MOST_PIXELS = 950_000  # searched at a time: 720p whole, 1080p halved
_MOST_BOARDS = 4  # searches in one picture, each 0.03 s at 960 x 540


@dataclass(frozen=True)
class Sighting:
    """One trusted view of the board.

    ``grid`` (nx, ny, 2): corners in px in board order; ``used`` (nx, ny): which of them were seen; ``homography`` (9):
    board points in pitches to rays, as ``kernels.locate`` takes it; ``widths`` (2): half widths of the edges across x
    and across y, px; ``pitch_px``: the smallest side of a square; ``contrast``: grey levels, positive when the square
    at -x, -y is dark; ``rms_px``: what the best homography leaves, per coordinate.
    """

    grid: Floats
    used: Flags
    homography: Floats
    widths: Floats
    pitch_px: float
    contrast: float
    rms_px: float


class Print:
    """A board seen through one lens: refines its corners near a guess and checks that it is the board."""

    def __init__(self, board: Board, lens: Lens) -> None:
        self.board, self.lens = board, lens
        self.points = np.ascontiguousarray(board.corner_points_m()[:, :2] / board.pitch_m)
        n = len(self.points)
        i, j = np.indices(board.shape)
        self._parity = np.where((i + j) % 2 == 0, 1.0, -1.0).ravel()  # corners side by side have light and dark swapped
        # of a coarse guess: where corners are expected, and what is measured there
        self._where, self._pixels = np.empty((n, 8)), np.empty((n, 2))
        self._explained, self._used = np.empty(n), np.empty(n, np.bool_)

    def sharpen(
        self, picture: Picture, guess: Floats, widths: Floats | None, sign: float, *, steady: bool = False
    ) -> Sighting | str:
        """Return the board near a guessed homography (9), or the reason why it is rejected.

        ``widths``: of the edges in the last picture; None when unknown, or the guess is coarse (0.4 squares are
        bridged). ``sign``: of the contrast, 0 when unknown. ``steady``: the guess is less than a square from where the
        board just was, so corners near their guess cannot have slipped by a square; otherwise the print must show it.
        """
        H = guess.copy()
        widths = np.full(2, 0.15 * self._approach(picture, H)) if widths is None else widths.copy()
        n, shape, out = len(self.points), self.board.shape, np.empty(3)
        grid, used = np.empty((n, 2)), np.empty(n, np.bool_)
        given = self.lens.packed, self.points, self._parity, shape, widths, sign, steady
        if why := sharpened(picture, H, *given, grid, used, out):
            return REASONS[why]
        pitch, contrast, rms = out.tolist()
        return Sighting(grid.reshape(*shape, 2), used.reshape(shape), H, widths, pitch, contrast, rms)

    def shifted(self, picture: Picture, guess: Floats, sign: float) -> Floats:
        """Return the guessed homography moved by up to two squares to where the print correlates best."""
        shift = np.empty(2)
        drift(picture, guess, self.lens.packed, *self.board.shape, sign, shift)
        return moved_by(guess, shift)

    def _approach(self, picture: Picture, H: Floats) -> float:
        """Move H (in place) by the median step of corners with wide edges, up to 0.4 squares; return the pitch.

        NaN where the lens does not show the whole board.
        """
        locate_all(H, self.lens.packed, self.points, self._where)
        if not np.isfinite(self._where.sum()):
            return math.nan
        for _ in range(2):
            pitch = _smallest_pitch(self._where)
            found = self._pixels, self._explained, self._used
            measure_all(picture, self._where, self._parity, np.full(2, _COARSE * pitch), 2, *found)
            step = self._pixels - self._where[:, :2]
            seen = (self._explained > 0.3) & (np.hypot(*step.T) < 0.45 * pitch)
            if np.count_nonzero(seen) < FEWEST_CORNERS // 2:
                break
            axes = np.median(self._where[seen, 2:6], axis=0).reshape(2, 2).T
            H[:] = moved_by(H, np.linalg.solve(axes, np.median(step[seen], axis=0)))
            locate_all(H, self.lens.packed, self.points, self._where)
        return _smallest_pitch(self._where)

    def lay(self, picture: Picture, grid: Floats, turn: int, sign: float) -> Sighting | str:
        """Lay the board on a right-handed grid (r, c, 2) of corners that may be a part of it; the best place wins.

        ``turn``: quarter turns of the grid against the board.
        """
        grid = np.rot90(grid, turn)
        nx, ny = self.board.shape
        rows, columns = grid.shape[:2]
        rays = self.lens.rays(grid.reshape(-1, 2))
        if rows > nx or columns > ny or not np.isfinite(rays).all():
            return "a board of another size"
        x, y = np.meshgrid(np.arange(rows) - (nx - 1) / 2, np.arange(columns) - (ny - 1) / 2, indexing="ij")
        H: Any = cv2.findHomography(np.column_stack((x.ravel(), y.ravel())), rays)[
            0
        ]  # typed as never None, which it is
        if H is None:
            return "the corners fit no board"
        part = H.ravel() / H[2, 2]
        used = np.zeros((nx, ny), np.bool_)
        best, placed = -np.inf, part
        for i in range(nx - rows + 1):
            for j in range(ny - columns + 1):
                guess = moved_by(part, np.array((-float(i), -float(j))))
                used[:] = False
                used[i : i + rows, j : j + columns] = True
                contrast, score, _ = agreement(picture, guess, self.lens.packed, used, False)
                if contrast * sign >= 0 and score > best:
                    best, placed = score, guess
        return self.sharpen(picture, placed, None, sign) if np.isfinite(best) else "black and white are swapped"


def moved_by(H: Floats, shift: Floats) -> Floats:
    """Return the homography (9) of a board moved by ``shift`` (2) pitches along its own axes."""
    moved = H.reshape(3, 3) @ np.array(((1, 0, shift[0]), (0, 1, shift[1]), (0, 0, 1)))
    return np.asarray(moved.ravel() / moved[2, 2])


def _smallest_pitch(where: Floats) -> float:
    return float(np.sqrt(min((where[:, 2:4] ** 2).sum(axis=1).min(), (where[:, 4:6] ** 2).sum(axis=1).min())))


def find_boards(picture: Picture) -> Iterator[Floats]:
    """Yield the checkerboards in a picture, one after another, as right-handed grids (r, c, 2) of corners in px.

    At least 4 x 4 corners, and no more than are seen: cut and covered boards come as their largest whole rectangle.
    Large pictures are searched at a half, a third ... of their resolution, which bounds the time: 0.3 s of one core.
    cv2.findChessboardCorners is not used: on a bright noisy frame it searched for minutes.
    """
    shrink = max(math.ceil(math.sqrt(picture.size / _MOST_PIXELS)), 1)
    size = picture.shape[1] // shrink, picture.shape[0] // shrink
    # Cut to whole pixels of the smaller picture, so that places scale back exactly.
    whole = picture[: size[1] * shrink, : size[0] * shrink]
    view = cv2.resize(whole, size, interpolation=cv2.INTER_AREA) if shrink > 1 else picture
    if min(view.shape) < 16:
        return
    for k in range(_MOST_BOARDS):
        flags = cv2.CALIB_CB_LARGER | (0 if k else cv2.CALIB_CB_EXHAUSTIVE)  # in vain, it takes five times as long
        found, corners, meta = cv2.findChessboardCornersSBWithMeta(view, (4, 4), flags=flags)
        if not found or corners is None or corners.size != 2 * meta.size:
            return
        grid = np.asarray(corners.reshape(*meta.shape, 2), dtype=np.float64)
        yield right_handed(shrink * grid + (shrink - 1) / 2)  # the centre of a larger pixel lies between small ones
        view = view.copy()  # search the rest of the picture
        cv2.fillConvexPoly(view, cv2.convexHull(corners.reshape(-1, 2).round().astype(np.int32)), 128)


def right_handed(grid: Floats) -> Floats:
    """Return the grid (r, c, 2) with its axes ordered as the board's, whose z comes towards the camera."""
    (ax, ay), (bx, by) = grid[-1, 0] - grid[0, 0], grid[0, -1] - grid[0, 0]
    # Seen along -z with image y down, board x to board y turns counter-clockwise, which is a negative product.
    return grid if ax * by - ay * bx < 0 else grid.transpose(1, 0, 2)
