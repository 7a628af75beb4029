"""Board: the checkerboard glued to the straw's tip, and the frame it carries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.errors import TrackingError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Board:
    """A square checkerboard of ``squares`` x ``squares``, ``size_m`` from edge to edge (without its white margin).

    Board frame: origin at the board's centre; z out of the printed face, along the tip axis; y along the world's Y;
    x = y x z completes it (all but for ``Camera.board_turn_rad``, when the board is glued askew). With the tip axis at
    phi, x is (cos phi, 0, -sin phi) in the world: for a straw lying horizontally (phi = pi/2) board x points down, and
    a camera that stands upright before the board sees x down and y to the right. An even number of squares looks the
    same turned by 180 degrees, so pictures alone never tell +x from -x: ``Camera.board_x_in_image`` does.
    """

    squares: int = 8
    size_m: float = 0.0385

    def __post_init__(self) -> None:
        if not 4 <= self.squares <= 30 or self.squares % 2:
            raise TrackingError(f"board: {self.squares} squares a side; it must be an even number from 4 to 30")
        if not (math.isfinite(self.size_m) and 0 < self.size_m < 10):
            raise TrackingError(f"board: size is {self.size_m:g} m; give the chequered side in metres, as 0.0385")

    @property
    def corners(self) -> int:
        """Inner corners a side."""
        return self.squares - 1

    @property
    def pitch_m(self) -> float:
        """Side of one square."""
        return self.size_m / self.squares

    def corner_points_m(self) -> Floats:
        """Return the inner corners (corners^2, 3) in the board frame; y runs fastest."""
        return self._lattice(self.corners)

    def square_centres_m(self) -> Floats:
        """Return the centres of the squares (squares^2, 3) in the board frame; y runs fastest."""
        return self._lattice(self.squares)

    def _lattice(self, n: int) -> Floats:
        line = (np.arange(n) - (n - 1) / 2) * self.pitch_m
        x, y = np.meshgrid(line, line, indexing="ij")
        return np.stack((x, y, np.zeros_like(x)), axis=-1).reshape(-1, 3)
