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


def _line(offset: float, pitch: float, lines: int) -> int:
    """Return the number of the checker's line (-lines..lines) that is nearest to a point."""
    return min(max(round(offset / pitch), -lines), lines)


def _side(offset: float, pitch: float, lines: int, soft: float) -> float:
    """Return which side of the checker's lines (-lines..lines) x pitch a point is on: +-1, ramping across a line."""
    line = _line(offset, pitch, lines)
    beyond = min(max(2 * (offset - line * pitch) / soft, -1.0), 1.0)
    return beyond if line % 2 == 0 else -beyond


def _place(boards: Floats, k: int, a: float, b: float) -> tuple[float, float, float]:
    """Return u, v on the k-th board (m) and the depth of the ray x/z = a, y/z = b; ``boards`` as in `_paint`."""
    depth = boards[k, 2, 0] * a + boards[k, 2, 1] * b + boards[k, 2, 2]
    u = (boards[k, 0, 0] * a + boards[k, 0, 1] * b + boards[k, 0, 2]) / depth
    v = (boards[k, 1, 0] * a + boards[k, 1, 1] * b + boards[k, 1, 2]) / depth
    return u, v, depth


def _span(rays: NDArray[np.float32], y: int, x: int, axis: int) -> float:
    """Return how far the rays of a pixel reach from the central one in x/z or y/z, and a tenth more for perspective."""
    last, left = SAMPLES * SAMPLES - 1, SAMPLES - 1
    falling = abs(rays[y, x, last, axis] - rays[y, x, 0, axis])
    return 0.55 * float(max(falling, abs(rays[y, x, left, axis] - rays[y, x, last - left, axis])))


def _even(u: float, v: float, reach_u: float, reach_v: float, print_: Floats) -> bool:
    """Whether no edge of checker or paper lies within this reach of a place: all that is there has one grey level."""
    pitch, lines, half, margin = print_[1] / print_[0], int(print_[0]) // 2 - 1, print_[1] / 2, print_[2]
    out_by, reach = max(abs(u), abs(v)) - half, max(reach_u, reach_v)
    if out_by > -reach:
        return bool(reach < out_by < margin - reach or out_by > margin + reach)
    beside_u, beside_v = u - _line(u, pitch, lines) * pitch, v - _line(v, pitch, lines) * pitch
    return bool(abs(beside_u) > reach_u and abs(beside_v) > reach_v)


def _grey(u: float, v: float, depth: float, print_: Floats, light: float, behind: float) -> float:
    """Return the grey level of a place: the board's print, its paper's margin, or what is behind."""
    size, margin, soft, dark, white = print_[1], print_[2], print_[3], print_[4], print_[5]
    out_by = max(abs(u), abs(v)) - size / 2
    if depth <= 0 or out_by >= margin + soft / 2:
        return behind
    lines, pitch = int(print_[0]) // 2 - 1, size / print_[0]
    shade = (white + dark - (white - dark) * _side(u, pitch, lines, soft) * _side(v, pitch, lines, soft)) / 2
    paper = min(max(out_by / soft + 0.5, 0.0), 1.0)
    shade = (shade + (white - shade) * paper) * light
    edge = min(max((out_by - margin) / soft + 0.5, 0.0), 1.0)
    return float(shade + (behind - shade) * edge)


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
    """Paint the board into a picture of the backdrop, within ``area``, as the mean over its sub-exposures.

    ``boards_from_ray`` (nodes, m, 3, 3): for every NODE_ROWS-th row of ``area`` and each of m sub-exposures, (u, v, 1)
    on the board ~ H (x/z, y/z, 1); rows between two nodes are exposed between their times. ``print_``: squares, size,
    margin, softness of edges (m), dark and light grey level. Pixels that no printed edge crosses need one ray.
    """
    exposures, samples, soft = boards_from_ray.shape[1], rays.shape[2], print_[3]
    now = np.empty((exposures, 3, 3))
    for row in range(area[1], area[3]):
        node, past = (row - area[1]) // NODE_ROWS, (row - area[1]) % NODE_ROWS / NODE_ROWS
        now[:] = boards_from_ray[node] + past * (boards_from_ray[node + 1] - boards_from_ray[node])
        for column in range(area[0], area[2]):
            behind, lit, level = float(backdrop[row, column]), float(light[row, column]), 0.0
            y, x = row - box[1], column - box[0]
            wide, high = _span(rays, y, x, 0), _span(rays, y, x, 1)
            for k in range(exposures):
                u, v, depth = _place(now, k, rays[y, x, samples // 2, 0], rays[y, x, samples // 2, 1])
                # derivatives of u and v by the ray
                across_u = abs(now[k, 0, 0] - u * now[k, 2, 0]) * wide + abs(now[k, 0, 1] - u * now[k, 2, 1]) * high
                across_v = abs(now[k, 1, 0] - v * now[k, 2, 0]) * wide + abs(now[k, 1, 1] - v * now[k, 2, 1]) * high
                if depth > 0 and _even(u, v, soft / 2 + across_u / depth, soft / 2 + across_v / depth, print_):
                    level += samples * _grey(u, v, depth, print_, lit, behind)
                    continue
                for sample in range(samples):
                    u, v, depth = _place(now, k, rays[y, x, sample, 0], rays[y, x, sample, 1])
                    level += _grey(u, v, depth, print_, lit, behind)
            value = math.floor(level / (exposures * samples) + noise[row, column] + 0.5)
            out[row, column] = min(max(value, 0), 255)


# Assigned rather than decorated: numba has no types, and this keeps the functions above checked.
_line, _side, _place = compiled(_line), compiled(_side), compiled(_place)
_span, _even, _grey = compiled(_span), compiled(_even), compiled(_grey)
rays_of_box = compiled(_rays_of_box)
paint = compiled(_paint)
