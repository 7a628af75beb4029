"""A clip's sigmas are estimated from its own corners: they are the scatter of the poses, however corners err."""

from __future__ import annotations

import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.patterns import Patterns
from straw.tracking.pose import Plane, apply
from straw.tracking.variance import FAST, FRESH, MOTION_LIKE, SHIFT, SLOW, Scatter, Seen, kinds, learnt, seen_of

REST = (0.0221, 0.0, 1.53)
SHAPE = (7, 7)
COUNT = 300


def clip(setup, seen_by_opencv, errors, kind):
    """Fits to corners with ``errors`` (f, 49, 2), px, along u and v; the board's edges lie along u and v."""
    truth = np.tile(REST, (len(errors), 1))
    pixels = seen_by_opencv(setup, *REST) + errors
    rays, slopes = setup.lens.rays_with_slopes(pixels.reshape(-1, 2))
    slopes = slopes.reshape(-1, 49, 2, 2)
    plane, points = Plane(setup.lens, setup.world_from_camera), apply(setup.tip_from_board, Board().corner_points_m())
    fits = plane.fit_rays(rays.reshape(-1, 49, 2), slopes, points, truth, np.ones(errors.shape[:2], bool))
    by_pose = plane.slopes(slopes, points, fits.vector)
    across = np.tile(np.array(((0.0, 1.0), (1.0, 0.0))), (len(errors), 1, 1))  # board x is down the picture
    return fits, seen_of(SHAPE, by_pose, fits.residual_px, fits.used, across, kind), fits.vector - truth


def drawn(rng, parts_px, count=COUNT):
    """Errors (f, 49, 2) along u and v with patterns of these sizes: white, along edges, across edges."""
    i, j = (index.ravel() / 6 for index in np.indices(SHAPE))
    near_i, near_j = (np.exp(-np.abs(a[:, None] - a)) for a in (i, j))
    white, edge, line = np.square(parts_px)
    same_i, same_j = i[:, None] == i, j[:, None] == j
    across_x = white * np.eye(49) + edge * same_i * near_j + line * near_i * same_j
    across_y = white * np.eye(49) + edge * near_i * same_j + line * same_i * near_j
    along_x, along_y = (rng.normal(size=(count, 49)) @ np.linalg.cholesky(K).T for K in (across_x, across_y))
    return np.stack((along_y, along_x), axis=-1)


@pytest.mark.parametrize("parts_px", [(0.02, 0.0, 0.0), (0.01, 0.02, 0.0), (0.01, 0.005, 0.02)])
def test_sigmas_are_right_however_the_corners_errors_are_correlated(setup, seen_by_opencv, parts_px):
    kind = np.full(COUNT, FAST)
    fits, seen, error = clip(setup, seen_by_opencv, drawn(np.random.default_rng(3), parts_px), kind)
    claimed = np.diagonal(learnt(SHAPE, seen).of_corners(seen, seen.answer()), axis1=1, axis2=2)
    # 300 draws determine a variance to 8 %; errors smooth over the board are known by the little that no pose explains
    np.testing.assert_allclose((error**2).mean(axis=0) / claimed.mean(axis=0), 1.0, atol=0.3)
    alone = np.diagonal(fits.covariance, axis1=1, axis2=2)
    if parts_px[2] > 0.01:  # residuals as if the corners erred independently
        assert np.all((error**2).mean(axis=0) > 3 * alone.mean(axis=0)[[0, 1, 2]])


