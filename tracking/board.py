"""Board: the checkerboard glued to the straw's tip, and the frame it carries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Board:
    """``squares`` along x by ``squares_y`` along y (0: as many); ``size_m`` is the chequered side in x.

    Board frame: origin at the board's centre; z out of the printed face; how x, y, z lie on the tip is
    ``Camera.mount``. Glued to the face: z along the tip axis, y along the world's Y, x = y x z completes it (all but
    for ``Camera.board_turn_rad``, when the board is glued askew). With the tip axis at phi, x is (cos phi, 0, -sin phi)
    in the world: for a straw lying horizontally (phi = pi/2) board x points down, and a camera that stands upright
    before the board sees x down and y to the right. A board with an even sum of squares looks the same turned by 180
    degrees, so pictures alone never tell +x from -x: ``Camera.board_x_in_image`` does.
    """

    squares: int = 8
    size_m: float = 0.0385
    squares_y: int = 0

    def __post_init__(self) -> None:
        if not 4 <= self.squares <= 40 or not (self.squares_y == 0 or 4 <= self.squares_y <= 40):
            raise TrackingError(f"board: {self.squares} x {self.squares_y} squares; each side must have from 4 to 40")
        if not (math.isfinite(self.size_m) and 0 < self.size_m < 10):
            raise TrackingError(f"board: size is {self.size_m:g} m; give the chequered side in metres, as 0.0385")

    @property
    def shape(self) -> tuple[int, int]:
        """Inner corners along x and along y."""
        return self.squares - 1, (self.squares_y or self.squares) - 1

    @property
    def pitch_m(self) -> float:
        """Side of one square."""
        return self.size_m / self.squares

    def __str__(self) -> str:
        return f"{self.squares}x{self.squares_y or self.squares} squares"

    def corner_points_m(self) -> Floats:
        """Return the inner corners (corners, 3) in the board frame; y runs fastest."""
        nx, ny = self.shape
        x, y = np.meshgrid(np.arange(nx) - (nx - 1) / 2, np.arange(ny) - (ny - 1) / 2, indexing="ij")
        return self.pitch_m * np.stack((x, y, np.zeros_like(x)), axis=-1).reshape(-1, 3)
