"""Corners are found on real boards, sharpened to where they truly are, and told from things that are no corners."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tracking.corners import find_board, quarter_turns, read_squares, right_handed, sharpen, smallest_pitch
from tracking.video import VideoReader


def drawn(pitch: float = 20.3, turn: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """Return a supersampled picture of an 8 x 8 board and its true corners (7, 7, 2), x down and y right."""
    fine = 8
    cos, sin = np.cos(turn), np.sin(turn)
    row, column = (np.mgrid[0 : 240 * fine, 0 : 240 * fine] + 0.5) / fine - 0.5 - 119.3
    x, y = (row * cos + column * sin) / pitch, (column * cos - row * sin) / pitch
    inside = np.maximum(abs(x), abs(y)) < 4
    grey = np.where(inside & ((np.floor(x) + np.floor(y)) % 2 == 0), 50.0, 200.0)
    picture = cv2.resize(grey, (240, 240), interpolation=cv2.INTER_AREA)
    i, j = np.meshgrid(np.arange(-3, 4), np.arange(-3, 4), indexing="ij")
    down, right = pitch * (i * cos - j * sin) + 119.3, pitch * (i * sin + j * cos) + 119.3
    return np.round(picture).astype(np.uint8), np.stack((right, down), axis=-1)


def test_corners_are_sharpened_to_where_they_are():
    picture, truth = drawn()
    found = sharpen(picture, truth + np.random.default_rng(0).uniform(-3, 3, truth.shape))
    # OpenCV's estimator leans to whole pixels by up to 0.05 px here; without the blur it is twice that
    assert np.abs(found - truth).max() < 0.05
    assert np.sqrt(((found - truth) ** 2).mean()) < 0.025


def test_a_grid_that_leaves_the_picture_is_refused():
    picture, truth = drawn()
    assert sharpen(picture, truth + np.array((80, 0))) is None
    assert sharpen(picture, truth - np.array((0, 80))) is None


@pytest.mark.parametrize("halve", [False, True])
def test_a_board_is_found_and_laid_right_handed(halve):
    picture, truth = drawn()
    grid = right_handed(find_board(picture, (7, 7), halve=halve))
    errors = [np.abs(turn - truth).max() for turn in quarter_turns(grid)]
    assert sorted(errors)[0] < 1.0  # the detector's own error, before sharpening
    assert sorted(errors)[1] > 20


def test_squares_tell_a_board_from_a_slipped_and_from_a_covered_one():
    picture, truth = drawn(turn=0.0)
    lattice = np.arange(8) * 20.3 - 3.5 * 20.3 + 119.3
    centres = np.stack(np.meshgrid(lattice, lattice), axis=-1)
    contrast, whole = read_squares(picture, centres)
    assert contrast == pytest.approx(150, abs=3)  # 200 - 50, dark first
    assert whole.all()
    contrast, _ = read_squares(picture, centres + np.array((20.3, 0)))
    assert contrast < 0  # slipped by a square: black and white swap
    _, whole = read_squares(picture, centres + 20.3)
    assert (
        whole.sum() <= 36 + 2
    )  # slipped along the diagonal: the colours fit, but a row and a column are off the board
    picture[:65, :65] = 125  # covers the first square only
    _, whole = read_squares(picture, centres)
    assert np.argwhere(~whole).tolist() == [[0, 0]]
    assert smallest_pitch(truth) == pytest.approx(20.3)


def test_no_board_is_found_in_bright_noise():
    noise = np.random.default_rng(1).normal(200, 20, (480, 640)).clip(0, 255).astype(np.uint8)
    assert find_board(noise, (7, 7), halve=True) is None


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
        grid = find_board(picture, (6, 9), halve=True)
        assert grid is not None
        assert planar_misfit(sharpen(picture, grid)) < 1.0


def test_real_boards_are_found_and_an_incomplete_one_is_not_invented(realdata):
    found = {}
    for path in sorted((realdata / "caliscope_chess9x6").glob("cam_0_*.jpg")):
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        grid = find_board(picture, (6, 9), halve=True)
        found[path.name] = None if grid is None else planar_misfit(sharpen(picture, grid))
    assert sum(misfit is not None for misfit in found.values()) >= 3
    assert all(misfit is None or misfit < 1.5 for misfit in found.values()), found
