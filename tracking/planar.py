"""Compiled fit of (x, z, phi) to the rays of many frames: outliers dropped, with covariance."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_STEPS = 12
_ROUNDS = 6  # rounds of dropping outliers: a finger over some corners takes two or three
_OUTLIER_SIGMA = 4.0  # a good corner of 49 is dropped once in 60 frames: residual lengths are Rayleigh, exp(-4^2 / 2)
_OUTLIER_PX = 0.04  # four times the error that 8 bits leave on an edge; frames at rest may repeat to less than that
MEDIAN_OF_RAYLEIGH = 1.1774
LEAST_SIGMA_PX = 1e-4


def _fit_planar(
    rays: Floats,
    px_per_ray: Floats,
    points_m: Floats,
    to_camera: Floats,
    used: Flags,
    poses: Floats,
    covariance: Floats,
    rms_px: Floats,
    residual_px: Floats,
) -> None:
    """Fit poses (f, 3) of the tip, in place, to rays (f, n, 2) of tip-frame points (n, 3), frame by frame.

    A start of NaN, but for the first: where the last frame that could be fitted ended.
    Gauss-Newton on pixels: ``px_per_ray`` (f, n, 2, 2) is the lens's slope at each ray, as residuals are far smaller
    than the lens's curvature. ``to_camera``: 4x4 from the world. ``used`` (f, n) loses the outliers. Fills
    ``covariance`` (f, 3, 3) = s^2 (J^T J)^-1 with s^2 the residuals' own variance, ``rms_px`` (f), NaN where there is
    no fit, and ``residual_px`` (f, n, 2). Correlated errors of corners are not in it: see ``variance``.
    """
    frames, n, cam = rays.shape[0], rays.shape[1], to_camera
    rows, length, inverse = np.empty((2, 3)), np.empty(n), np.empty((3, 3))
    start = np.empty(3)
    for f in range(frames):
        if f == 0:
            start[:] = poses[0]
        elif not math.isfinite(poses[f, 0]):
            poses[f] = start
        rms_px[f] = math.nan
        kept = 0
        for k in range(n):
            kept += used[f, k]
        for turn in range(_ROUNDS):
            square, converged = 0.0, False
            a = b = c = d = e = g = 0.0  # the normal matrix: aa ab ac / bb bc / cc
            for _ in range(_STEPS):
                x, z, phi = poses[f]
                sin, cos = math.sin(phi), math.cos(phi)
                a = b = c = d = e = g = 0.0
                r0 = r1 = r2 = square = 0.0
                for k in range(n):
                    across, ahead = points_m[k, 0], points_m[k, 2]
                    turned_x, turned_z = cos * across + sin * ahead, cos * ahead - sin * across
                    world_x, world_y, world_z = turned_x + x, points_m[k, 1], turned_z + z
                    p = cam[0, 0] * world_x + cam[0, 1] * world_y + cam[0, 2] * world_z + cam[0, 3]
                    q = cam[1, 0] * world_x + cam[1, 1] * world_y + cam[1, 2] * world_z + cam[1, 3]
                    w = cam[2, 0] * world_x + cam[2, 1] * world_y + cam[2, 2] * world_z + cam[2, 3]
                    ray_a, ray_b = p / w, q / w
                    miss_a, miss_b = rays[f, k, 0] - ray_a, rays[f, k, 1] - ray_b
                    for line in range(2):
                        slope_a, slope_b = px_per_ray[f, k, line, 0], px_per_ray[f, k, line, 1]
                        residual_px[f, k, line] = slope_a * miss_a + slope_b * miss_b
                        for m in range(3):
                            by_x = 1.0 if m == 0 else 0.0 if m == 1 else turned_z
                            by_z = 0.0 if m == 0 else 1.0 if m == 1 else -turned_x
                            dp = cam[0, 0] * by_x + cam[0, 2] * by_z
                            dq = cam[1, 0] * by_x + cam[1, 2] * by_z
                            dw = cam[2, 0] * by_x + cam[2, 2] * by_z
                            rows[line, m] = (slope_a * (dp - ray_a * dw) + slope_b * (dq - ray_b * dw)) / w
                        if used[f, k]:
                            miss, i, j, h = residual_px[f, k, line], rows[line, 0], rows[line, 1], rows[line, 2]
                            a += i * i
                            b += i * j
                            c += i * h
                            d += j * j
                            e += j * h
                            g += h * h
                            r0 += i * miss
                            r1 += j * miss
                            r2 += h * miss
                            square += miss * miss
                determinant = a * (d * g - e * e) - b * (b * g - c * e) + c * (b * e - c * d)
                if kept < 4 or not (math.isfinite(square) and determinant > 1e-12 * a * d * g):
                    break
                step_x = ((d * g - e * e) * r0 + (c * e - b * g) * r1 + (b * e - c * d) * r2) / determinant
                step_z = ((c * e - b * g) * r0 + (a * g - c * c) * r1 + (b * c - a * e) * r2) / determinant
                step_phi = ((b * e - c * d) * r0 + (b * c - a * e) * r1 + (a * d - b * b) * r2) / determinant
                if max(abs(step_x), abs(step_z), abs(step_phi)) < 1e-8:  # 10 nm, 10 nrad: far below any noise
                    converged = True
                    break
                poses[f, 0] += step_x
                poses[f, 1] += step_z
                poses[f, 2] += step_phi
            if not converged:
                break
            count = 0
            for k in range(n):
                if used[f, k]:
                    length[count] = math.hypot(residual_px[f, k, 0], residual_px[f, k, 1])
                    count += 1
            most = max(_OUTLIER_SIGMA * np.median(length[:count]) / MEDIAN_OF_RAYLEIGH, _OUTLIER_PX)
            dropped = 0
            for k in range(n if turn < _ROUNDS - 1 else 0):  # the last fit is accepted as it is
                if used[f, k] and math.hypot(residual_px[f, k, 0], residual_px[f, k, 1]) > most:
                    used[f, k] = False
                    dropped += 1
            kept -= dropped
            if dropped == 0:
                variance = square / (2 * kept - 3)
                inverse[0, 0], inverse[1, 1], inverse[2, 2] = d * g - e * e, a * g - c * c, a * d - b * b
                inverse[0, 1] = inverse[1, 0] = c * e - b * g
                inverse[0, 2] = inverse[2, 0] = b * e - c * d
                inverse[1, 2] = inverse[2, 1] = b * c - a * e
                inverse /= determinant
                covariance[f] = variance * inverse
                rms_px[f] = math.sqrt(square / (2 * kept))
                start[:] = poses[f]
                break


# Assigned rather than decorated: numba has no types, and this keeps the function above checked.
fit_planar = compiled(_fit_planar)
