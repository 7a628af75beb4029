"""The still frames place the camera, the motion tells how the board is glued, and neither is guessed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracking.board import Board
from tracking.camera import Camera
from tracking.errors import TrackingError
from tracking.settle import Seen, settle

REST = (0.0221, 0.0, 1.53)


def followed(seen_by_opencv, camera, poses, noise_px=0.0, y_m=0.0):
    """Return what the follower would hand over: corners of each pose and a coarse pose."""
    rng = np.random.default_rng(7)
    return [
        Seen(
            (seen_by_opencv(camera, *pose, y_m) + rng.normal(0, noise_px, (49, 2))).astype(np.float32),
            np.ones(49, bool),
            np.add(pose, (2e-4, -1e-4, 0.01)),
        )
        for pose in poses
    ]


def folding(count: int) -> list[tuple[float, float, float]]:
    """Return ten frames at rest, then the path of a folding run."""
    s = np.linspace(0, 1, count)
    wave = np.sin(9 * s)
    path = zip(REST[0] - 0.0118 * s, REST[1] - 0.0037 * s * wave**2, REST[2] + 0.34 * s * (1 + wave) / 2, strict=True)
    return [REST] * 10 + list(path)


def poses_of(settled) -> np.ndarray:
    return np.array([pose.vector for pose in settled.poses])


def test_the_rest_pose_places_the_camera(setup, seen_by_opencv):
    truth = folding(80)
    settled = settle(Camera(setup.lens), Board(), REST, followed(seen_by_opencv, setup, truth))
    # corners are kept as float32: 6e-5 px near 1000 px, over 49 of them 1e-5 px = 2 nm sideways, 20 nm along the view
    np.testing.assert_allclose(settled.camera.world_from_camera, setup.world_from_camera, atol=1e-5)
    np.testing.assert_allclose(poses_of(settled), truth, atol=2e-6)
    assert 10 <= settled.rest_frames <= 12


def test_a_board_glued_askew_is_found_out_by_its_motion(setup, seen_by_opencv):
    truth = folding(200)
    askew = replace(setup, board_turn_rad=(np.radians(1.5), np.radians(-1.0)))
    seen = followed(seen_by_opencv, askew, truth, noise_px=0.05, y_m=0.001)
    settled = settle(Camera(setup.lens), Board(), REST, seen)
    error = np.array(settled.camera.board_turn_rad) - askew.board_turn_rad
    # independent noise, sigma counts on shared errors: well within; the rest pose's own tilt adds its milliradian
    assert np.all(np.abs(error) < 2e-3), error
    assert np.all(np.array(settled.turn_sigma_rad) < 1e-3)
    # 2 mrad of tilt on 12 mm seen at 25 degrees: 0.05 mm at the far end, if the tilt is missed by that much
    assert np.all(np.abs(poses_of(settled) - truth).max(axis=0) < (8e-5, 8e-5, 4e-3))


def test_taking_an_askew_board_for_square_would_cost_a_part_of_a_millimetre(setup, seen_by_opencv):
    """The reason for finding the turn: without motion it stays at zero, and the same corners give another x."""
    truth = folding(200)
    askew = replace(setup, board_turn_rad=(np.radians(1.5), 0.0))
    seen = followed(seen_by_opencv, askew, truth)
    blind = settle(Camera(setup.lens), Board(), REST, seen[:10])  # rest frames only
    assert abs(blind.camera.board_turn_rad[0]) < 1e-3
    assert blind.turn_sigma_rad[0] == pytest.approx(0.02, rel=0.05)  # it says that it knows nothing


def test_a_video_that_starts_in_motion_is_refused(setup, seen_by_opencv):
    seen = followed(seen_by_opencv, setup, folding(40)[9:])
    with pytest.raises(TrackingError, match="still frames") as caught:
        settle(Camera(setup.lens), Board(), REST, seen)
    assert "\n" not in str(caught.value)
