"""A printed checkerboard as a camera sees it, analytically: Brown's lens, edges as error functions, rolling shutter."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PAPER, INK = 212.0, 38.0  # grey levels under even light


@numba.njit(cache=True)
def bend(a, b, k1, k2, p1, p2, k3):
    """Distort a normalised point: D. C. Brown, Photogrammetric Engineering 37 (1971) 855, as in OpenCV's manual."""
    r2 = a * a + b * b
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a), b * radial + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b


@numba.njit(cache=True)
def unbend(width, height, f, cx, cy, brown, rays):
    """Fill ``rays`` (height, width, 2) with where each pixel looks: fixed-point iteration, to 1e-12."""
    for v in range(height):
        for u in range(width):
            wanted_a, wanted_b = (u - cx) / f, (v - cy) / f
            a, b = wanted_a, wanted_b
            for _ in range(200):
                seen_a, seen_b = bend(a, b, brown[0], brown[1], brown[2], brown[3], brown[4])
                off_a, off_b = wanted_a - seen_a, wanted_b - seen_b
                a, b = a + off_a, b + off_b
                if abs(off_a) + abs(off_b) < 1e-12:
                    break
            rays[v, u, 0], rays[v, u, 1] = a, b


@numba.njit(cache=True)
def wave(at, lines, grade, sigma_px):
    """Return a square wave of +-1 with steps at ``lines`` and Gaussian edges; ``grade`` is board length per px."""
    sign, near = 1.0, 0
    for k in range(len(lines)):
        if abs(at - lines[k]) < abs(at - lines[near]):
            near = k
    if near % 2:
        sign = -1.0
    return sign * math.erf((at - lines[near]) / (grade * sigma_px * math.sqrt(2.0)))


@numba.njit(cache=True)
def inside(at, low, high, grade, sigma_px):
    """Return the share of a pixel between two edges."""
    soft = grade * sigma_px * math.sqrt(2.0)
    return 0.5 * (math.erf((at - low) / soft) - math.erf((at - high) / soft))


@numba.njit(cache=True)
def expose(canvas, light, rays, box, maps, lines_x, lines_y, half_x, half_y, margin, sigma_px):
    """Draw the board into ``canvas`` (height, width, float): box = left, top, right, bottom.

    ``maps`` (rows of the box, moments, 3, 3): ray to board at the moments within that row's exposure. The mean over
    the moments is the motion blur.
    """
    left, top, right, bottom = box
    moments = maps.shape[1]
    for v in range(top, bottom):
        for u in range(left, right):
            a, b = rays[v, u]
            a_u, b_u = (rays[v, u + 1] - rays[v, u - 1]) / 2
            a_v, b_v = (rays[v + 1, u] - rays[v - 1, u]) / 2
            behind, total = canvas[v, u], 0.0
            for m in range(moments):
                h = maps[v - top, m]
                depth = h[2, 0] * a + h[2, 1] * b + h[2, 2]
                x = (h[0, 0] * a + h[0, 1] * b + h[0, 2]) / depth
                y = (h[1, 0] * a + h[1, 1] * b + h[1, 2]) / depth
                x_a, x_b = (h[0, 0] - x * h[2, 0]) / depth, (h[0, 1] - x * h[2, 1]) / depth
                y_a, y_b = (h[1, 0] - y * h[2, 0]) / depth, (h[1, 1] - y * h[2, 1]) / depth
                grade_x = math.hypot(x_a * a_u + x_b * b_u, x_a * a_v + x_b * b_v)
                grade_y = math.hypot(y_a * a_u + y_b * b_u, y_a * a_v + y_b * b_v)
                checks = wave(x, lines_x, grade_x, sigma_px) * wave(y, lines_y, grade_y, sigma_px)
                print_ = inside(x, -half_x, half_x, grade_x, sigma_px) * inside(y, -half_y, half_y, grade_y, sigma_px)
                wide_x, wide_y = half_x + margin, half_y + margin
                sheet = inside(x, -wide_x, wide_x, grade_x, sigma_px) * inside(y, -wide_y, wide_y, grade_y, sigma_px)
                ink = (PAPER + INK) / 2 - checks * (PAPER - INK) / 2
                shade = (PAPER + (ink - PAPER) * print_) * light[v, u]
                total += behind + (shade - behind) * sheet
            canvas[v, u] = total / moments
