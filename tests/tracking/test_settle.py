"""Frames at rest determine the camera's pose, the motion determines how the board is mounted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.errors import TrackingError
from straw.tracking.pose import apply
from straw.tracking.settle import settle
from straw.tracking.variance import SLOW, Scatter, Seen
from straw.tracking.views import Views

REST = (0.0221, 0.0, 1.53)


def followed(seen_by_opencv, camera, poses, noise_px=0.0, y_m=0.0, line_s=0.0):
    """Return the follower's output: corners of each pose at 240 frames/s, rows exposed ``line_s`` apart."""
    rng, n = np.random.default_rng(7), len(poses)
    pixels = np.array([seen_by_opencv(camera, *pose, y_m) for pose in poses])
    rows = pixels[..., 1] - pixels[..., 1].mean(axis=1, keepdims=True)
    rate = np.gradient(pixels, 1 / 240, axis=0)
    pixels = pixels + rate * line_s * rows[..., None] + rng.normal(0, noise_px, pixels.shape)
    rays, slopes = camera.lens.rays_with_slopes(pixels.reshape(-1, 2))
    slopes = slopes.reshape(n, 49, 2, 2)
    return Views(
        frame=np.arange(n),
        time_s=np.arange(n) / 240,
        rays=rays.reshape(n, 49, 2),
        px_per_ray=slopes,
        used=np.ones((n, 49), bool),
        rows=rows,
        middle=pixels[..., 1].mean(axis=1),
        rate=np.linalg.solve(slopes, rate[..., None])[..., 0],
        bend=np.zeros((n, 49, 2)),
        jerk=np.zeros((n, 49, 2)),
        doubt=np.zeros(n),
        pitch_px=np.full(n, 20.0),
        across=np.tile(np.eye(2), (n, 1, 1)),
        widths=np.ones((n, 2)),
        sweep=np.zeros((n, 2)),
        key=np.zeros(n, bool),
        jump_px=np.full(n, np.nan),
        leap_px=np.full((n, 49, 2), np.nan),
        speed_px=np.zeros(n),
        chord_px=np.zeros((n, 49, 2)),
        leans=np.zeros((n, 49, 2)),
        askew_px=np.full(n, np.nan),
    )


def poses_of(settled, views) -> np.ndarray:
    points = apply(settled.camera.tip_from_board, Board().corner_points_m())
    rays = views.at_once(settled.camera.line_s, 0.0)
    return settled.plane.fit_rays(rays, views.px_per_ray, points, np.tile(REST, (len(rays), 1)), views.used).vector


def folding(count: int) -> list[tuple[float, float, float]]:
    """Return ten frames at rest, then the path of a folding run."""
    s = np.linspace(0, 1, count)
    wave = np.sin(9 * s)
    path = zip(REST[0] - 0.0118 * s, REST[1] - 0.0037 * s * wave**2, REST[2] + 0.34 * s * (1 + wave) / 2, strict=True)
    return [REST] * 10 + list(path)


def test_the_rest_pose_determines_the_cameras_pose(setup, seen_by_opencv):
    truth = folding(80)
    views = followed(seen_by_opencv, setup, truth)
    settled = settle(Camera(setup.lens, line_s=0.0), Board(), REST, views)
    np.testing.assert_allclose(settled.camera.world_from_camera, setup.world_from_camera, atol=1e-6)
    np.testing.assert_allclose(poses_of(settled, views), truth, atol=1e-7)
    assert 10 <= settled.rest_frames <= 12


def test_the_tilt_of_a_board_glued_askew_is_determined_from_its_motion(setup, seen_by_opencv):
    truth = folding(200)
    askew = replace(setup, board_turn_rad=(np.radians(1.5), np.radians(-1.0)))
    views = followed(seen_by_opencv, askew, truth, noise_px=0.05, y_m=0.001)
    settled = settle(Camera(setup.lens, line_s=0.0), Board(), REST, views)
    error = np.array(settled.camera.board_turn_rad) - askew.board_turn_rad
    assert np.all(np.abs(error) < 4 * np.array(settled.turn_sigma_rad)), error
    assert np.all(np.array(settled.turn_sigma_rad) < 1e-3)
    # 1 mrad of tilt over 12 mm seen at 25 degrees: 0.03 mm at the far end; corner noise adds 0.03 mm
    assert np.all(np.abs(poses_of(settled, views) - truth).max(axis=0) < (1.2e-4, 8e-5, 4e-3))


def test_the_shutters_row_time_is_found_from_the_shear_of_a_moving_board(setup, seen_by_opencv):
    views = followed(seen_by_opencv, setup, folding(200), noise_px=0.02, line_s=3.7e-6)
    settled = settle(Camera(setup.lens), Board(), REST, views)
    assert settled.line_sigma_s < 1e-6
    assert abs(settled.camera.line_s - 3.7e-6) < 4 * settled.line_sigma_s


