"""Compiled comparison of the board's print with the picture: whether it agrees, and how far it has moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled
from straw.tracking.kernels import locate

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

_ALIKE = 0.4  # of the contrast: a square that differs less from the others of its colour is seen as that colour
_FLAT = 0.03  # of the best correlation: less is as good
_BESIDE = 0.25  # pitches outside the print: there is white margin, if there is a margin


def _read(picture: Picture, H: Floats, lens: Floats, x: float, y: float, at: Floats) -> float:
    """Return the grey level at a board point, mean of five pixels: noise averages out, blur stays away; -1 outside."""
    locate(H, lens, x, y, at)
    height, width = picture.shape
    if not (1 <= at[0] < width - 2 and 1 <= at[1] < height - 2):
        return -1.0
    u, v = round(at[0]), round(at[1])
    level = float(picture[v, u]) + picture[v - 1, u] + picture[v + 1, u] + picture[v, u - 1] + picture[v, u + 1]
    return float(level / 5)


def _agreement(
    picture: Picture, H: Floats, lens: Floats, used: NDArray[np.bool_], slips: bool
) -> tuple[float, float, float]:
    """Compare the print with the picture: its contrast, its score, and the best score of a grid that slipped.

    The contrast is in grey levels and positive when square (0, 0) is dark. A grid slipped by two squares, or by one
    along a diagonal, fits almost as many corners as the true one. It is recognised by dark squares where it
    predicts light or margin, and the reverse: the score is the number of dark squares seen dark, less all
    contradictions.
    White where white is predicted counts for nothing, as the surroundings may be white. ``used`` (nx, ny) are the
    corners that were found; ``slips`` False leaves the last score 0.
    """
    nx, ny = used.shape
    at = np.empty(8)
    first, other = np.empty((nx + 1) * (ny + 1)), np.empty((nx + 1) * (ny + 1))
    n_first = n_other = 0
    for i in range(nx + 1):
        for j in range(ny + 1):
            beside = False
            for k in range(max(i - 1, 0), min(i + 1, nx)):
                for m in range(max(j - 1, 0), min(j + 1, ny)):
                    beside = beside or used[k, m]
            if not beside:
                continue
            level = read(picture, H, lens, i - nx / 2, j - ny / 2, at)
            if level >= 0 and (i + j) % 2 == 0:
                first[n_first] = level
                n_first += 1
            elif level >= 0:
                other[n_other] = level
                n_other += 1
    if n_first < 4 or n_other < 4:
        return 0.0, 0.0, 0.0
    one, two = np.median(first[:n_first]), np.median(other[:n_other])
    swing, parity = abs(two - one), 0 if two > one else 1
    darkest, lightest = min(one, two) + _ALIKE * swing, max(one, two) - _ALIKE * swing
    score, best = 0.0, -1e9 if slips else 0.0
    for sx in range(-2, 3):
        for sy in range(-2, 3):
            here = sx == 0 and sy == 0
            if (sx + sy) % 2 or abs(sx) + abs(sy) > 2 or not (here or slips):
                continue
            count = 0.0
            for i in range(-1, nx + 2):
                for j in range(-1, ny + 2):
                    margin = i < 0 or j < 0 or i > nx or j > ny
                    x, y = i - nx / 2 + sx, j - ny / 2 + sy
                    if margin:  # from half a pitch outside the print to a quarter: margins are narrow
                        x += _BESIDE if i < 0 else -_BESIDE if i > nx else 0.0
                        y += _BESIDE if j < 0 else -_BESIDE if j > ny else 0.0
                    level = read(picture, H, lens, x, y, at)
                    due_dark = not margin and (i + j) % 2 == parity
                    if 0 <= level < darkest:
                        count += 1.0 if due_dark else -1.0
                    elif level > lightest and due_dark:
                        count -= 1.0
            if here:
                score = count
            else:
                best = max(best, count)
    return two - one, score, best


def _drift(picture: Picture, H: Floats, lens: Floats, nx: int, ny: int, light_sign: float, out: Floats) -> None:
    """Find how far, in pitches along x and y (``out``, 2), the print lies from where H has it: up to two squares.

    ``light_sign``: +1 when square (0, 0) is dark. The correlation of the print with the picture, on a grid fine enough
    (a quarter of a square) for ``sharpen`` to take over.
    """
    at, totals = np.empty(8), np.full((17, 17), -1e18)
    for sx in range(17):
        for sy in range(17):
            total, same = 0.0, 0
            for i in range(nx + 1):
                for j in range(ny + 1):
                    level = read(picture, H, lens, i - nx / 2 + sx / 4 - 2, j - ny / 2 + sy / 4 - 2, at)
                    if level >= 0:
                        sign = -1 if (i + j) % 2 == 0 else 1
                        total += sign * light_sign * level
                        same += sign
            if abs(same) <= nx:
                totals[sx, sy] = total
    best, weight = totals.max(), 0.0
    out[:] = 0.0
    for sx in range(17):
        for sy in range(17):
            if totals[sx, sy] > best - _FLAT * abs(best):  # squares are flat, and so is the top: take its middle
                weight += 1
                out[0] += sx / 4 - 2
                out[1] += sy / 4 - 2
    out /= max(weight, 1.0)


# Assigned rather than decorated: numba has no types, and this keeps the functions above checked.
read = compiled(_read)
agreement = compiled(_agreement)
drift = compiled(_drift)
