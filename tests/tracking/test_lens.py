"""The lens projects and un-projects by OpenCV's formulas, and refuses invalid parameters in one line."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from straw.tracking.errors import TrackingError
from straw.tracking.lens import Lens, load_lens, shipped_lens

BROWN = Lens("brown_conrady", 1280, 720, 900.0, 905.0, 640.0, 355.0, (-0.25, 0.08, 0.001, -0.0007, -0.01))


def cloud(seed: int, spread: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack((rng.uniform(-spread, spread, (200, 2)), rng.uniform(0.8, 1.2, 200)))


def matrix(lens: Lens) -> np.ndarray:
    return np.array(((lens.fx, 0, lens.cx), (0, lens.fy, lens.cy), (0, 0, 1)))


def test_the_shipped_lens_is_that_of_the_papers_gopro():
    lens = shipped_lens("gopro_hero6_wide_1080p240")
    assert (lens.kind, lens.width, lens.height) == ("fisheye", 1920, 1080)
    assert lens.rms_px == pytest.approx(0.476, abs=1e-3)


def test_a_ray_45_degrees_off_axis_lands_where_computed_by_hand():
    lens = Lens("fisheye", 1000, 1000, 400.0, 500.0, 500.0, 480.0, (0.1, -0.05, 0.02, -0.01))
    t = math.pi / 4
    bent = t + 0.1 * t**3 - 0.05 * t**5 + 0.02 * t**7 - 0.01 * t**9
    # 45 degrees in the direction of +x only, then of +y only
    np.testing.assert_allclose(lens.project([(2, 0, 2), (0, 3, 3)]), [(500 + 400 * bent, 480), (500, 480 + 500 * bent)])


def test_fisheye_agrees_with_opencv_all_over_the_picture(hero6):
    points = cloud(1, 0.9)
    expected, _ = cv2.fisheye.projectPoints(
        points[None], np.zeros(3), np.zeros(3), matrix(hero6), np.array(hero6.distortion)
    )
    np.testing.assert_allclose(hero6.project(points), expected.reshape(-1, 2), atol=1e-8)


def test_brown_conrady_agrees_with_opencv():
    points = cloud(2, 0.5)
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix(BROWN), np.array(BROWN.distortion))
    np.testing.assert_allclose(BROWN.project(points), expected.reshape(-1, 2), atol=1e-8)


@pytest.mark.parametrize("kind", ["fisheye", "brown_conrady"])
def test_every_pixel_maps_to_a_ray_and_back(hero6, kind):
    lens = hero6 if kind == "fisheye" else BROWN
    u, v = np.meshgrid(np.linspace(0, lens.width - 1, 21), np.linspace(0, lens.height - 1, 13))
    pixels = np.column_stack((u.ravel(), v.ravel()))
    rays = lens.rays(pixels)
    np.testing.assert_allclose(lens.project(np.column_stack((rays, np.ones(len(rays))))), pixels, atol=1e-5)


@pytest.mark.parametrize("kind", ["fisheye", "brown_conrady"])
def test_the_jacobian_is_the_derivative_of_the_projection(hero6, kind):
    lens, h = (hero6 if kind == "fisheye" else BROWN), 1e-6
    points = np.vstack((cloud(3, 0.4), [(0, 0, 1.0), (1e-6, 0, 1.0)]))  # on the axis the formula is 0/0
    _, jacobian = lens.project_with_jacobian(points)
    for axis in range(3):
        step = h * np.eye(3)[axis]
        slope = (lens.project(points + step) - lens.project(points - step)) / (2 * h)
        # central differences of pixels near 1000: rounding 1e-13 * 1000 / 1e-6 = 1e-4 px/m
        np.testing.assert_allclose(jacobian[:, :, axis], slope, atol=1e-3)


def test_a_point_behind_the_camera_has_no_pixel_and_a_pixel_beyond_the_lens_no_ray(hero6):
    assert np.isnan(hero6.project([(0.1, 0.1, -1.0), (0.1, 0.1, 0.0)])).all()
    assert np.isnan(hero6.rays([(50_000.0, 0.0)])).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kind": "pinhole"}, "fisheye"),
        ({"distortion": (0.1,)}, "distortion"),
        ({"fx": -5.0}, "positive"),
        ({"fx": math.nan}, "finite"),
        ({"cx": 5000.0}, "off the"),
        ({"width": 0}, "size"),
    ],
)
def test_an_impossible_lens_is_refused_in_one_line(hero6, change, says):
    with pytest.raises(TrackingError, match=says) as caught:
        replace(hero6, **change)
    assert "\n" not in str(caught.value)


def test_an_unknown_lens_names_the_known_ones():
    with pytest.raises(TrackingError, match="gopro_hero6_wide_1080p240"):
        shipped_lens("hero99")


def test_a_stretched_or_foreign_profile_is_refused(tmp_path):
    for change in ({"input_horizontal_stretch": 1.33}, {"distortion_model": "poly5"}):
        path = tmp_path / "profile.json"
        profile = {"fisheye_params": {"camera_matrix": np.eye(3).tolist(), "distortion_coeffs": [0, 0, 0, 0]}}
        path.write_text(json.dumps({**profile, "calib_dimension": {"w": 64, "h": 48}, **change}))
        with pytest.raises(TrackingError, match="it must be"):
            load_lens(path)


def test_every_real_gopro_profile_is_read_or_refused_with_a_reason(realdata):
    for path in sorted((realdata / "hero6_lens_profiles").glob("*.json")):
        assert load_lens(path).kind == "fisheye"
