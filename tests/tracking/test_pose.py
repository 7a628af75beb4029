"""A planted pose is recovered from corners made by OpenCV's own formula, and its sigma is the scatter of its errors."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.lens import Lens
from straw.tracking.pose import Plane, free_pose
from straw.tracking.synthetic import camera_looking_at

POINTS = Board().corner_points_m() + np.array((0, 0, 0.0088))  # in the tip frame
START = np.array((0.018, -0.001, 1.6))


def plane(camera: Camera) -> Plane:
    return Plane(camera.lens, camera.world_from_camera)


@pytest.mark.parametrize("pose", [(0.0103, -0.0037, 1.87), (0.0221, 0.0003, 1.53), (0.016, 0.0, np.pi / 2)])
def test_a_planted_tip_pose_is_recovered(setup, seen_by_opencv, pose):
    found = plane(setup).fit(seen_by_opencv(setup, *pose), POINTS, START)
    # no noise: the remainder is the square of the last Gauss-Newton step, which is below 1e-8
    np.testing.assert_allclose(found.vector, pose, atol=1e-9)
    assert found.rms_px < 1e-6


def test_frames_without_a_start_continue_from_the_last_fitted_one(setup, seen_by_opencv):
    truth = np.array([(0.0221 - 0.001 * k, 0.0003 * k, 1.53 + 0.02 * k) for k in range(6)])
    rays, slopes = setup.lens.rays_with_slopes(np.concatenate([seen_by_opencv(setup, *pose) for pose in truth]))
    used = np.ones((6, 49), bool)
    used[2] = False
    start = np.full((6, 3), np.nan)
    start[0] = START
    found = plane(setup).fit_rays(rays.reshape(6, 49, 2), slopes.reshape(6, 49, 2, 2), POINTS, start, used)
    np.testing.assert_array_equal(np.isfinite(found.rms_px), used.any(axis=1))
    np.testing.assert_allclose(np.delete(found.vector, 2, axis=0), np.delete(truth, 2, axis=0), atol=1e-8)


def test_sigma_is_the_standard_deviation_of_the_error_under_independent_noise(setup, seen_by_opencv):
    rng, pose = np.random.default_rng(4), np.array((0.015, -0.002, 1.7))
    exact, where = seen_by_opencv(setup, *pose), plane(setup)
    fits = [where.fit(exact + rng.normal(0, 0.1, exact.shape), POINTS, START) for _ in range(300)]
    z = np.array([(fit.vector - pose) / np.sqrt(np.diag(fit.covariance)) for fit in fits])
    # mean of 300 squared unit normals: 1 +- 3 sqrt(2/300) = 0.25; dropping 4-sigma corners adds a little
    np.testing.assert_allclose((z**2).mean(axis=0), 1, atol=0.3)


def test_six_outlying_corners_do_not_move_the_pose(setup, seen_by_opencv):
    rng, pose = np.random.default_rng(5), (0.015, -0.002, 1.7)
    pixels = seen_by_opencv(setup, *pose) + rng.normal(0, 0.05, (49, 2))
    wild = rng.choice(49, 6, replace=False)
    pixels[wild] += rng.choice((-1, 1), (6, 2)) * rng.uniform(3, 9, (6, 2))
    found = plane(setup).fit(pixels, POINTS, START)
    assert not found.used[wild].any()
    # 5 sigma of a pose from 43 good corners
    assert np.all(np.abs(found.vector - pose) < 5 * np.sqrt(np.diag(found.covariance)))


def test_corners_that_are_no_board_give_no_pose_or_a_large_residual(setup):
    pixels = np.random.default_rng(6).uniform(100, 900, (49, 2))
    found = plane(setup).fit(pixels, POINTS, START)
    assert found is None or found.rms_px > 10


@pytest.mark.parametrize("azimuth_deg", [0.0, 1e-3, 25.0])
def test_a_frontal_noise_free_board_is_fitted_correctly(hero6, seen_by_opencv, azimuth_deg):
    """SOLVEPNP_IPPE alone returns NaN or a wrong pose here while reporting success."""
    camera = Camera(hero6, camera_looking_at((0.0251, 0, 0), 0.212, np.radians(azimuth_deg), 0.0))
    found, rms_px = free_pose(hero6, Board().corner_points_m(), seen_by_opencv(camera, 0.0163, 0, np.pi / 2))
    world = camera.world_from_camera @ found
    np.testing.assert_allclose(world[:3, 3], (0.0251, 0, 0), atol=1e-7)
    np.testing.assert_allclose(world[:3, 2], (1, 0, 0), atol=1e-5)
    assert rms_px < 1e-4


def test_a_brown_conrady_camera_works_as_well(setup):
    lens = Lens("brown_conrady", 1920, 1080, 1500.0, 1500.0, 960.0, 540.0, (-0.2, 0.05, 0.001, -0.001, 0.0))
    pose, from_world = (0.015, -0.002, 1.7), np.linalg.inv(setup.world_from_camera)
    tilt, _ = cv2.Rodrigues(np.array((0.0, pose[2], 0.0)))  # the tip axis turns from Z towards X: a turn about Y
    world = POINTS @ tilt.T + (pose[0], 0, pose[1])
    K = np.array(((lens.fx, 0, lens.cx), (0, lens.fy, lens.cy), (0, 0, 1)))
    turn, _ = cv2.Rodrigues(from_world[:3, :3])
    pixels, _ = cv2.projectPoints(world, turn, from_world[:3, 3], K, np.array(lens.distortion))
    found = Plane(lens, setup.world_from_camera).fit(pixels.reshape(-1, 2), POINTS, START)
    np.testing.assert_allclose(found.vector, pose, atol=1e-9)