def test_a_level_camera_measures_the_angle_at_rest(setup, seen_by_opencv):
    """The set-up's camera is level: if that is known, phi at rest need not be."""
    truth = folding(200)
    views = followed(seen_by_opencv, setup, truth)
    wrong = (REST[0], REST[1], REST[2] + 0.05)
    settled = settle(Camera(setup.lens, line_s=0.0), Board(), wrong, views, level=True)
    np.testing.assert_allclose(poses_of(settled, views)[:, 2], [pose[2] for pose in truth], atol=1e-5)


def test_without_a_rest_pose_only_what_does_not_change_the_plane_of_motion_is_determined(setup, seen_by_opencv):
    truth = folding(200)[10:]
    views = followed(seen_by_opencv, setup, truth, y_m=0.002)
    settled = settle(replace(setup, line_s=0.0), Board(), None, views)
    np.testing.assert_allclose(poses_of(settled, views), truth, atol=2e-6)
    shift = settled.camera.world_from_camera - setup.world_from_camera
    np.testing.assert_allclose(shift[:3, 3], (0, -0.002, 0), atol=1e-6)


def test_a_board_that_does_not_move_gives_no_information_on_its_mounting(setup, seen_by_opencv):
    askew = replace(setup, board_turn_rad=(np.radians(1.5), 0.0))
    blind = settle(Camera(setup.lens), Board(), REST, followed(seen_by_opencv, askew, [REST] * 12))
    assert abs(blind.camera.board_turn_rad[0]) < 1e-3
    assert blind.turn_sigma_rad[0] == pytest.approx(0.02, rel=0.15)  # its sigma says so
    assert blind.line_sigma_s == pytest.approx(4e-6, rel=0.05)


def test_errors_of_the_corners_at_rest_are_part_of_every_poses_sigma(setup, seen_by_opencv):
    """Their mean shift at rest shifts the world frame: 0.01 px in each of 49 corners is 0.34 um in every frame."""
    views = followed(seen_by_opencv, setup, folding(200), noise_px=0.005)
    settled = settle(Camera(setup.lens, line_s=0.0), Board(), REST, views)
    first = views.pick(np.array([0]))
    still = np.zeros((1, 3))
    before = settled.covariance(first, np.array([REST]), still, still)
    slopes, left = (
        np.random.default_rng(0).normal(size=(1, 7, 7, 2, 3)),
        np.full((1, 7, 7, 2), np.sqrt(1e-4 * 95 / 98)),
    )
    rest = Seen(slopes, left, np.ones((1, 49), bool), np.array([SLOW]))  # with the residual of any slow picture
    settled.doubt_rest(Scatter((7, 7), np.tile((1e-4, 0.0, 0.0), (3, 1))), rest, np.zeros((49, 2)))
    grown = settled.covariance(first, np.array([REST]), still, still) - before
    px_per_m = seen_by_opencv(setup, *REST) - seen_by_opencv(setup, REST[0], REST[1] + 1e-3, REST[2])
    metre_per_px = 1e-3 / np.linalg.norm(px_per_m.mean(axis=0))
    assert 1 < np.sqrt(grown[0, 1, 1]) / (0.01 / 7 * metre_per_px) < 3  # and the camera is rotated, too


def test_a_video_that_starts_in_motion_is_refused(setup, seen_by_opencv):
    views = followed(seen_by_opencv, setup, folding(40)[9:])
    with pytest.raises(TrackingError, match="still frames") as caught:
        settle(Camera(setup.lens), Board(), REST, views)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("mount", ["side", "back"])
def test_a_wrong_mount_is_refused_by_its_name(setup, seen_by_opencv, mount):
    views = followed(seen_by_opencv, setup, folding(120), noise_px=0.02)
    with pytest.raises(TrackingError, match=f"mount '{mount}'") as caught:
        settle(Camera(setup.lens, mount=mount, line_s=0.0), Board(), REST, views)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("line_s", "turn_deg"), [(8e-6, (0.0, 0.0)), (3.7e-6, (1.5, -1.0))])
def test_settling_converges_within_its_rounds(setup, seen_by_opencv, monkeypatch, line_s, turn_deg):
    """The constants enter nonlinearly and must converge; the print's offsets, which shrink slowly, need not."""
    askew = replace(setup, board_turn_rad=tuple(np.radians(turn_deg)))
    views = followed(seen_by_opencv, askew, folding(80), noise_px=0.05, line_s=line_s)
    settled = settle(Camera(setup.lens), Board(), REST, views).bundle
    monkeypatch.setattr("straw.tracking.bundle._ROUNDS", 40)
    longer = settle(Camera(setup.lens), Board(), REST, views).bundle
    np.testing.assert_array_equal(settled.theta, longer.theta)
