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
    m = 0
    light = dark = 0.0  # pixels, and sums of grey, away from the edges: by far the most of them
    n_light = n_dark = 0.0
    s_t = s_tt = s_u = s_v = s_tu = s_tv = s_uu = s_uv = s_vv = s_i = s_it = s_iu = s_iv = s_ii = 0.0
    x_1 = x_t = x_i = x_x = y_1 = y_t = y_i = y_y = 0.0
    for row in range(top, bottom + 1, stride):
        dv = row - at[1]
        for column in range(left, right + 1, stride):
            du = column - at[0]
            x, y = xu * du + xv * dv, yu * du + yv * dv
            if abs(x) > _WINDOW or abs(y) > _WINDOW:
                continue
            grey = float(picture[row, column])
            s_ii += grey * grey
            if abs(x) >= wx and abs(y) >= wy:
                if (x > 0) == (y > 0):
                    light += grey
                    n_light += 1
                else:
                    dark += grey
                    n_dark += 1
                continue
            near[0, m], near[1, m], near[2, m] = x, y, grey
            m += 1
    for k in range(m):  # apart from the branches above, so that the compiler vectorises it
        grey = near[2, k]
        p, q = min(max(near[0, k] / wx, -1.0), 1.0), min(max(near[1, k] / wy, -1.0), 1.0)
        s, r = p * (3 - p * p) / 2, q * (3 - q * q) / 2
        s_by, r_by = 1.5 * (1 - p * p) / wx, 1.5 * (1 - q * q) / wy
        t = s * r
        # the corner moves, the pixels stay: dT/du = -dT/dx dx/du - ...
        t_u, t_v = -(s_by * r * xu + s * r_by * yu), -(s_by * r * xv + s * r_by * yv)
        s_t += t
        s_tt += t * t
        s_u += t_u
        s_v += t_v
        s_tu += t * t_u
        s_tv += t * t_v
        s_uu += t_u * t_u
        s_uv += t_u * t_v
        s_vv += t_v * t_v
        s_i += grey
        s_it += grey * t
        s_iu += grey * t_u
        s_iv += grey * t_v
        t_x, t_y = -s_by * p * r, -r_by * q * s  # by wx and by wy, in pitches
        x_1 += t_x
        x_t += t_x * t
        x_i += t_x * grey
        x_x += t_x * t_x
        y_1 += t_y
        y_t += t_y * t
        y_i += t_y * grey
        y_y += t_y * t_y
    n = m + n_light + n_dark
    s_i += light + dark
    s_it += light - dark
    s_t += n_light - n_dark
    s_tt += n_light + n_dark
    if n < 16:
        return
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
measure = compiled(_measure, fastmath=True)
measure_all = compiled(_measure_all, fastmath=True)
