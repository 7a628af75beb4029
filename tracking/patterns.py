"""Correlation of corner errors over a board: sums over all pairs of corners, without forming their matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Patterns:
    """Three kinds of error of 1 px: white; shared along an edge of the board; shared along a line across the edges.

    An edge that is drawn beside its place errs across itself, alike all along. A board that turns in the picture moves
    each line of corners along itself, as much as that is off the middle, and a part of it is left out. What is shared
    fades to 1 / e over the board's length. Each is a product of covariances along x and along y (3, 2, n, n), first for
    errors along x, which edges that run along y share, then for errors along y.
    """

    along_x: Floats
    along_y: Floats

    @classmethod
    def of(cls, shape: tuple[int, int], every: int = 1) -> Patterns:
        """Return the patterns of a board of so many corners, of which only some are looked at."""
        (own_x, far_x), (own_y, far_y) = (_along(n, every) for n in shape)
        return cls(
            np.array(((own_x, own_x), (own_x, far_x), (far_x, own_x))),
            np.array(((own_y, own_y), (far_y, own_y), (own_y, far_y))),
        )

    def between(self, H: Floats) -> Floats:
        """Return H^T K H (3, f, m, m) for H (f, nx, ny, 2, m), the sensitivity to errors along x and y of each
        corner."""
        f, nx, ny, _, m = H.shape
        found = np.zeros((len(self.along_x), f, m, m))
        for way in (0, 1):
            own = np.ascontiguousarray(H[:, :, :, way])
            for k, (x, y) in enumerate(zip(self.along_x[:, way], self.along_y[:, way], strict=True)):
                spread = (x @ own.reshape(f, nx, -1)).reshape(f, nx, ny, m) if k else own
                spread = y @ spread if k else spread
                found[k] += own.reshape(f, -1, m).transpose(0, 2, 1) @ spread.reshape(f, -1, m)
        return found

    def whole(self) -> Floats:
        """Return the covariances (3, 2n, 2n), the errors along x and y of each corner in turn."""
        n = self.along_x.shape[-1] * self.along_y.shape[-1]
        found = np.zeros((len(self.along_x), n, 2, n, 2))
        for k, (x, y) in enumerate(zip(self.along_x, self.along_y, strict=True)):
            for way in (0, 1):
                found[k, :, way, :, way] = np.kron(x[way], y[way])
        return found.reshape(len(found), 2 * n, 2 * n)


def _along(n: int, every: int) -> tuple[Floats, Floats]:
    place = np.arange(n)[::every] / max(n - 1, 1)
    return np.eye(len(place)), np.exp(-np.abs(place[:, None] - place))
