"""Compiled geometry of the tracker: the lens, and the board's picture from a homography."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled

Floats = NDArray[np.float64]


def _distort(a: float, b: float, lens: Floats) -> tuple[float, float, float, float, float, float]:
    """Distort a normalised ray: a', b' and the four derivatives da'/da, da'/db, db'/da, db'/db.

    ``lens`` is ``Lens.packed``: 1 for fisheye or 0 for Brown-Conrady, fx, fy, cx, cy, five coefficients.
    """
    square = a * a + b * b
    if lens[0] > 0:
        k1, k2, k3, k4 = lens[5], lens[6], lens[7], lens[8]
        radius = math.sqrt(square)
        theta = math.atan(radius)
        t2 = theta * theta
        distorted = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
        slope = (1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))) / (1 + square)
        if radius < 1e-4:  # on the axis both quotients are 0/0: take their limits
            gain, curve = 1.0, 2 * (k1 - 1 / 3)
        else:
            gain = distorted / radius
            curve = (slope - gain) / square
        cross = a * b * curve
        return a * gain, b * gain, gain + a * a * curve, cross, cross, gain + b * b * curve
    k1, k2, p1, p2, k3 = lens[5], lens[6], lens[7], lens[8], lens[9]
    gain = 1 + square * (k1 + square * (k2 + square * k3))
    curve = 2 * (k1 + square * (2 * k2 + square * 3 * k3))
    cross = a * b * curve + 2 * (p1 * a + p2 * b)
    return (
        a * gain + 2 * p1 * a * b + p2 * (square + 2 * a * a),
        b * gain + p1 * (square + 2 * b * b) + 2 * p2 * a * b,
        gain + a * a * curve + 2 * p1 * b + 6 * p2 * a,
        cross,
        cross,
        gain + b * b * curve + 6 * p1 * b + 2 * p2 * a,
    )


def _distort_all(a: Floats, b: Floats, lens: Floats, out: Floats) -> None:
    """Fill ``out`` (6, n) with what ``_distort`` says of each ray."""
    for k in range(a.size):
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k], out[5, k] = distort(a[k], b[k], lens)


def _undistort_all(pixels: Floats, lens: Floats, out: Floats) -> None:
    """Fill ``out`` (n, 2) with the rays that pixels (n, 2) look along; NaN where the model has no inverse."""
    for k in range(len(pixels)):
        ad, bd = (pixels[k, 0] - lens[3]) / lens[1], (pixels[k, 1] - lens[4]) / lens[2]
        radius, stretch = math.hypot(ad, bd), 1.0
        if lens[0] > 0 and radius > 1e-9:  # an undistorted equidistant lens is a far better start than no lens at all
            stretch = math.tan(min(radius, 1.4)) / radius
        a, b = ad * stretch, bd * stretch
        out[k, 0] = out[k, 1] = math.nan
        for _ in range(13):  # Newton doubles the digits: a few steps do, from this start
            ea, eb, aa, ab, ba, bb = distort(a, b, lens)
            ea, eb = ea - ad, eb - bd
            if math.hypot(ea, eb) < 1e-12:
                out[k, 0], out[k, 1] = a, b
                break
            determinant = aa * bb - ab * ba
            a, b = a - (bb * ea - ab * eb) / determinant, b - (aa * eb - ba * ea) / determinant


def _locate(H: Floats, lens: Floats, x: float, y: float, out: Floats) -> None:
    """Fill ``out`` (8) with where the board's point (x, y), in pitches from its centre, is seen.

    u, v; du/dx, dv/dx, du/dy, dv/dy in px a pitch; and the ray a, b. ``H`` (9) maps (x, y, 1) to the ray (a, b, 1).
    """
    depth = H[6] * x + H[7] * y + H[8]
    a, b = (H[0] * x + H[1] * y + H[2]) / depth, (H[3] * x + H[4] * y + H[5]) / depth
    ad, bd, aa, ab, ba, bb = distort(a, b, lens)
    ax, bx = (H[0] - a * H[6]) / depth, (H[3] - b * H[6]) / depth
    ay, by = (H[1] - a * H[7]) / depth, (H[4] - b * H[7]) / depth
    out[0], out[1] = lens[1] * ad + lens[3], lens[2] * bd + lens[4]
    out[2], out[3] = lens[1] * (aa * ax + ab * bx), lens[2] * (ba * ax + bb * bx)
    out[4], out[5] = lens[1] * (aa * ay + ab * by), lens[2] * (ba * ay + bb * by)
    out[6], out[7] = a, b


def _locate_all(H: Floats, lens: Floats, points: Floats, out: Floats) -> None:
    """Fill ``out`` (n, 8) with what ``_locate`` says of each of the points (n, 2)."""
    for k in range(len(points)):
        locate(H, lens, points[k, 0], points[k, 1], out[k])


def _fit_homography(
    points: Floats, pixels: Floats, used: NDArray[np.bool_], lens: Floats, H: Floats, where: Floats
) -> float:
    """Fit ``H`` (9, in place, h8 = 1) to the used pixels (n, 2) of points (n, 2); return the rms residual in px, or -1.

    Gauss-Newton on the reprojection; ``where`` (n, 8) is left as ``locate`` gives it for the fitted H.
    """
    for step in range(8):
        normal, right = np.zeros((8, 8)), np.zeros(8)
        square, count = 0.0, 0
        rows = np.empty((2, 8))
        for k in range(len(points)):
            x, y = points[k, 0], points[k, 1]
            locate(H, lens, x, y, where[k])
            if not used[k]:
                continue
            a, b = where[k, 6], where[k, 7]
            depth = H[6] * x + H[7] * y + H[8]
            _, _, aa, ab, ba, bb = distort(a, b, lens)
            for line in range(2):
                f = lens[1 + line] / depth
                da, db = (aa * f, ab * f) if line == 0 else (ba * f, bb * f)
                slant = -(da * a + db * b)
                rows[line, 0], rows[line, 1], rows[line, 2] = da * x, da * y, da
                rows[line, 3], rows[line, 4], rows[line, 5] = db * x, db * y, db
                rows[line, 6], rows[line, 7] = slant * x, slant * y
                miss = pixels[k, line] - where[k, line]
                square += miss * miss
                for i in range(8):
                    right[i] += rows[line, i] * miss
                    for j in range(i + 1):
                        normal[i, j] += rows[line, i] * rows[line, j]
            count += 2
        if count < 10 or not math.isfinite(square):
            return -1.0
        # Cholesky by hand: a singular matrix is an answer here, not an exception.
        largest = 0.0
        for i in range(8):
            largest = max(largest, normal[i, i])
        for i in range(8):
            for j in range(i + 1):
                value = normal[i, j]
                for m in range(j):
                    value -= normal[i, m] * normal[j, m]
                if i == j:
                    if value <= 1e-14 * largest:
                        return -1.0
                    normal[i, i] = math.sqrt(value)
                else:
                    normal[i, j] = value / normal[j, j]
        for i in range(8):
            for m in range(i):
                right[i] -= normal[i, m] * right[m]
            right[i] /= normal[i, i]
        for i in range(7, -1, -1):
            for m in range(i + 1, 8):
                right[i] -= normal[m, i] * right[m]
            right[i] /= normal[i, i]
        moved = 0.0
        for i in range(8):
            H[i] += right[i]
            moved = max(moved, abs(right[i]))
        if moved < 1e-7 or step == 7:  # a ray to 1e-7: a ten-thousandth of a pixel
            for k in range(len(points)):
                locate(H, lens, points[k, 0], points[k, 1], where[k])
            return math.sqrt(square / count)
    return -1.0


def _farthest(one: Floats, other: Floats, counts: NDArray[np.bool_]) -> float:
    """Return the largest distance, px, between points (n, 2 or more) that count."""
    most = 0.0
    for k in range(len(one)):
        if counts[k]:
            most = max(most, math.hypot(one[k, 0] - other[k, 0], one[k, 1] - other[k, 1]))
    return most


# Assigned rather than decorated: numba has no types, and this keeps the functions above checked.
distort = compiled(_distort)
distort_all = compiled(_distort_all)
undistort_all = compiled(_undistort_all)
locate = compiled(_locate)
locate_all = compiled(_locate_all)
fit_homography = compiled(_fit_homography)
farthest = compiled(_farthest)
