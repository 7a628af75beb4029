"""Compiled refinement of a board near a guess: corners measured, homography fitted, print compared, in one call."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled
from straw.tracking.edges import measure_all
from straw.tracking.kernels import farthest, fit_homography, locate_all
from straw.tracking.print_check import agreement

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Flags = NDArray[np.bool_]

FEWEST_CORNERS = 16  # of a board that is covered, glared out or cut off by the picture's edge
LARGEST_RESIDUAL = 0.05  # of the pitch: 1 px at 20 px a square, ten times the effect of motion blur in our clips
_CONVERGED_PX = 0.15  # a hundredth of that is left; at 0.2, corners as sharp as pixels stay 0.05 px off
_UNSETTLED_PX = 0.5
_STEPS = 6
_OUTLIER, _OUTLIER_PX = 4.5, 0.1  # times the rms per coordinate, but at least that much: a corner that is not used
_LEAST_CONTRAST = 15.0  # grey levels between the colours' medians; below it the print cannot be seen
_LEAST_LEAD = 4.0  # dark squares by which the print must fit better where it is than one square aside
_NEAR = 0.3  # of the pitch: a corner closer than this to a steady guess has not slipped by a square

#: What ``sharpened`` returns: 0 for a board, or which of these reasons speaks against it.
REASONS = (
    "",
    "the board leaves the picture",
    "too few corners to trust",
    "the corners fit no board",
    "too little contrast",
    "black and white are swapped",
    "the board cannot be told from one a square aside",
)
_GOOD, _OUTSIDE, _FEW, _NO_BOARD, _PALE, _SWAPPED, _ASIDE = range(len(REASONS))


def _fit(points: Floats, pixels: Floats, used: Flags, lens: Floats, H: Floats, seen: Floats, kept: Flags) -> float:
    """Fit H to the used corners, once more without outliers where there are any; return the rms residual, px.

    Shapes as in ``fit_homography``, where ``seen`` is ``where``; ``kept`` (n,) is room for the corners within limits.
    """
    rms = fit_homography(points, pixels, used, lens, H, seen)
    if rms < 0:
        return float(rms)
    limit_px = max(_OUTLIER * rms, _OUTLIER_PX)
    for k in range(len(points)):
        kept[k] = used[k] and math.hypot(pixels[k, 0] - seen[k, 0], pixels[k, 1] - seen[k, 1]) < limit_px
    count = kept.sum()
    if count == used.sum() or count < FEWEST_CORNERS:
        return float(rms)
    used[:] = kept
    return float(fit_homography(points, pixels, used, lens, H, seen))


def _sharpened(
    picture: Picture,
    H: Floats,
    lens: Floats,
    points: Floats,
    parity: Floats,
    shape: tuple[int, int],
    widths: Floats,
    sign: float,
    steady: bool,
    grid: Floats,
    used: Flags,
    out: Floats,
) -> int:
    """Refine a guessed homography (9, in place); return 0, or the number of the reason why the board is rejected.

    ``points`` (n, 2) of the board in pitches, ``parity`` (n) as ``measure_all`` takes it, ``widths`` (2) of the edges,
    updated; ``sign`` and ``steady`` as in ``Print.sharpen``. Fills ``grid`` (n, 2), corners in px, ``used`` (n), and
    ``out`` (3): the smallest pitch, px, the print's contrast, the rms residual, px.
    """
    n = len(points)
    start, where, found = np.empty((n, 8)), np.empty((n, 8)), np.empty((n, 8))
    pixels, explained, kept = np.empty((n, 2)), np.empty(n), np.ones(n, np.bool_)
    locate_all(H, lens, points, start)
    if not math.isfinite(start.sum()):
        return _OUTSIDE
    where[:] = start
    rms, moved, pitch = -1.0, math.inf, 0.0
    for _ in range(_STEPS):
        pitch = measure_all(picture, where, parity, widths, 1, pixels, explained, used)
        if used.sum() < FEWEST_CORNERS:
            return _FEW
        rms = fit(points, pixels, used, lens, H, found, kept)
        if rms < 0:
            return _NO_BOARD
        moved = farthest(found, where, used)
        where[:] = found
        if moved < _CONVERGED_PX:
            break
    if moved >= _UNSETTLED_PX or rms > LARGEST_RESIDUAL * pitch:
        return _NO_BOARD
    kept[:] = True
    near = steady and farthest(where, start, kept) < _NEAR * pitch
    contrast, score, slipped = agreement(picture, H, lens, used.reshape(shape), not near)
    if abs(contrast) < _LEAST_CONTRAST:
        return _PALE
    if contrast * sign < 0:
        return _SWAPPED
    if not near and score - slipped < _LEAST_LEAD:
        return _ASIDE
    for k in range(n):
        for i in range(2):
            grid[k, i] = pixels[k, i] if used[k] else where[k, i]
    out[0], out[1], out[2] = pitch, contrast, rms
    return _GOOD


# Assigned rather than decorated: numba has no types, and this keeps the functions above checked.
fit = compiled(_fit)
sharpened = compiled(_sharpened)
