"""Blocks of the settling's normal equations, and the geometry of boards that the tip carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.tracking.compiled import compiled
from straw.tracking.planar import LEAST_SIGMA_PX, MEDIAN_OF_RAYLEIGH

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Linear:
    """The problem near some constants, poses eliminated: its normal matrix (c, c) without priors, the ``score`` (c,).

    ``size`` (c,): the diagonal of the normal matrix before, which rounding leaves positive.
    ``disagreement`` (c, c): covariance of the score by stretches of time. Poses (f, 3) move by ``by_none`` (f, 3) less
    ``by_theta`` (f, 3, c) times the constants' step. ``at_rest`` (n, 2, c): by how much corners at rest move the score.
    """

    normal: Floats
    size: Floats
    score: Floats
    disagreement: Floats
    by_none: Floats
    by_theta: Floats
    at_rest: Floats


def carried(points: Floats, poses: Floats) -> tuple[Floats, Floats]:
    """Return points (n, 3) of the tip frame in the world (f, n, 3), and how the tips are turned (f, 3, 3)."""
    sin, cos = np.sin(poses[:, 2]), np.cos(poses[:, 2])
    turn = np.zeros((len(poses), 3, 3))
    turn[:, 0, 0], turn[:, 0, 2], turn[:, 1, 1], turn[:, 2, 0], turn[:, 2, 2] = cos, sin, 1.0, -sin, cos
    shift = np.stack((poses[:, 0], np.zeros(len(poses)), poses[:, 1]), axis=-1)
    return points @ turn.swapaxes(1, 2) + shift[:, None], turn


def left_jacobian(turn: Floats) -> Floats:
    """Return how a rotation turns on (3, 3) when its rotation vector changes: I + a [w] + b [w]^2."""
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    if angle < 1e-6:
        return np.asarray(np.eye(3) + cross / 2)
    a, b = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + a * cross + b * cross @ cross)


def sigma_px(length_px: Floats) -> float:
    """Standard deviation per coordinate of residuals of these lengths, by their median."""
    return max(float(np.median(length_px)) / MEDIAN_OF_RAYLEIGH, LEAST_SIGMA_PX)


def eliminated(weighted: Floats, by_theta: Floats, by_pose: Floats) -> tuple[Floats, Floats]:
    """Return each frame's blocks of the normal matrix: poses with poses (f, 3, 3), poses with constants (f, 3, c)."""
    across = weighted.transpose(0, 2, 1)
    # One is added to entries of 1e9 or more, so that a frame without weights, or with a fixed pose, stays solvable.
    return across @ by_pose + np.eye(3), across @ by_theta


def by_print(by: Floats, by_place: Floats) -> Floats:
    """Return each frame's block of the normal matrix (f, m, 2n): offsets, each of its own corner, with ``by``.

    ``by`` (f, 2n, m) and ``by_place`` (f, n, 2, 2) are derivatives of the residuals, one of them weighted.
    """
    found = np.empty((len(by), by.shape[-1], 2 * by_place.shape[1]))
    own_corners(np.ascontiguousarray(by), np.ascontiguousarray(by_place), found)
    return found


def _own_corners(by: Floats, by_place: Floats, found: Floats) -> None:
    """Fill ``found`` with what ``by_print`` returns."""
    for f in range(len(by)):
        for n in range(by_place.shape[1]):
            u, v = by_place[f, n, 0], by_place[f, n, 1]
            for i in range(by.shape[2]):
                along, down = by[f, 2 * n, i], by[f, 2 * n + 1, i]
                found[f, i, 2 * n] = along * u[0] + down * v[0]
                found[f, i, 2 * n + 1] = along * u[1] + down * v[1]


def blocks(blocks: Floats) -> Floats:
    """Return the matrix (2n, 2n) with blocks (n, 2, 2) on its diagonal."""
    n = len(blocks)
    found = np.zeros((n, 2, n, 2))
    found[np.arange(n), :, np.arange(n), :] = blocks
    return np.asarray(found.reshape(2 * n, 2 * n))


# Assigned rather than decorated: numba has no types, and this keeps the function above checked.
own_corners = compiled(_own_corners)
