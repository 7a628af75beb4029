"""Compiled corner measurement: two edges that cross, fitted to the grey levels where the pixels are."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

_WINDOW = 0.46  # of the pitch, on either side of a corner: its four squares, and no edge of the next corner
_EXPLAINED = 0.7  # of the grey levels' variance around a corner; a finger over one of its four squares leaves less
_LEAST, _MOST = 0.5, 1.7  # contrast of a corner over the median of all
_REACH = 0.3  # of the pitch: a corner farther from its guess is measured again from closer by, or is another one
_LEAST_WIDTH_PX = 0.7  # half the width of an edge: a pixel alone makes it half a pixel
# But no edge is compared with a narrower one than this: few pixels lie across it, and where they happen to lie shifts
# the result, by 0.012 px rms at 0.7, by 0.005 px from 1.5 on; whole rows alike when the board is upright.
_RASTER_WIDTH_PX = 1.5
_MOST_WIDTH = 0.42  # of the pitch


def _gather(
    picture: Picture,
    at: Floats,
    slopes: tuple[float, float, float, float],
    wx: float,
    wy: float,
    bounds: tuple[int, int, int, int],
    stride: int,
    near: Floats,
) -> tuple[int, int, int, int, int, int]:
    """Collect the pixels of a corner's window: those near its edges in ``near`` (3, m) as x, y, grey, the rest as sums.

    ``slopes``: of x and of y by column and by row; ``wx``, ``wy``: what counts as near, all in pitches; ``bounds``:
    rows and columns, first and last, that hold the window. Returns how many pixels, and how many near; the sums of grey
    and its square; how many more of the others are in squares where x y > 0 than where it is negative, and by how much
    their grey sums differ. Row by row the window is cut into runs, as by far the most pixels are away from the edges.
    """
    xu, xv, yu, yv = slopes
    top, bottom, left, right = bounds
    # columns from one edge of a square to the next along a row
    per_x, per_y = 1 / xu if xu != 0 else 1e300, 1 / yu if yu != 0 else 1e300
    reach_x, reach_y = abs(per_x), abs(per_y)
    n = m = n_signed = sum_signed = sum_grey = sum_square = 0
    for row in range(top, bottom + 1, stride):
        x_0, y_0 = xv * (row - at[1]), yv * (row - at[1])
        edge_x, edge_y = at[0] - x_0 * per_x, at[0] - y_0 * per_y  # the columns where the row crosses the edges
        low = max(edge_x - _WINDOW * reach_x, edge_y - _WINDOW * reach_y, left)
        high = min(edge_x + _WINDOW * reach_x, edge_y + _WINDOW * reach_y, right)
        if low > high:
            continue
        # near which columns are from ... to; none where an edge is out of the window
        one, one_to = max(edge_x - wx * reach_x, low), max(min(edge_x + wx * reach_x, high), low - 1)
        two, two_to = max(edge_y - wy * reach_y, low), max(min(edge_y + wy * reach_y, high), low - 1)
        if one > two:
            one, one_to, two, two_to = two, two_to, one, one_to
        column, end = math.ceil(low), math.floor(high) + 1
        column += (left - column) % stride
        for part in range(3):  # pixels away from the edges, then those near the next edge, of which there are two
            first, last = (one, one_to) if part == 0 else (two, two_to)
            begin = end if part == 2 or first > high else math.ceil(first)
            if column < begin:
                x, y = xu * (column - at[0]) + x_0, yu * (column - at[0]) + y_0
                count = sum_run = 0
                for k in range(column, begin, stride):
                    grey: int = np.int64(picture[row, k])  # type: ignore[assignment]  # a byte would overflow
                    sum_run += grey
                    sum_square += grey * grey
                    count += 1
                column += count * stride
                n += count
                sum_grey += sum_run
                sign = 1 if x * y > 0 else -1
                n_signed += sign * count
                sum_signed += sign * sum_run
            if part == 2:
                break
            for k in range(column, math.floor(last) + 1, stride):
                grey = np.int64(picture[row, k])  # type: ignore[assignment]
                near[0, m], near[1, m], near[2, m] = xu * (k - at[0]) + x_0, yu * (k - at[0]) + y_0, grey
                sum_grey += grey
                sum_square += grey * grey
                m += 1
                column += stride
    return n + m, m, sum_grey, sum_square, n_signed, sum_signed


def _measure(
    picture: Picture,
    at: Floats,
    wide_x: float,
    wide_y: float,
    gain_x: float,
    gain_y: float,
    stride: int,
    near: Floats,
    out: Floats,
) -> None:
    """Measure one corner near ``at`` (as ``locate`` gives it): one Gauss-Newton step of a picture of a corner.

    The model is m + c s(a) s(b): a, b are the distances to the two edges, s the smooth step (3 t - t^3) / 2 over the
    edges' half widths ``wide_x``, ``wide_y`` (px, of the edges across x and across y). It is point-symmetric, like any
    corner however blurred, so that a wrong width costs precision but never shifts the result; and it is compared where
    the pixels are, so that nothing is interpolated. ``out`` (8): du, dv, c, the share of the window's variance
    explained, and what Gauss-Newton steps of both widths need: gradient x, curvature x, gradient y, curvature y.
    ``gain_x``, ``gain_y``: by how much the step is too long across each edge. ``near`` (3, m): room for the pixels near
    the edges.
    """
    for k in range(8):
        out[k] = 0.0
    ax, ay, bx, by = at[2], at[3], at[4], at[5]
    area = ax * by - ay * bx
    reach_u, reach_v = _WINDOW * (abs(ax) + abs(bx)), _WINDOW * (abs(ay) + abs(by))
    height, width = picture.shape
    left, right = math.ceil(at[0] - reach_u), math.floor(at[0] + reach_u)
    top, bottom = math.ceil(at[1] - reach_v), math.floor(at[1] + reach_v)
    if not (left >= 0 and top >= 0 and right < width and bottom < height) or abs(area) < 9.0:
        return
    # distance to the edge x = 0 is x * far_x
    far_x, far_y = abs(area) / math.hypot(bx, by), abs(area) / math.hypot(ax, ay)
    wx, wy = wide_x / far_x, wide_y / far_y  # in pitches
    xu, xv, yu, yv = by / area, -bx / area, -ay / area, ax / area
    slopes, bounds = (xu, xv, yu, yv), (top, bottom, left, right)
    n, m, sum_grey, sum_square, n_signed, sum_signed = gather(picture, at, slopes, wx, wy, bounds, stride, near)
    if n < 16:
        return
    # The model's picture is t = s(p) r(q), with dt/dp = 1.5 a and dt/dq = 1.5 b; away from the edges it is 1 or -1.
    s_t = s_tt = s_a = s_b = s_ta = s_tb = s_aa = s_ab = s_bb = s_it = s_ia = s_ib = 0.0
    x_1 = x_t = x_i = x_x = y_1 = y_t = y_i = y_y = 0.0
    for k in range(m):  # apart from the search for these pixels, so that the compiler vectorises it
        grey = near[2, k]
        p, q = min(max(near[0, k] / wx, -1.0), 1.0), min(max(near[1, k] / wy, -1.0), 1.0)
        s, r = p * (3 - p * p) / 2, q * (3 - q * q) / 2
        t, a, b = s * r, (1 - p * p) * r, (1 - q * q) * s
        ap, bq = a * p, b * q
        s_t += t
        s_tt += t * t
        s_a += a
        s_b += b
        s_ta += t * a
        s_tb += t * b
        s_aa += a * a
        s_ab += a * b
        s_bb += b * b
        s_it += grey * t
        s_ia += grey * a
        s_ib += grey * b
        x_1 += ap
        x_t += ap * t
        x_i += ap * grey
        x_x += ap * ap
        y_1 += bq
        y_t += bq * t
        y_i += bq * grey
        y_y += bq * bq
    by_x, by_y = -1.5 / wx, -1.5 / wy  # the corner moves, the pixels stay: dt/du = by_x a dx/du + by_y b dy/du
    ua, ub, va, vb = by_x * xu, by_y * yu, by_x * xv, by_y * yv
    s_u, s_v = ua * s_a + ub * s_b, va * s_a + vb * s_b
    s_tu, s_tv = ua * s_ta + ub * s_tb, va * s_ta + vb * s_tb
    s_iu, s_iv = ua * s_ia + ub * s_ib, va * s_ia + vb * s_ib
    s_uu = ua * ua * s_aa + 2 * ua * ub * s_ab + ub * ub * s_bb
    s_uv = ua * va * s_aa + (ua * vb + ub * va) * s_ab + ub * vb * s_bb
    s_vv = va * va * s_aa + 2 * va * vb * s_ab + vb * vb * s_bb
    # by the half widths, in pitches
    x_1, x_t, x_i, x_x = by_x * x_1, by_x * x_t, by_x * x_i, by_x * by_x * x_x
    y_1, y_t, y_i, y_y = by_y * y_1, by_y * y_t, by_y * y_i, by_y * by_y * y_y
    s_i, s_ii, s_it = float(sum_grey), float(sum_square), s_it + sum_signed
    s_t, s_tt = s_t + n_signed, s_tt + (n - m)
    # Means out, then 3 x 3 for c, c du, c dv.
    v_tt, v_tu, v_tv = s_tt - s_t * s_t / n, s_tu - s_t * s_u / n, s_tv - s_t * s_v / n
    v_uu, v_uv, v_vv = s_uu - s_u * s_u / n, s_uv - s_u * s_v / n, s_vv - s_v * s_v / n
    v_it, v_iu, v_iv = s_it - s_i * s_t / n, s_iu - s_i * s_u / n, s_iv - s_i * s_v / n
    total = s_ii - s_i * s_i / n
    c_uu, c_uv, c_vv = v_uu - v_tu * v_tu / v_tt, v_uv - v_tu * v_tv / v_tt, v_vv - v_tv * v_tv / v_tt
    g_u, g_v = v_iu - v_it * v_tu / v_tt, v_iv - v_it * v_tv / v_tt
    determinant = c_uu * c_vv - c_uv * c_uv
    if total <= 0 or v_tt <= 0 or determinant <= 1e-9 * c_uu * c_vv:
        return
    cu, cv = (c_vv * g_u - c_uv * g_v) / determinant, (c_uu * g_v - c_uv * g_u) / determinant
    c = (v_it - cu * v_tu - cv * v_tv) / v_tt
    if c == 0:
        return
    x, y = (xu * cu + xv * cv) / (c * gain_x), (yu * cu + yv * cv) / (c * gain_y)
    out[0], out[1], out[2] = ax * x + bx * y, ay * x + by * y, c
    out[3] = (c * v_it + cu * v_iu + cv * v_iv) / total
    mean = (s_i - c * s_t) / n
    out[4], out[5] = (x_i - mean * x_1 - c * x_t) * c / far_x, x_x * c * c / (far_x * far_x)
    out[6], out[7] = (y_i - mean * y_1 - c * y_t) * c / far_y, y_y * c * c / (far_y * far_y)


def _measure_all(
    picture: Picture,
    where: Floats,
    parity: Floats,
    widths: Floats,
    stride: int,
    pixels: Floats,
    explained: Floats,
    used: NDArray[np.bool_],
) -> float:
    """Measure every corner near ``where`` (n, 8); return the smallest pitch, px.

    Fills ``pixels`` (n, 2), the share ``explained`` (n), and ``used`` (n): which look like corners, of a contrast as
    the others'. ``parity`` (n) is the sign of each corner's contrast against its neighbours'. ``widths`` (2) are
    updated: one Gauss-Newton step on all corners together, within bounds; below ``_RASTER_WIDTH_PX`` only that step
    determines them.
    """
    count, out, step = len(where), np.empty(8), np.zeros(4)
    wide_x, wide_y = max(widths[0], _RASTER_WIDTH_PX), max(widths[1], _RASTER_WIDTH_PX)
    # An edge narrower than the model's changes faster: the integral of both slopes over that of the model's squared.
    gain_x, gain_y = 1.25 - 0.25 * (widths[0] / wide_x) ** 2, 1.25 - 0.25 * (widths[1] / wide_y) ** 2
    contrast, clear = np.empty(count), np.empty(count)
    n, pitch, most = 0, 1e9, 0.0
    for k in range(count):
        reach_u, reach_v = abs(where[k, 2]) + abs(where[k, 4]), abs(where[k, 3]) + abs(where[k, 5])
        most = max(most, (2 * _WINDOW * reach_u + 1) * (2 * _WINDOW * reach_v + 1))
    near = np.empty((3, math.ceil(min(most, picture.size))))
    for k in range(count):
        measure(picture, where[k], wide_x, wide_y, gain_x, gain_y, stride, near, out)
        pixels[k, 0], pixels[k, 1] = where[k, 0] + out[0], where[k, 1] + out[1]
        contrast[k], explained[k] = out[2] * parity[k], out[3]
        pitch = min(pitch, math.hypot(where[k, 2], where[k, 3]), math.hypot(where[k, 4], where[k, 5]))
        if out[3] > _EXPLAINED:
            clear[n] = contrast[k]
            n += 1
        if out[3] > 0.5:
            step += out[4:]
    typical = np.median(clear[:n]) if n else 1.0
    for k in range(count):
        ratio = contrast[k] / typical
        far = max(abs(pixels[k, 0] - where[k, 0]), abs(pixels[k, 1] - where[k, 1]))
        used[k] = explained[k] > _EXPLAINED and _LEAST < ratio < _MOST and far < _REACH * pitch
    for k in range(2):
        wide = wide_x if k == 0 else wide_y
        if step[2 * k + 1] > 0:
            change, most = step[2 * k] / step[2 * k + 1], 0.5 * wide
            widths[k] = wide + min(max(change, -most), 2 * most)
        widths[k] = min(max(widths[k], _LEAST_WIDTH_PX), _MOST_WIDTH * pitch)
    return pitch


# Assigned rather than decorated: numba has no types, and this keeps the functions above checked.
gather = compiled(_gather, fastmath=True)
measure = compiled(_measure, fastmath=True)
measure_all = compiled(_measure_all, fastmath=True)