def test_sigmas_are_right_where_the_codecs_distortion_looks_like_a_motion(setup, seen_by_opencv):
    """White errors of keyframes and of slow frames; the latter also have a random apparent motion and a shift."""
    rng, kind = np.random.default_rng(5), np.array((FRESH, *[SLOW] * 9) * (COUNT // 10))
    slow, lag_px = (kind == SLOW)[:, None, None], 0.02
    errors = rng.normal(0, 0.006, (COUNT, 49, 2)) + slow * rng.normal(0, 0.008, (COUNT, 49, 2))
    _, seen, _ = clip(setup, seen_by_opencv, errors, kind)
    motion = np.sqrt((MOTION_LIKE[SLOW] - 1) * 0.008**2) * np.linalg.cholesky(np.linalg.inv(seen.normal()))
    by_pose = (seen.slopes.reshape(COUNT, 98, 3) @ motion @ rng.normal(size=(COUNT, 3, 1))).reshape(COUNT, 49, 2)
    along = by_pose[..., ::-1] * slow  # errors along x and y of the board are along v and u of the picture
    shift = rng.normal(0, np.sqrt(SHIFT) * lag_px, (COUNT, 1, 2))
    _, seen, error = clip(setup, seen_by_opencv, errors + along + shift, kind)
    claimed = np.diagonal(learnt(SHAPE, seen, lag_px).covariance(seen), axis1=1, axis2=2)
    for which in (SLOW, FRESH):
        square = (error[kind == which] ** 2).mean(axis=0) / claimed[kind == which].mean(axis=0)
        few = np.count_nonzero(kind == which)
        # the accuracy of a variance from this many draws; the largest residual of three frames raises it by a tenth,
        # the bound by the lag lowers it by a tenth
        np.testing.assert_allclose(square, 1.0, atol=3 * np.sqrt(2 / few))


def test_a_frame_with_a_larger_residual_than_its_kind_has_larger_sigmas(setup, seen_by_opencv):
    errors = drawn(np.random.default_rng(7), (0.01, 0.0, 0.0))
    errors[100] *= 5
    _, seen, _ = clip(setup, seen_by_opencv, errors, np.full(COUNT, FAST))
    scatter = learnt(SHAPE, seen)
    sigma = np.sqrt(scatter.covariance(seen)[:, 1, 1])
    assert sigma[100] == pytest.approx(5 * np.median(sigma), rel=0.35)  # 95 degrees of freedom: 7 %, their median 5 %


def test_a_copied_picture_is_as_uncertain_as_its_neighbours(setup, seen_by_opencv):
    errors = drawn(np.random.default_rng(9), (0.01, 0.0, 0.0))
    errors[100] *= 0.1
    _, seen, _ = clip(setup, seen_by_opencv, errors, np.full(COUNT, SLOW))
    sigma = np.sqrt(learnt(SHAPE, seen, 0.02).covariance(seen)[:, 1, 1])
    assert sigma[100] > 0.8 * np.median(sigma)


def test_frames_are_classified_by_kind():
    speed = np.array((0.1, 0.6, 0.1, np.nan))
    np.testing.assert_array_equal(kinds(np.array((False, False, True, False)), speed), (SLOW, FAST, FRESH, SLOW))


def test_sums_over_pairs_of_corners_are_those_of_their_matrix():
    patterns, rng = Patterns.of((4, 3)), np.random.default_rng(0)
    H = rng.normal(size=(2, 4, 3, 2, 3))
    flat = H.reshape(2, 24, 3)
    for found, K in zip(patterns.between(H), patterns.whole(), strict=True):
        np.testing.assert_allclose(found, flat.transpose(0, 2, 1) @ K @ flat, atol=1e-12)


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_errors_of_corners_at_rest_are_in_proportion_to_the_mean_pictures_residual(share):
    """18 numbers with ``share`` of the variance of one slow picture; a fit of three leaves 15 degrees of freedom."""
    scatter = Scatter((3, 3), np.tile((1.0, 0.0, 0.0), (3, 1)))
    slopes = np.random.default_rng(0).normal(size=(1, 3, 3, 2, 3))
    left = np.full((1, 3, 3, 2), np.sqrt(share * 15 / 18))
    rest = Seen(slopes, left, np.ones((1, 9), bool), np.array([SLOW]))
    mean = np.zeros((3, 3, 2, 1))
    mean[:, :, 0] = 1 / 9
    assert scatter.at_rest(mean, rest)[0, 0] == pytest.approx(share / 9)
