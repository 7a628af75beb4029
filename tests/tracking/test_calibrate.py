"""A planted lens is recovered within its sigmas; the better model is chosen; too few views are reported."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from straw.tracking.calibrate import _crossed, calibrate, projection_uncertainty
from straw.tracking.errors import TrackingError
from straw.tracking.lens_fit import View, fit_lens


def views_by_opencv(lens, count=12, noise_px=0.05, seed=0, reach=0.25, tilt=0.6):
    """Return views of a 9 x 7 board of 30 mm squares, by cv2.fisheye, that lie entirely in the picture."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(9) - 4, np.arange(7) - 3, indexing="ij")
    points = np.column_stack((i.ravel(), j.ravel(), np.zeros(63)))
    K = np.array(((lens.fx, 0, lens.cx), (0, lens.fy, lens.cy), (0, 0, 1)))
    views = []
    while len(views) < count:
        turn = np.array((*rng.uniform(-tilt, tilt, 2), rng.uniform(-np.pi, np.pi)))
        place = np.array((*rng.uniform(-reach, reach, 2), rng.uniform(0.15, 0.4))) / 0.03
        pixels = cv2.fisheye.projectPoints(points[None], turn, place, K, np.array(lens.distortion))[0].reshape(-1, 2)
        inside = (pixels > 5).all() and (pixels < (lens.width - 6, lens.height - 6)).all()
        if inside:
            views.append(View(points, pixels + rng.normal(0, noise_px, pixels.shape), f"view {len(views)}"))
    return views


def test_a_planted_fisheye_lens_is_recovered_within_its_sigmas(hero6):
    fit = fit_lens("fisheye", (1920, 1080), views_by_opencv(hero6))
    assert fit.rms_px == pytest.approx(0.05, rel=0.1)
    found = np.array((fit.lens.fx, fit.lens.fy, fit.lens.cx, fit.lens.cy))
    miss = found - (hero6.fx, hero6.fy, hero6.cx, hero6.cy)
    assert np.all(np.abs(miss) < 4.5 * np.sqrt(np.diag(fit.covariance)[:4]))
    assert np.all(np.abs(miss) < 0.5)


def test_a_wide_lens_is_distinguished_from_brown_conrady_by_views_left_out(hero6):
    views = views_by_opencv(hero6, noise_px=0.03)
    fits = {kind: fit_lens(kind, (1920, 1080), views) for kind in ("fisheye", "brown_conrady")}
    crossed = {kind: _crossed(fit, views) for kind, fit in fits.items()}
    assert crossed["fisheye"] < 0.04
    assert crossed["brown_conrady"] > 2 * crossed["fisheye"]


def test_the_uncertainty_grows_where_no_board_was(hero6):
    central = fit_lens("fisheye", (1920, 1080), views_by_opencv(hero6, reach=0.02))
    all_over = fit_lens("fisheye", (1920, 1080), views_by_opencv(hero6))
    (_, few), (_, many) = projection_uncertainty(central), projection_uncertainty(all_over)
    assert few[0, 0] > 3 * few[9, 16]
    assert many[0, 0] < few[0, 0]


def test_real_stills_of_one_camera_calibrate_with_a_note_that_they_are_few(realdata):
    paths = sorted((realdata / "caliscope_chess9x6").glob("cam_0_*.jpg"))
    found = calibrate([path for path in paths if "_000" not in path.name])
    assert found.fit.rms_px < 0.6
    assert any("too few" in line for line in found.advice)


def test_a_still_given_twice_and_its_copy_count_once(realdata, tmp_path):
    paths = [path for path in sorted((realdata / "caliscope_chess9x6").glob("cam_0_*.jpg")) if "_000" not in path.name]
    copy = tmp_path / "copy.jpg"
    copy.write_bytes(paths[0].read_bytes())
    found = calibrate([*paths, paths[0], copy])
    assert len({view.source for view in found.views}) == len(found.views)
    assert f"2 of {len(paths) + 2} files hold the same as another and were left out" in found.advice


def test_pictures_of_two_sizes_or_without_boards_are_refused_in_one_line(tmp_path):
    flat = np.full((240, 320), 127, np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), flat)
    cv2.imwrite(str(tmp_path / "b.png"), flat[:200])
    (tmp_path / "c.png").write_bytes(b"")
    for names, says in (
        (["a", "b"], "320x200"),
        (["a", "a"], "0 checkerboards in 2"),
        (["c"], "not a readable picture"),
    ):
        with pytest.raises(TrackingError, match=says) as caught:
            calibrate([tmp_path / f"{name}.png" for name in names])
        assert "\n" not in str(caught.value)


def test_the_fit_does_not_depend_on_where_it_starts(hero6):
    views = views_by_opencv(replace(hero6, fx=1500.0, fy=1500.0), reach=0.1)
    assert fit_lens("fisheye", (1920, 1080), views).lens.fx == pytest.approx(1500, abs=2)


def test_a_view_that_no_lens_explains_loses_its_corners_without_a_warning(hero6):
    views = views_by_opencv(hero6)
    far_off = np.random.default_rng(0).normal(0.0, 40.0, views[0].pixels.shape)  # px, as for false corners
    nonsense = View(views[0].points, views[0].pixels + far_off, "nonsense")
    fit = fit_lens("fisheye", (1920, 1080), [*views, nonsense])
    assert fit.inliers[-1] < 16 <= fit.inliers[:-1].min()
    assert fit.lens.fx == pytest.approx(hero6.fx, abs=2)
