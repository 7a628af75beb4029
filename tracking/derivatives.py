"""Compiled derivatives of the settling's residuals by the constants, the poses and the print."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled

Floats = NDArray[np.float64]


def _derivatives(
    points: Floats,
    poses: Floats,
    axes: Floats,
    to_camera: Floats,
    px_per_ray: Floats,
    by_line: Floats,
    centre: Floats,
    jacobian: Floats,
    glued: Floats,
    by_theta: Floats,
    by_pose: Floats,
    by_place: Floats,
) -> None:
    """Fill the derivatives of the residuals, px, of f frames at ``poses`` (f, 3).

    ``points`` (n, 3) in the tip's frame; ``axes`` (3, 2): the board's x and y there; ``to_camera`` (3, 4) from the
    world; ``px_per_ray`` (f, n, 2, 2); ``by_line`` (f, n, 2): how the rays change with the row time; ``centre`` (3,):
    what the camera turns about, and ``jacobian`` (3, 3) how it turns when its rotation vector changes; ``glued`` (2, n,
    3): how the points move with the board's turn. Filled: ``by_theta`` (f, 2n, 9) by the constants, ``by_pose`` (f, 2n,
    3), ``by_place`` (f, n, 2, 2) by the corner's place in the print.
    """
    world, moved, arm, cross = np.empty(3), np.empty((5, 3)), np.empty(3), np.empty(3)
    by_world = np.empty(3)
    for f in range(len(poses)):
        sin, cos = np.sin(poses[f, 2]), np.cos(poses[f, 2])
        for n in range(len(points)):
            x, z = cos * points[n, 0] + sin * points[n, 2], cos * points[n, 2] - sin * points[n, 0]
            world[0], world[1], world[2] = x + poses[f, 0], points[n, 1], z + poses[f, 1]
            for k in range(2):
                moved[k, 0] = cos * glued[k, n, 0] + sin * glued[k, n, 2]
                moved[k, 1] = glued[k, n, 1]
                moved[k, 2] = cos * glued[k, n, 2] - sin * glued[k, n, 0]
                moved[2 + k, 0] = cos * axes[0, k] + sin * axes[2, k]
                moved[2 + k, 1] = axes[1, k]
                moved[2 + k, 2] = cos * axes[2, k] - sin * axes[0, k]
            p, q, w = to_camera[:, 3]
            for i in range(3):
                p += to_camera[0, i] * world[i]
                q += to_camera[1, i] * world[i]
                w += to_camera[2, i] * world[i]
                arm[i] = world[i] - centre[i]
            for line in range(2):
                row = 2 * n + line
                a, b = -px_per_ray[f, n, line, 0] / w, -px_per_ray[f, n, line, 1] / w
                c = -(a * p + b * q) / w
                for i in range(3):
                    by_world[i] = a * to_camera[0, i] + b * to_camera[1, i] + c * to_camera[2, i]
                cross[0] = by_world[1] * arm[2] - by_world[2] * arm[1]
                cross[1] = by_world[2] * arm[0] - by_world[0] * arm[2]
                cross[2] = by_world[0] * arm[1] - by_world[1] * arm[0]
                for i in range(3):
                    turn = cross[0] * jacobian[0, i] + cross[1] * jacobian[1, i] + cross[2] * jacobian[2, i]
                    by_theta[f, row, i], by_theta[f, row, 3 + i] = turn, -by_world[i]
                for k in range(2):
                    one, other = moved[k], moved[2 + k]
                    by_theta[f, row, 6 + k] = by_world[0] * one[0] + by_world[1] * one[1] + by_world[2] * one[2]
                    by_place[f, n, line, k] = by_world[0] * other[0] + by_world[1] * other[1] + by_world[2] * other[2]
                by_theta[f, row, 8] = (
                    px_per_ray[f, n, line, 0] * by_line[f, n, 0] + px_per_ray[f, n, line, 1] * by_line[f, n, 1]
                )
                by_pose[f, row, 0], by_pose[f, row, 1] = by_world[0], by_world[2]
                by_pose[f, row, 2] = by_world[0] * z - by_world[2] * x


# Assigned rather than decorated: numba has no types, and this keeps the function above checked.
derivatives = compiled(_derivatives)
