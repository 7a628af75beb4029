"""First guesses of a video's poses, from which the least-squares problem starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.tracking.camera import Camera
from straw.tracking.errors import TrackingError
from straw.tracking.follow import Rest
from straw.tracking.pose import Plane, apply, free_pose
from straw.tracking.views import Views

Floats = NDArray[np.float64]


def first_poses(views: Views, camera: Camera, points_m: Floats, rest: Rest | None) -> Floats:
    """Return the pose (f, 3) of each view by itself, each found from the one before.

    ``points_m`` (n, 3) are on the board; ``rest`` is the first view's pose, if known.
    """
    assert camera.world_from_camera is not None
    points = apply(camera.tip_from_board, points_m)
    guess = np.array(rest) if rest else free_start(views, camera, points_m)
    plane, poses = Plane(camera.lens, camera.world_from_camera), []
    for rays, slopes, used in zip(views.rays, views.px_per_ray, views.used, strict=True):
        fit = plane.fit_rays(rays[None], slopes[None], points, guess[None], used[None])
        if np.isfinite(fit.rms_px[0]):  # the next frame's start; in order of time it is near
            guess = fit.vector[0]
        poses.append(guess)
    return np.array(poses)


def free_start(views: Views, camera: Camera, points_m: Floats) -> Floats:
    """Return a first guess of (x, z, phi) for the first view, from its free pose."""
    assert camera.world_from_camera is not None
    used = views.used[0]
    pixels = camera.lens.project(np.column_stack((views.rays[0], np.ones(len(used)))))
    free = free_pose(camera.lens, points_m[used], pixels[used])
    if free is None:
        raise TrackingError("track: the first board fits no pose; check that the lens is this camera's")
    plane = Plane(camera.lens, camera.world_from_camera)
    return plane.pose_of(free[0] @ np.linalg.inv(camera.tip_from_board))[0]
