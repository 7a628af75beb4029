"""Exposure and the codec's lag are estimated from the video itself, and the lag is corrected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.noise import Frames, exposure_by_smear, lag_of, lag_share, of_rate, off_chord, without_lag
from straw.tracking.pose import Plane, apply, world_from_tip
from straw.tracking.synthetic import camera_looking_at, paint_video
from straw.tracking.track import track
from straw.tracking.views import chords
from tests.tracking.test_track import REST

PERIOD_S = 1001 / 240000


def frames(count=400, exposure_s=1 / 480, lag_px=0.02, seed=0) -> Frames:
    """Frames at rest, then moving at up to 8 px a frame; the picture lags except at keyframes, every 20th."""
    rng = np.random.default_rng(seed)
    speed = np.where(np.arange(count) < 40, 0.0, rng.uniform(0.05, 8, count) ** 2 / 8) / PERIOD_S
    sweep = np.column_stack((speed, 0.3 * speed))
    widths = np.sqrt(1.2**2 + (sweep * exposure_s) ** 2 / 2.4) * rng.normal(1, 0.02, (count, 2))
    key = np.arange(count) % 20 == 0
    jump = np.where(key, lag_px * lag_share(speed * PERIOD_S), 0) + rng.normal(0, 0.004, count)
    middle = np.column_stack((np.cumsum(speed) * PERIOD_S, np.zeros(count)))
    return Frames(middle, widths, sweep, key, jump, speed * PERIOD_S, np.full(count, np.nan), np.full(count, 0.007))


@pytest.mark.parametrize("exposure_s", [1 / 1000, 1 / 480, 1 / 250])
def test_the_exposure_is_estimated_from_the_motion_blur(exposure_s):
    assert exposure_by_smear(frames(exposure_s=exposure_s), PERIOD_S) == pytest.approx(exposure_s, rel=0.1)


def test_a_board_that_hardly_moves_gives_no_exposure():
    calm = frames()
    assert exposure_by_smear(replace(calm, sweep=calm.sweep * 0.01), PERIOD_S) == 0.0


def test_the_codecs_lag_is_estimated_from_the_jumps_at_keyframes():
    none, some, more = (lag_of(frames(count=4000, lag_px=lag)) for lag in (0.0, 0.02, 0.05))
    assert none < 0.003
    assert some == pytest.approx(0.02, rel=0.2)
    assert more == pytest.approx(0.05, rel=0.2)


def test_without_keyframes_in_motion_no_lag_is_corrected():
    calm = frames()
    assert lag_of(replace(calm, key=calm.key & False)) == 0


def test_the_lag_is_corrected_along_the_motion(setup, seen_by_opencv):
    truth = np.array([(0.02, 4e-5 * k, 1.55) for k in range(30)])  # down the picture, by 0.17 px a frame
    ahead = seen_by_opencv(setup, 0.02, 4e-5, 1.55) - seen_by_opencv(setup, 0.02, 0, 1.55)
    speed_px = np.sqrt((ahead**2).mean())
    late = 0.02 * lag_share(speed_px) * ahead / speed_px
    pixels = np.array([seen_by_opencv(setup, *pose) for pose in truth]) - late
    pixels += np.random.default_rng(0).normal(0, 0.002, pixels.shape)
    rays, slopes = setup.lens.rays_with_slopes(pixels.reshape(-1, 2))
    points = apply(setup.tip_from_board, Board().corner_points_m())
    plane, slopes = Plane(setup.lens, setup.world_from_camera), slopes.reshape(30, 49, 2, 2)
    fits = plane.fit_rays(rays.reshape(30, 49, 2), slopes, points, truth, np.ones((30, 49), bool))
    rate, eye_m = np.gradient(truth, axis=0), setup.world_from_camera[(0, 2), 3]
    by_pose = plane.slopes(slopes, points, fits.vector)
    found, left = without_lag(fits, by_pose, rate, np.zeros(30, bool), 0.02, eye_m)
    # 0.02 px of lag are 5 um here; 0.002 px of noise in 49 corners, 0.24 mm a pixel: 0.07 um, and some more along X
    assert np.median(truth[:, 1] - fits.vector[:, 1]) > 3e-6
    assert np.all(np.abs(np.median(found - truth, axis=0)) < (1e-6, 3e-7, 3e-5))
    # half of the lag may be left, or half too much corrected; the board moves by 40 um a frame
    assert np.sqrt(np.median(left[:, 1, 1])) == pytest.approx(0.02 / 2 * 4e-5 / speed_px, rel=0.1)
    keyframes, sure = without_lag(fits, by_pose, rate, np.ones(30, bool), 0.02, eye_m)
    np.testing.assert_array_equal(keyframes, fits.vector)
    assert not sure.any()


def test_sigmas_are_right_where_the_codec_keeps_or_drops_changes_at_random(setup, seen_by_opencv):
    """A board that comes down by 0.17 px a frame, of which every other picture on average lags by 0.02 px."""
    rng, count = np.random.default_rng(2), 200
    truth = np.array([(0.02, 4e-5 * k, 1.55) for k in range(count)]) - (0, 4e-5 * count / 2, 0)
    ahead = seen_by_opencv(setup, 0.02, 4e-5, 1.55) - seen_by_opencv(setup, 0.02, 0, 1.55)
    speed_px, dropped = np.sqrt((ahead**2).mean()), rng.integers(0, 2, count)
    late = 0.02 * dropped[:, None, None] * ahead / speed_px
    pixels = np.array([seen_by_opencv(setup, *pose) for pose in truth]) - late
    rays, slopes = setup.lens.rays_with_slopes(pixels.reshape(-1, 2))
    points = apply(setup.tip_from_board, Board().corner_points_m())
    plane, slopes = Plane(setup.lens, setup.world_from_camera), slopes.reshape(count, 49, 2, 2)
    fits = plane.fit_rays(rays.reshape(count, 49, 2), slopes, points, truth, np.ones((count, 49), bool))
    by_pose, rate = plane.slopes(slopes, points, fits.vector), np.gradient(truth, axis=0)
    eye_m = setup.world_from_camera[(0, 2), 3]
    found, left = without_lag(fits, by_pose, rate, np.zeros(count, bool), 0.02, eye_m)
    # a lag of all or nothing has a variance of a quarter; the correction is not exactly a half, which adds a little
    squared = ((found - truth)[:, 1] ** 2).mean() / left[:, 1, 1].mean()
    assert squared == pytest.approx(4 * np.mean((lag_share(speed_px) - dropped) ** 2), rel=0.1)
    assert 0.9 < squared < 1.4


def test_sigmas_are_right_where_the_rolling_shutter_is_corrected_with_a_wrong_velocity(setup, seen_by_opencv):
    """A velocity with a random error of 40 px/s in each direction; rows 4 us apart."""
    rng, count, pose = np.random.default_rng(3), 300, (0.0221, 0.0, 1.53)
    pixels = np.tile(seen_by_opencv(setup, *pose), (count, 1, 1))
    late_s = 4e-6 * (pixels[..., 1] - pixels[..., 1].mean(axis=1, keepdims=True))
    pixels = pixels + late_s[..., None] * rng.normal(0, 40.0, (count, 1, 2))
    rays, slopes = setup.lens.rays_with_slopes(pixels.reshape(-1, 2))
    points, slopes = apply(setup.tip_from_board, Board().corner_points_m()), slopes.reshape(count, 49, 2, 2)
    plane, truth = Plane(setup.lens, setup.world_from_camera), np.tile(pose, (count, 1))
    fits = plane.fit_rays(rays.reshape(count, 49, 2), slopes, points, truth, np.ones((count, 49), bool))
    claimed = of_rate(fits, plane.slopes(slopes, points, fits.vector), late_s, np.full(count, 40.0))
    squared = ((fits.vector - truth) ** 2).mean(axis=0) / np.diagonal(claimed, axis1=1, axis2=2).mean(axis=0)
    np.testing.assert_allclose(squared, 1.0, atol=3 * np.sqrt(2 / count))  # the accuracy of a variance from the draws


def test_a_size_that_lags_is_corrected_whatever_the_boards_displacement(hero6):
    """Seen from above, the board approaches by 0.05 px rms a frame and shifts by 0.5: its size lags by 0.6."""
    above = Camera(hero6, camera_looking_at((0.0251, 0, 0), 0.212, 0.0, np.radians(25)))
    eye_m = above.world_from_camera[(0, 2), 3]
    sight = (eye_m - (0.02, 0.0)) / np.linalg.norm(eye_m - (0.02, 0.0))
    across = np.array((-sight[1], sight[0]))
    place = np.array((0.02, 0.0)) + np.arange(12)[:, None] * (2.5e-4 * sight + 1e-4 * across)
    truth = np.column_stack((place, np.full(12, 1.55)))
    points = apply(above.tip_from_board, Board().corner_points_m())
    pixels = np.array([seen_from(above, pose, points) for pose in truth])
    shape = pixels - pixels.mean(axis=1, keepdims=True)
    growth = np.gradient(shape, axis=0)
    growth_px = np.sqrt((growth**2).mean(axis=(1, 2), keepdims=True))
    late = pixels - 0.6 * 0.02 * growth_px / (growth_px + 0.02) * growth / growth_px
    rays, slopes = hero6.rays_with_slopes(late.reshape(-1, 2))
    plane, slopes = Plane(hero6, above.world_from_camera), slopes.reshape(12, 49, 2, 2)
    fits = plane.fit_rays(rays.reshape(12, 49, 2), slopes, points, truth, np.ones((12, 49), bool))
    rate, key = np.gradient(truth, axis=0), np.zeros(12, bool)
    found, _ = without_lag(fits, plane.slopes(slopes, points, fits.vector), rate, key, 0.02, eye_m)
    behind = (truth - fits.vector)[:, :2] @ sight
    assert np.all(behind > 20e-6)
    # a shifted board is also seen from another angle: its change of shape is not only a change of size
    assert np.all(np.abs((truth - found)[:, :2] @ sight) < 0.15 * behind)


def swaying(setup, seen_by_opencv, share):
    """Corners of a board that oscillates slowly along the line of sight; in B pictures, two in three, a share of the
    corners is the mean of the neighbouring pictures. Fits, slopes, chords, truth, and which are B pictures."""
    rng, k = np.random.default_rng(4), np.arange(90)
    truth = np.column_stack((0.02 + 3e-4 * np.sin(0.5 * k), np.zeros(90), np.full(90, 1.55)))
    pixels = np.array([seen_by_opencv(setup, *pose) for pose in truth]) + rng.normal(0, 0.03, (90, 49, 2))
    between = k % 3 != 0
    for b in np.flatnonzero(between[:-2]):
        first = b - b % 3
        line = pixels[first] + (pixels[first + 3] - pixels[first]) * (b - first) / 3
        pixels[b] = np.where(rng.random((49, 1)) < share, line, pixels[b])
    rays, slopes = setup.lens.rays_with_slopes(pixels.reshape(-1, 2))
    points = apply(setup.tip_from_board, Board().corner_points_m())
    plane, slopes = Plane(setup.lens, setup.world_from_camera), slopes.reshape(90, 49, 2, 2)
    fits = plane.fit_rays(rays.reshape(90, 49, 2), slopes, points, truth, np.ones((90, 49), bool))
    chord_px = chords(pixels, k * PERIOD_S, np.ones(90, bool), between)
    return fits, plane.slopes(slopes, points, fits.vector), chord_px, truth, between


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_sigma_of_a_b_picture_that_is_the_mean_of_its_neighbours_is_not_too_small(setup, seen_by_opencv, share):
    fits, by_pose, chord_px, truth, between = swaying(setup, seen_by_opencv, share)
    toward, chord = off_chord(fits, by_pose, chord_px, np.ones(90, bool))
    B = np.flatnonzero(between[6:-6]) + 6
    plain_sigma = np.sqrt(fits.covariance[B, 0, 0])
    sigma = np.sqrt(fits.covariance[B, 0, 0] + chord[B, 0, 0])
    before = np.abs(fits.vector - truth)[B, 0]
    after = np.abs(fits.vector + toward - truth)[B, 0]
    if share == 1.0:
        assert (before / plain_sigma).max() > 6  # the turning point is cut short by 70 um, which no residual shows
    assert (after / sigma).max() < 4
    np.testing.assert_array_equal(toward[~between], 0.0)


def test_a_b_picture_in_fast_motion_is_not_corrected(setup, seen_by_opencv):
    fits, by_pose, chord_px, *_ = swaying(setup, seen_by_opencv, 0.0)
    toward, chord = off_chord(fits, by_pose, chord_px, np.zeros(90, bool))
    assert not toward.any()
    assert not chord.any()


def seen_from(camera, pose, points):
    """Corners (49, 2), px, of points of the tip frame."""
    to_camera = np.linalg.inv(camera.world_from_camera) @ world_from_tip(*pose)
    return camera.lens.project(apply(to_camera, points))


def test_the_amplitude_of_a_snap_is_not_reduced_by_a_full_exposure(small, tmp_path):
    """For an exposure T the middle of the blur is off by a T^2 / 24: at up to 49 m/s^2, 24 um RMS if uncorrected."""

    def ringing(time_s):
        since = np.clip(np.asarray(time_s) - 0.05, 0, None)
        return REST[0] + 0 * since, 0.004 * (1 - np.cos(2 * np.pi * 25 * since)) / 2, REST[2] + 0 * since

    paint_video(tmp_path / "v.mp4", small, ringing, 0.3, exposure_s=1 / 245, bitrate=20e6)
    found = track(tmp_path / "v.mp4", replace(small, line_s=0.0), Board())
    assert found.exposure_s == pytest.approx(1 / 245, rel=0.15)
    assert found.trace.valid[1:].all()  # the first search may have to be repeated
    miss = (found.trace.z_m - ringing(found.trace.time_s)[1])[found.trace.valid]
    assert np.sqrt(np.mean(miss**2)) < 12e-6  # the codec's lag: 0.03 px at 0.24 mm


def test_a_copied_picture_is_as_uncertain_along_the_motion_as_those_beside_it(setup, seen_by_opencv):
    """A board that comes down by 0.02 px a frame; one picture is a copy, from which its rate would be sideways."""
    truth = np.array([(0.02, 5e-6 * k, 1.55) for k in range(9)])
    pixels = np.array([seen_by_opencv(setup, *pose) for pose in truth])
    rays, slopes = setup.lens.rays_with_slopes(pixels.reshape(-1, 2))
    points = apply(setup.tip_from_board, Board().corner_points_m())
    plane, slopes = Plane(setup.lens, setup.world_from_camera), slopes.reshape(9, 49, 2, 2)
    fits = plane.fit_rays(rays.reshape(9, 49, 2), slopes, points, truth, np.ones((9, 49), bool))
    by_pose, key, eye_m = (
        plane.slopes(slopes, points, fits.vector),
        np.arange(9) == 0,
        setup.world_from_camera[(0, 2), 3],
    )
    rate = np.gradient(truth, axis=0)
    _, plain = without_lag(fits, by_pose, rate, key, 0.02, eye_m)
    rate[8] = 1e-8, 0.0, 0.0
    _, copied = without_lag(fits, by_pose, rate, key, 0.02, eye_m)
    assert copied[8, 1, 1] > plain[8, 1, 1] / 3
    assert not copied[0].any()
    np.testing.assert_allclose(copied[2:7], plain[2:7])
