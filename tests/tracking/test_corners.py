"""Corners are found on real boards, refined to their true positions, and distinguished from false corners."""

from __future__ import annotations

import time
from dataclasses import replace

import cv2
import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.corners import Print, Sighting, find_boards, moved_by
from straw.tracking.edges import measure_all
from straw.tracking.kernels import locate_all
from straw.tracking.lens import Lens
from straw.tracking.sharpen import FEWEST_CORNERS
from straw.tracking.video import VideoReader

FLAT = Lens("brown_conrady", 240, 240, 200.0, 200.0, 120.0, 120.0, (0.0, 0.0, 0.0, 0.0))


def drawn(pitch: float = 20.3, turn: float = 0.2, smear: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return a supersampled picture of an 8 x 8 board and its true corners (7, 7, 2), x down and y right.

    ``smear``: length of a horizontal motion blur in px.
    """
    fine = 8
    cos, sin = np.cos(turn), np.sin(turn)
    row, column = (np.mgrid[0 : 240 * fine, 0 : 240 * fine] + 0.5) / fine - 0.5 - 119.3
    x, y = (row * cos + column * sin) / pitch, (column * cos - row * sin) / pitch
    inside = np.maximum(abs(x), abs(y)) < 4
    grey = np.where(inside & ((np.floor(x) + np.floor(y)) % 2 == 0), 50.0, 200.0)
    if smear:
        grey = cv2.blur(grey, (round(smear * fine) | 1, 1))
    picture = cv2.resize(grey, (240, 240), interpolation=cv2.INTER_AREA)
    i, j = np.meshgrid(np.arange(-3, 4), np.arange(-3, 4), indexing="ij")
    down, right = pitch * (i * cos - j * sin) + 119.3, pitch * (i * sin + j * cos) + 119.3
    return np.round(picture).astype(np.uint8), np.stack((right, down), axis=-1)


def near(truth: np.ndarray, printed: Print) -> np.ndarray:
    """Return the homography of the true corners."""
    rays = (truth.reshape(-1, 2) - 120) / 200
    return cv2.findHomography(printed.points, rays)[0].ravel()


@pytest.fixture(scope="module")
def printed() -> Print:
    return Print(Board(), FLAT)


def seen_near(printed: Print, picture: np.ndarray, truth: np.ndarray, shift=(0.0, 0.0), sign=1.0):
    H = near(truth, printed)
    return printed.sharpen(picture, moved_by(H / H[8], np.array(shift)), None, sign)


def test_one_step_converges_on_edges_narrower_than_the_model(printed):
    picture, truth = drawn()
    H = near(truth, printed)
    where = np.empty((49, 8))
    locate_all(moved_by(H / H[8], np.array((0.01, -0.006))), FLAT.packed, printed.points, where)  # 0.2 px off
    pixels, explained, used = np.empty((49, 2)), np.empty(49), np.empty(49, np.bool_)
    i, j = np.indices((7, 7))
    parity = np.where((i + j) % 2 == 0, 1.0, -1.0).ravel()
    measure_all(picture, where, parity, np.full(2, 0.7), 1, pixels, explained, used)
    off, left = where[:, :2] - truth.reshape(-1, 2), pixels - truth.reshape(-1, 2)
    # An edge one pixel wide: a step with the model's own width would overshoot by a fifth. Pixel sampling displaces a
    # corner by 0.012 px rms, see ``edges``; the mean of 49 by a seventh of that.
    assert np.abs(left.mean(axis=0)).max() < 3 * 0.012 / 7
    assert np.hypot(*off.mean(axis=0)) > 0.2


@pytest.mark.parametrize("smear", [0.0, 6.0, 14.0])
def test_corners_are_refined_to_their_true_positions(printed, smear):
    picture, truth = drawn(smear=smear)
    found = seen_near(printed, picture, truth, (0.2, -0.15))
    assert isinstance(found, Sighting)
    # Rounding to whole grey levels: 0.29 of 150, an edge of 20 px with slope 150/px: 2e-3 / sqrt(20) px. What is left
    # is the misfit of a smooth step to a box-filtered edge, a few hundredths of its width.
    assert np.abs(found.grid - truth)[found.used].max() < 0.03 + 0.005 * smear
    assert found.used.sum() >= 42
    assert found.contrast > 0


def test_a_blur_of_seven_tenths_of_a_square_is_measured_from_the_edge_widths(printed):
    picture, truth = drawn(turn=0.0, smear=14.0)
    found = seen_near(printed, picture, truth)
    assert found.widths[1] > 4 * found.widths[0]  # edges across y, which runs right, are smeared


def test_a_grid_that_leaves_the_picture_is_refused(printed):
    picture, truth = drawn()
    assert isinstance(seen_near(printed, picture, truth + np.array((150, 0))), str)


@pytest.mark.parametrize("shift", [(1, 1), (1, -1), (2, 0), (0, -2)])
def test_a_grid_slipped_by_a_square_is_refused(printed, shift):
    picture, truth = drawn()
    assert isinstance(seen_near(printed, picture, truth, shift), str)
    H = near(truth, printed)
    H = printed.shifted(picture, moved_by(H / H[8], np.array(shift, float)), 1.0)
    assert np.abs(printed.sharpen(picture, H, None, 1.0).grid - truth).max() < 0.1  # and corrected


def test_black_for_white_is_refused(printed):
    picture, truth = drawn()
    assert seen_near(printed, picture, truth, sign=-1.0) == "black and white are swapped"
    turned = np.ascontiguousarray(np.rot90(picture))
    quarter = np.rot90(truth, axes=(0, 1))[..., ::-1] * (1, -1) + (0, 239)
    assert isinstance(seen_near(printed, turned, quarter, sign=0.0), Sighting)


def test_covered_corners_are_not_used_and_the_others_are_unaffected(printed):
    picture, truth = drawn()
    picture[:, :110] = 125
    found = seen_near(printed, picture, truth, sign=0.0)
    assert isinstance(found, Sighting)
    assert FEWEST_CORNERS <= found.used.sum() < 35
    assert not found.used[truth[..., 0] < 108].any()
    assert np.abs(found.grid - truth)[found.used].max() < 0.1


def test_fewer_than_sixteen_corners_are_no_board(printed):
    picture, truth = drawn()
    picture[:, :150] = 125
    assert seen_near(printed, picture, truth, sign=0.0) == "too few corners to trust"


@pytest.mark.parametrize("shrunk", [1, 2, 3])
def test_a_board_is_found_anywhere_and_oriented(printed, shrunk):
    picture, truth = drawn()
    room = max(int(0.9 * shrunk * 950_000**0.5) - picture.shape[0], 0) if shrunk > 1 else 0
    picture = np.pad(picture, ((0, room), (0, room)), constant_values=125)
    (grid,) = find_boards(picture)
    laid = [printed.lay(picture, grid, turn, 0.0) for turn in range(4)]
    errors = [np.abs(seen.grid - truth).max() for seen in laid if isinstance(seen, Sighting)]
    assert len(errors) == 4  # looks the same in four orientations, in two of them with black and white swapped
    assert min(errors) < 0.05
    assert sum(seen.contrast > 0 for seen in laid) == 2


def test_a_partly_visible_board_is_located_correctly(printed):
    picture, truth = drawn(turn=0.05)
    cut = picture[:, 78:].copy()
    lens = replace(FLAT, width=cut.shape[1], cx=120.0 - 78)
    cut_print = Print(Board(), lens)
    (grid,) = find_boards(cut)
    assert grid.shape[:2] != (7, 7)
    errors = []
    for turn in range(4):
        seen = cut_print.lay(cut, grid, turn, 0.0)
        if isinstance(seen, Sighting):
            errors.append(np.abs(seen.grid - truth + np.array((78, 0)))[seen.used].max())
    assert min(errors) < 0.1


def test_no_board_is_found_in_bright_noise_and_the_search_is_short():
    noise = np.random.default_rng(1).normal(200, 20, (1080, 1920)).clip(0, 255).astype(np.uint8)
    start = time.perf_counter()
    assert list(find_boards(noise)) == []
    assert time.perf_counter() - start < 5.0  # findChessboardCorners searches for minutes here


def planar_misfit(grid: np.ndarray) -> float:
    """Residual (px rms) of the corners against the best homography: what lens distortion alone leaves is below 1 px."""
    i, j = np.indices(grid.shape[:2])
    plane = np.stack((i, j), axis=-1).reshape(-1, 1, 2).astype(float)
    flat = grid.reshape(-1, 1, 2)
    H, _ = cv2.findHomography(plane, flat)
    return float(np.sqrt(((cv2.perspectiveTransform(plane, H) - flat) ** 2).mean()))


def test_a_real_hand_held_board_is_found_in_a_phone_video(realdata):
    path = realdata / "edihead_iphone1080p60_chess9x6" / "edihead_calibration_example.mp4"
    with VideoReader(path) as video:
        kept = [frame.luma.copy() for frame in video.frames() if frame.index % 9 == 0]
    for picture in kept:
        grid = next(find_boards(picture))
        assert sorted(grid.shape[:2]) == [6, 9]
        assert planar_misfit(grid) < 1.0


def test_real_boards_are_found_and_an_incomplete_one_is_not_invented(realdata):
    found = {}
    for path in sorted((realdata / "caliscope_chess9x6").glob("cam_0_*.jpg")):
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        grids = [grid for grid in find_boards(picture) if sorted(grid.shape[:2]) == [6, 9]]
        found[path.name] = planar_misfit(grids[0]) if grids else None
    assert sum(misfit is not None for misfit in found.values()) == 4
    assert found["cam_0_frame_000.jpg"] is None
    assert all(misfit is None or misfit < 1.5 for misfit in found.values()), found
