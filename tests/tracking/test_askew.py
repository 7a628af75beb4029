"""Edges that run askew to the raster: their error in coded pictures, what a clip tells of it, and its removal."""

import numpy as np
import pytest

from straw.tracking.askew import MOST, along, askew_of, leaning, present
from straw.tracking.noise import Frames


def grid(turn_rad: float) -> np.ndarray:
    """Return corners (1, 7, 7, 2) 20 px apart, the board turned in the picture."""
    u, v = 20.0 * np.indices((7, 7))
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return np.stack((c * u - s * v, s * u + c * v), axis=-1)[None] + 300


def frames(size_px: float, keys: int, scatter_px: float) -> Frames:
    rng, n = np.random.default_rng(3), 30 * keys
    key = np.arange(n) % 30 == 0
    jump = np.where(key, size_px, 0.0) + rng.normal(0, scatter_px, n)
    flat = np.zeros(n)
    return Frames(np.zeros((n, 2)), np.ones((n, 2)), np.zeros((n, 2)), key, flat, np.full(n, 0.5), jump, flat)


def test_an_upright_board_has_no_such_error_and_a_turned_one_has_opposite_ones_for_opposite_turns():
    assert not leaning(grid(0.0)).any()
    one, other = leaning(grid(0.03)), leaning(grid(-0.03))
    np.testing.assert_allclose(one, -other, atol=1e-9)
    # turned by +0.03 rad lines down the picture lean to smaller u, those across it to larger v
    assert (one[..., 0] > 0).all()
    assert (one[..., 1] < 0).all()


def test_which_way_the_boards_axes_point_in_the_picture_does_not_matter():
    turned = np.rot90(grid(0.03), axes=(1, 2))
    np.testing.assert_allclose(leaning(turned), np.rot90(leaning(grid(0.03)), axes=(1, 2)), atol=1e-9)


def test_a_planted_error_is_measured_along_its_own_pattern():
    leans = leaning(grid(0.02))
    assert along(0.007 * leans, leans)[0] == pytest.approx(0.007)


def test_a_moving_board_has_less_of_it_and_a_keyframe_all():
    share = present(np.array((True, False, False)), np.array((1.0, np.nan, 1.0)))
    assert share[0] == 1
    assert share[1] > 0.5
    assert share[2] < 0.01


@pytest.mark.parametrize("size_px", [0.0, 0.006, 0.014])
def test_many_keyframes_tell_the_size_and_none_leave_it_between_none_and_the_most(size_px):
    lag_px, keys, scatter_px = 0.018, 400, 0.018
    size, sigma = askew_of(frames(size_px, keys, scatter_px), lag_px)
    assert sigma == pytest.approx(1.25 * scatter_px / np.sqrt(keys), rel=0.2)  # of a median
    assert abs(size - size_px) < 3 * sigma
    unknown, doubt = askew_of(frames(size_px, 2, scatter_px), lag_px)
    assert unknown == doubt == pytest.approx(MOST / 2 * lag_px)
