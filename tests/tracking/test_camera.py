"""CAMERA.json stores a camera exactly; a malformed one is refused in one line that names file and field."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera, load_camera, save_camera
from straw.tracking.errors import TrackingError


def test_a_saved_camera_is_loaded_exactly(tmp_path, setup):
    camera = replace(setup, tip_offset_m=0.0091, board_x_in_image="left", mount="side", line_s=3.7e-6)
    save_camera(tmp_path / "CAMERA.json", camera)
    again = load_camera(tmp_path / "CAMERA.json")
    assert (again.lens, again.tip_offset_m, again.board_x_in_image) == (camera.lens, 0.0091, "left")
    assert (again.mount, again.line_s) == ("side", 3.7e-6)
    np.testing.assert_array_equal(again.world_from_camera, camera.world_from_camera)
    assert [path.name for path in tmp_path.iterdir()] == ["CAMERA.json"]


def test_a_camera_without_a_pose_is_loaded_without_one(tmp_path, hero6):
    save_camera(tmp_path / "c.json", Camera(hero6))
    assert load_camera(tmp_path / "c.json").world_from_camera is None


def test_a_lens_profile_serves_as_a_camera_without_a_pose(tmp_path):
    profile = {
        "name": "mine",
        "calib_dimension": {"w": 64, "h": 48},
        "fisheye_params": {"camera_matrix": [[50, 0, 32], [0, 50, 24], [0, 0, 1]], "distortion_coeffs": [0, 0, 0, 0]},
    }
    (tmp_path / "p.json").write_text(json.dumps(profile))
    assert load_camera(tmp_path / "p.json").lens.fx == 50


def test_saving_into_a_missing_folder_is_refused_and_leaves_nothing(tmp_path, hero6):
    with pytest.raises(TrackingError, match="cannot write"):
        save_camera(tmp_path / "nowhere" / "c.json", Camera(hero6))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\xff\xfe\x00", b'{"lens": 3}', b"[" * 100_000, b"7"])
def test_a_file_that_is_no_camera_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "c.json"
    path.write_bytes(content)
    with pytest.raises(TrackingError, match=r"c\.json") as caught:
        load_camera(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("where", ["missing.json", "."])
def test_a_file_that_cannot_be_read_is_refused_in_one_line(tmp_path, where):
    with pytest.raises(TrackingError, match="cannot read"):
        load_camera(tmp_path / where)


MIRRORED = np.diag((1.0, 1.0, -1.0, 1.0)).tolist()


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("version",), 99),
        (("format",), "something else"),
        (("lens",), None),
        (("lens", "fx"), "wide"),
        (("lens", "fx"), True),
        (("lens", "fx"), 10**400),
        (("lens", "fx"), float("nan")),
        (("lens", "width"), 1920.5),
        (("lens", "distortion"), [0.1, "a", 0, 0]),
        (("lens", "distortion"), [0.1]),
        (("lens", "kind"), "pinhole"),
        (("tip_offset_m",), 8.8),
        (("board_x_in_image",), "sideways"),
        (("mount",), "top"),
        (("line_s",), 0.004),
        (("world_from_camera",), [[1, 0, 0, 0]] * 3),
        (("world_from_camera",), [[1, 0, 0, 0]] * 4),
        (("world_from_camera",), MIRRORED),
    ],
)
def test_a_wrong_field_is_named_in_one_line(tmp_path, setup, place, value):
    path = tmp_path / "c.json"
    save_camera(path, setup)
    data = json.loads(path.read_text())
    target = data
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(TrackingError, match=f"c.json.*{place[-1]}") as caught:
        load_camera(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(path))


def test_a_frozen_camera_keeps_its_pose(setup):
    with pytest.raises(ValueError, match="read-only"):
        setup.world_from_camera[0, 3] = 1.0


@pytest.mark.parametrize(("squares", "size_m"), [(41, 0.0385), (2, 0.0385), (8, -1.0), (8, float("nan")), (8, 38.5)])
def test_an_impossible_board_is_refused(squares, size_m):
    with pytest.raises(TrackingError, match="board"):
        Board(squares, size_m)


def test_the_papers_board_has_49_corners_4_8125_mm_apart():
    points = Board().corner_points_m()
    assert points.shape == (49, 3)
    np.testing.assert_allclose(points[0], (-3 * 0.0048125, -3 * 0.0048125, 0))
    np.testing.assert_allclose(points[1] - points[0], (0, 0.0048125, 0), atol=1e-12)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-15)
