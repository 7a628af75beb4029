"""The painter's brush: compiled loops that turn rays into grey levels. Shares no code with the tracker, on purpose."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled

Floats = NDArray[np.float64]

NODE_ROWS = 16  # rolling shutter: the board's place is computed for every 16th row and interpolated between
SAMPLES = 3  # rays a side of each pixel; the soft edges of the print do the rest of the smoothing


def _rays_of_box(
    left: int, top: int, width: int, height: int, f: Floats, c: Floats, k: Floats, out: NDArray[np.float32]
) -> None:
    """Fill ``out`` (height, width, SAMPLES^2, 2) with x/z, y/z of the rays through the pixels of a box.

    The fisheye polynomial theta_d = theta (1 + k1 theta^2 + ... + k4 theta^8) is inverted by Newton on theta alone.
    """
    for row in range(height):
        for column in range(width):
            for sample in range(SAMPLES * SAMPLES):
                u = left + column + (sample % SAMPLES + 0.5) / SAMPLES - 0.5
                v = top + row + (sample // SAMPLES + 0.5) / SAMPLES - 0.5
                mx, my = (u - c[0]) / f[0], (v - c[1]) / f[1]
                bent = math.sqrt(mx * mx + my * my)
                theta = bent
                for _ in range(12):
                    power, value, slope = theta, theta, 1.0
                    for order in range(4):
                        power *= theta
                        slope += (2 * order + 3) * k[order] * power
                        power *= theta
                        value += k[order] * power
                    theta -= (value - bent) / slope
                stretch = math.tan(theta) / bent if bent > 1e-12 else 1.0
                out[row, column, sample, 0] = mx * stretch
                out[row, column, sample, 1] = my * stretch


def _side(offset: float, pitch: float, lines: int, soft: float) -> float:
    """Return which side of the checker's lines (-lines..lines) x pitch a point is on: +-1, ramping across a line."""
    line = min(max(round(offset / pitch), -lines), lines)
    beyond = min(max(2 * (offset - line * pitch) / soft, -1.0), 1.0)
    return beyond if line % 2 == 0 else -beyond


def _paint(
    out: NDArray[np.uint8],
    backdrop: NDArray[np.uint8],
    light: NDArray[np.float32],
    noise: NDArray[np.int8],
    rays: NDArray[np.float32],
    box: NDArray[np.int64],
    area: NDArray[np.int64],
    boards_from_ray: Floats,
    print_: Floats,
) -> None:
    """Paint one picture: noisy backdrop everywhere, and within ``area`` the board as the mean over its sub-exposures.

    ``boards_from_ray`` (nodes, m, 3, 3): for every NODE_ROWS-th row of ``area`` and each of m sub-exposures, (u, v, 1)
    on the board ~ H (x/z, y/z, 1); rows between two nodes are exposed between their times. ``print_``: squares, size,
    margin, softness of edges (m), dark and light grey level.
    """
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            out[row, column] = min(max(np.int16(backdrop[row, column]) + noise[row, column], 0), 255)
    half, margin, soft = print_[1] / 2, print_[2], print_[3]
    lines, pitch = int(print_[0]) // 2 - 1, print_[1] / print_[0]
    middle, swing = (print_[5] + print_[4]) / 2, (print_[5] - print_[4]) / 2
    exposures = boards_from_ray.shape[1]
    count, now = exposures * rays.shape[2], np.empty((exposures, 3, 3))
    for row in range(area[1], area[3]):
        node, past = (row - area[1]) // NODE_ROWS, (row - area[1]) % NODE_ROWS / NODE_ROWS
        now[:] = boards_from_ray[node] + past * (boards_from_ray[node + 1] - boards_from_ray[node])
        for column in range(area[0], area[2]):
            behind, level = float(backdrop[row, column]), 0.0
            for sample in range(rays.shape[2]):
                a, b = rays[row - box[1], column - box[0], sample]
                for h in now:
                    depth = h[2, 0] * a + h[2, 1] * b + h[2, 2]
                    u = (h[0, 0] * a + h[0, 1] * b + h[0, 2]) / depth
                    v = (h[1, 0] * a + h[1, 1] * b + h[1, 2]) / depth
                    out_by = max(abs(u), abs(v)) - half
                    if depth <= 0 or out_by >= margin + soft / 2:
                        level += behind
                        continue
                    shade = middle - swing * _side(u, pitch, lines, soft) * _side(v, pitch, lines, soft)
                    paper = min(max(out_by / soft + 0.5, 0.0), 1.0)
                    shade = (shade + (print_[5] - shade) * paper) * light[row, column]
                    edge = min(max((out_by - margin) / soft + 0.5, 0.0), 1.0)
                    level += shade + (behind - shade) * edge
            value = math.floor(level / count + noise[row, column] + 0.5)
            out[row, column] = min(max(value, 0), 255)


# Assigned rather than decorated: numba has no types, and this keeps the functions above checked.
_side = compiled(_side)
rays_of_box = compiled(_rays_of_box)
paint = compiled(_paint)
