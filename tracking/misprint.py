"""Printing errors of a board: small offsets of corners and of lines of corners, estimated from the video."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST_CORNERS = 100  # beyond that the unknowns take longer than the video, and errors of more corners average out
_FIRST_M = 1e-5  # start: laser printers are accurate to some 10 um over a board


@dataclass(frozen=True)
class Misprint:
    """Prior of the corners' offsets (2n,), x and y of each corner in turn, m: sigma of each corner and of each line.

    Estimated by expectation and maximisation (Dempster, Laird, Rubin, J. R. Stat. Soc. B 39 (1977) 1), ``learnt``.
    """

    shape: tuple[int, int]
    corner_m: float = _FIRST_M
    line_m: float = _FIRST_M

    @property
    def count(self) -> int:
        """How many unknowns there are; 0 for boards too large."""
        n = self.shape[0] * self.shape[1]
        return 2 * n if n <= MOST_CORNERS else 0

    def lines(self) -> Floats:
        """Return (2n, lines) which line each number belongs to: x to the corner's line across x, y to that across y."""
        nx, ny = self.shape
        i, j = (index.ravel() for index in np.indices(self.shape))
        found = np.zeros((nx * ny, 2, nx + ny))
        found[np.arange(nx * ny), 0, i] = 1.0
        found[np.arange(nx * ny), 1, nx + j] = 1.0
        return found.reshape(2 * nx * ny, -1)

    def covariance(self) -> Floats:
        """Return the prior covariance (2n, 2n), m^2."""
        lines = self.lines()
        return np.asarray(self.corner_m**2 * np.eye(len(lines)) + self.line_m**2 * lines @ lines.T)

    def precision(self) -> Floats:
        """Return the inverse of ``covariance``, line by line (Sherman and Morrison)."""
        lines, corner = self.lines(), self.corner_m**2
        shared = self.line_m**2 / (corner + self.line_m**2 * lines.sum(axis=0))
        return np.asarray((np.eye(len(lines)) - lines * shared @ lines.T) / corner)

    def learnt(self, offsets: Floats, spread: Floats) -> Misprint:
        """Return the prior after one EM step on offsets (2n,), which have the covariance ``spread`` (2n, 2n)."""
        lines, precision = self.lines(), self.precision()
        by_line, by_corner = self.line_m**2 * lines.T @ precision, self.corner_m**2 * precision
        second = np.outer(offsets, offsets) + spread
        line = np.sum(by_line @ second * by_line) / len(by_line) + self.line_m**2
        line -= self.line_m**2 * np.sum(by_line.T * lines) / len(by_line)
        corner = np.sum(by_corner @ second * by_corner) / len(by_corner) + self.corner_m**2
        corner -= self.corner_m**2 * np.trace(by_corner) / len(by_corner)
        return Misprint(self.shape, float(np.sqrt(max(corner, 1e-18))), float(np.sqrt(max(line, 1e-18))))
