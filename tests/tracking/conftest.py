"""Shared by the tracking tests: the GoPro's lens, a set-up, painted clips, and corners by OpenCV's own formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.lens import Lens, shipped_lens
from straw.tracking.synthetic import camera_looking_at, paint_video

REST = (0.0221, 0.0, 1.53)  # straw deployed: x_m, z_m, phi_rad
STILL_S = 0.1


def snap(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rest, then one cell snaps shut and rings: about 0.25 m/s and 7 rad/s at the fastest."""
    since = np.clip(np.asarray(time_s) - STILL_S, 0, None)
    swing = 1 - np.exp(-since / 0.03) * np.cos(2 * np.pi * 12 * since)
    turn = 1 - np.exp(-since / 0.05) * np.cos(2 * np.pi * 9 * since)
    return REST[0] - 0.004 * swing, REST[1] - 0.0012 * swing, REST[2] + 0.12 * turn


@dataclass(frozen=True)
class Clip:
    path: Path
    camera: Camera  # with the true world_from_camera
    time_s: np.ndarray
    motion: Callable = snap
    rest: tuple[float, float, float] = REST


@pytest.fixture(scope="session")
def hero6() -> Lens:
    return shipped_lens("gopro_hero6_wide_1080p240")


@pytest.fixture(scope="session")
def setup(hero6: Lens) -> Camera:
    """The paper's set-up: 212 mm from the board, 25 degrees to its side."""
    return Camera(hero6, camera_looking_at((0.0251, 0, 0), 0.212, np.radians(25), 0.0))


@pytest.fixture(scope="session")
def small(setup: Camera) -> Camera:
    """The same camera, cropped to 640 x 480 around its axis: fast to paint and decode."""
    lens = replace(setup.lens, width=640, height=480, cx=319.2, cy=240.4, name="cropped")
    return replace(setup, lens=lens)


@pytest.fixture(scope="session")
def clip(setup: Camera, tmp_path_factory: pytest.TempPathFactory) -> Clip:
    path = tmp_path_factory.mktemp("clip") / "snap.mp4"
    return Clip(path, setup, paint_video(path, setup, snap, 0.27, seed=1))


@pytest.fixture(scope="session")
def small_clip(small: Camera, tmp_path_factory: pytest.TempPathFactory) -> Clip:
    path = tmp_path_factory.mktemp("clip") / "small.mp4"
    return Clip(path, small, paint_video(path, small, snap, 0.22, seed=2, bitrate=15e6))


@pytest.fixture(scope="session")
def seen_by_opencv() -> Callable[..., np.ndarray]:
    """Corners (49, 2) px of a board with its tip at a pose, by cv2.fisheye and a rotation written out here."""

    def corners(camera: Camera, x_m: float, z_m: float, phi_rad: float, y_m: float = 0.0) -> np.ndarray:
        pitch = Board().pitch_m
        glued, _ = cv2.Rodrigues(np.array((camera.board_turn_rad[0], 0.0, camera.board_turn_rad[1])))
        tilt, _ = cv2.Rodrigues(np.array((0.0, phi_rad, 0.0)))  # the tip axis turns from Z towards X: about Y
        board = pitch * np.array([(i, j, 0) for i in range(-3, 4) for j in range(-3, 4)])
        world = (board @ glued.T + (0, 0, camera.tip_offset_m)) @ tilt.T + (x_m, y_m, z_m)
        from_world = np.linalg.inv(camera.world_from_camera)
        turn, _ = cv2.Rodrigues(from_world[:3, :3])
        lens = camera.lens
        K = np.array(((lens.fx, 0, lens.cx), (0, lens.fy, lens.cy), (0, 0, 1)))
        pixels, _ = cv2.fisheye.projectPoints(world[None], turn, from_world[:3, 3], K, np.array(lens.distortion))
        return pixels.reshape(-1, 2)

    return corners


@pytest.fixture(scope="session")
def realdata() -> Path:
    folder = Path(__file__).parents[3] / "shared" / "realdata"
    if not folder.is_dir():
        pytest.skip(f"the real recordings are not beside this checkout ({folder})")
    return folder
