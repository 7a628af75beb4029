"""The painter paints the scene where an independent formula puts it, with the specified noise."""

from __future__ import annotations

import ast
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import straw.tracking.synthetic
from straw.tracking import brush
from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.errors import TrackingError
from straw.tracking.lens import Lens
from straw.tracking.synthetic import _Scene, camera_looking_at, paint_video
from straw.tracking.video import VideoReader


def still(pose):
    return lambda time_s: tuple(np.full(time_s.shape, value) for value in pose)


def lumas(path):
    with VideoReader(path) as video:
        return np.array([frame.luma.copy() for frame in video.frames()])


def test_the_painter_imports_nothing_of_the_tracker():
    folder = Path(straw.tracking.synthetic.__file__).parent
    for name in ("synthetic.py", "brush.py"):
        tree = ast.parse((folder / name).read_text(encoding="utf-8"))
        modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        tracker = ("lens", "pose", "corners", "follow", "track", "kernels", "edges", "planar")
        assert "straw.tracking.compiled" in modules or "straw.tracking.brush" in modules  # names as they are written
        assert not modules & {f"straw.tracking.{room}" for room in tracker}
        calls = {getattr(node.func, "attr", "") for node in ast.walk(tree) if isinstance(node, ast.Call)}
        assert not calls & {"project", "rays", "project_with_jacobian", "corner_points_m", "locate", "distort"}


def test_times_are_those_of_a_gopro(small_clip):
    assert len(small_clip.time_s) == round(0.22 * 240000 / 1001)
    np.testing.assert_allclose(small_clip.time_s, np.arange(len(small_clip.time_s)) * 1001 / 240000, rtol=1e-12)


def test_each_painted_square_is_where_opencv_projects_it(small, seen_by_opencv, tmp_path):
    pose = (0.016, -0.001, 1.7)
    paint_video(tmp_path / "p.mp4", small, still(pose), 0.02, noise_sigma=0.5, bitrate=40e6)
    picture = lumas(tmp_path / "p.mp4")[-1].astype(float)
    corners = seen_by_opencv(small, *pose).reshape(7, 7, 2)
    middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2
    column, row = np.rint(middles).astype(int).transpose(2, 0, 1)
    i, j = np.indices((6, 6))
    dark = (i + j) % 2 == 0  # the square at -x-y is dark, and so is the next one inwards along the diagonal
    grey = picture[row, column]
    assert grey[dark].max() < 80
    assert grey[~dark].min() > 140
    # and each corner is where four squares meet: the mean of 2 x 2 px around it is half-way between dark and light
    for u, v in corners.reshape(-1, 2):
        assert 90 < picture[int(v) : int(v) + 2, int(u) : int(u) + 2].mean() < 165


def test_the_noise_has_the_specified_strength(small, tmp_path):
    paint_video(tmp_path / "p.mp4", small, still((0.016, 0, 1.6)), 0.04, noise_sigma=4.0, bitrate=400e6)
    spread = lumas(tmp_path / "p.mp4").std(axis=0)[:60, :60]
    # H.264 removes some of the noise even at this rate; over 10 frames the mean deviation is 0.92 sigma
    assert 2.5 < spread.mean() < 4.5


def test_motion_is_blurred_over_the_exposure(small, tmp_path):
    def falling(time_s):
        return np.full(time_s.shape, 0.016), -1.5 * (time_s - 0.008), np.full(time_s.shape, np.pi / 2)

    def sharpness(exposure_s):
        path = tmp_path / "p.mp4"
        paint_video(path, small, falling, 0.013, exposure_s=exposure_s, noise_sigma=0.5, bitrate=40e6)
        return np.abs(np.diff(lumas(path)[2].astype(float)[180:300, 250:400], axis=0)).max()

    # 1.5 m/s x 1/480 s = 3.1 mm = 13 px: an edge of 160 levels over 13 px
    assert sharpness(1 / 480) < 0.5 * sharpness(1 / 50_000)


@pytest.mark.parametrize("place", [(0.15, 0.4, 0.2), (0.08, 1.0, -0.3)])  # the second oblique and at the lens' edge
def test_pixels_painted_by_one_ray_have_the_grey_level_of_all_their_rays(small, monkeypatch, place):
    camera = replace(small, world_from_camera=camera_looking_at((0.035, 0.01, 0.01), *place))
    pictures = []
    for _ in range(2):
        scene = _Scene(
            camera, Board(), still((0.016, 0.0, 1.6)), np.zeros(1), 1 / 480, np.random.default_rng(0), 0.0, 3.7e-6
        )
        picture = np.empty(scene.backdrop.shape, np.uint8)
        scene.paint(picture, 0.0)
        pictures.append(picture.astype(int))
        monkeypatch.setattr(brush, "_even", lambda *_: False)  # then without the shortcut, not compiled
        monkeypatch.setattr(straw.tracking.synthetic, "paint", brush._paint)
    assert np.ptp(pictures[0] - scene.backdrop) > 100  # the board is in the picture
    assert np.abs(pictures[1] - pictures[0]).max() <= 1  # a half rounded up or down


def test_a_camera_looking_at_the_board_has_it_in_the_centre_and_upright():
    pose = camera_looking_at((0.025, 0.0, 0.0), 0.212, np.radians(25), np.radians(10))
    target = np.linalg.inv(pose) @ (0.025, 0, 0, 1)
    np.testing.assert_allclose(target, (0, 0, 0.212, 1), atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert pose[2, 0] == pytest.approx(0)  # image x is level
    assert pose[2, 1] < 0  # image y points down
    assert pose[1, 3] > 0  # a positive azimuth is on the +Y side


def test_the_painter_refuses_what_it_cannot_paint(small, hero6, tmp_path):
    path, tip = tmp_path / "p.mp4", still((0.016, 0, 1.6))
    with pytest.raises(TrackingError, match="world_from_camera"):
        paint_video(path, Camera(hero6), tip, 0.1)
    brown = Lens("brown_conrady", 640, 480, 900, 900, 320, 240, (0.0, 0.0, 0.0, 0.0))
    with pytest.raises(TrackingError, match="fisheye"):
        paint_video(path, replace(small, lens=brown), tip, 0.1)
    with pytest.raises(TrackingError, match="no frame"):
        paint_video(path, small, tip, 0.0, rate=Fraction(60))
    with pytest.raises(TrackingError, match="not finite"):
        paint_video(path, small, still((float("nan"), 0, 1.6)), 0.1)
    assert not list(tmp_path.iterdir())
