"""No wrong pose is marked valid: repeated pictures, lost packets, boards that jump, printed frames."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from straw.tracking.course import Courses, course_of
from straw.tracking.doubt import JUMPS, LOST, MISFIT, REPEATED, doubted
from straw.tracking.lattice import chequered
from straw.tracking.misprint import Misprint
from tests.benchmarks.tracking_painted import errors, side_on, tracked
from tests.painting.film import RATE, encode, film

REPEATS = (58, 59, 77, 100)  # from 0.24 s on: until then the board hardly moves and a repeat does no harm


@pytest.fixture(scope="module")
def turning():
    """A board that rotates continuously, in a small picture, and its 120 pictures."""
    scene = side_on(3, 0.0, turning=True)
    small = dataclasses.replace(scene, width=560, height=480, centre=(279.3, 238.8), f=620.0)
    return small, list(film(small, 0.5))


@pytest.mark.parametrize("b_frames", [0, 2])
def test_repeated_pictures_are_found_in_a_reencoded_file(turning, tmp_path, b_frames):
    """Converters to a constant rate fill gaps so; no two decoded pictures are equal, so only the motion shows it."""
    scene, pictures = turning
    for k in REPEATS:
        pictures = [*pictures[:k], pictures[k - 1], *pictures[k + 1 :]]
    found = tracked(encode(tmp_path / "v.mp4", pictures, bitrate=8e6, b_frames=b_frames), scene)
    assert [k for k in range(len(pictures)) if found.said[k] == REPEATED] == list(REPEATS)
    assert np.abs(errors(found, scene)[1]).max() < 6


def test_without_repeats_no_frame_is_refused(turning, tmp_path):
    scene, pictures = turning
    found = tracked(encode(tmp_path / "v.mp4", pictures, bitrate=8e6), scene)
    assert not found.invalid


def test_pictures_that_depend_on_a_lost_packet_are_invalid_until_the_next_keyframe(turning, tmp_path):
    scene, pictures = turning
    path = encode(tmp_path / "v.mp4", pictures, bitrate=8e6, gop=30)
    data = bytearray(path.read_bytes())
    middle = int(0.55 * len(data))
    data[middle : middle + 6000] = np.random.default_rng(0).bytes(6000)
    path.write_bytes(data)
    found = tracked(path, scene)
    assert found.decode.corrupt > 0
    assert found.invalid.get(LOST, 0) > 0
    assert found.trace.valid[-25:].all()  # from the next keyframe on
    assert np.abs(errors(found, scene)[1]).max() < 6


def moving(count: int, seed: int = 0) -> Courses:
    """Detected corners of a swinging board, with noise."""
    time_s = np.arange(count) / float(RATE)
    rng = np.random.default_rng(seed)
    swing = np.stack(
        [
            a * np.sin(2 * np.pi * f * time_s + a)
            for a, f in zip(rng.uniform(5, 20, 6), rng.uniform(3, 9, 6), strict=True)
        ],
        1,
    )
    rms = 0.05 * np.exp(rng.normal(0, 0.08, count))
    return Courses(time_s, swing + rng.normal(0, 0.01, swing.shape), rms, np.zeros(count, np.bool_))


def test_a_board_that_jumps_for_one_frame_and_one_whose_corners_disagree_are_refused():
    seen = moving(600)
    seen.course[300] += 0.5  # px: fifty sigma
    seen.rms_px[400] = 0.9
    said = doubted(seen)
    assert {int(k): said[k] for k in np.flatnonzero(said != "")} == {300: JUMPS, 400: MISFIT}


def test_good_frames_are_hardly_ever_refused():
    """Ten thousand of them: designed for one false alarm in a million, so none occurs in 99 of 100 such tests."""
    assert not any((doubted(moving(2000, seed)) != "").any() for seed in range(5))


def test_an_abrupt_stop_is_not_refused():
    """From 2 px a frame to rest between two frames: one-sided predictions agree with it."""
    seen = moving(400)
    still = np.maximum(np.arange(400) - 200, 0)[:, None]
    seen.course[:] = 2.0 * (np.arange(400)[:, None] - still) / np.sqrt(6) + np.random.default_rng(1).normal(
        0, 0.01, (400, 6)
    )
    assert not (doubted(seen) != "").any()


def swinging(count: int = 400, seed: int = 3) -> Courses:
    """Detected corners of a board that all come to rest at every turning point, 24 frames apart."""
    seen = moving(count, seed)
    swing = 4.0 * np.cos(2 * np.pi * (np.arange(count) - 0.5) / 48)[:, None] / np.sqrt(6)
    seen.course[:] = swing + np.random.default_rng(seed).normal(0, 0.003, (count, 6))
    return dataclasses.replace(seen, rms_px=seen.rms_px * 0.3)


@pytest.mark.parametrize("first", [193, 194, 217, 239])  # turning points are at 192.5, 216.5, 240.5
def test_a_series_of_repeats_that_begins_or_ends_at_a_turning_point_is_found(first):
    seen, rng = swinging(), np.random.default_rng(9)
    seen.course[first : first + 3] = seen.course[first - 1] + rng.normal(0, 2e-4, (3, 6))
    said = doubted(seen)
    # the first is where it should be, if the turning point lies between the two
    assert (said[first + 1 : first + 3] == REPEATED).all()
    assert np.count_nonzero(said != "") <= 4


def drifting(steps_px: np.ndarray, tremor_px: float) -> Courses:
    """A board that moves by ``steps_px`` (f,) a frame, all of it along one line, after 100 frames of steady motion."""
    seen, rng = moving(400), np.random.default_rng(12)
    steps = np.concatenate((np.full(100, steps_px[0]), steps_px, np.full(300 - len(steps_px), steps_px[-1])))
    seen.course[:] = np.cumsum(steps)[:, None] / np.sqrt(6) + rng.normal(0, tremor_px, (400, 6))
    return seen


def test_slow_motion_tells_its_repeats_by_the_leap_at_their_end():
    """Three repeats at 0.04 px a frame: every prediction is as near as the codec's lag."""
    steps = np.full(100, 0.04)
    steps[40:43], steps[43] = 0.0, 0.16
    said = doubted(drifting(steps, 2e-4))
    assert (said[140:143] == REPEATED).all()
    assert np.count_nonzero(said != "") == 3


def test_what_a_codec_hides_and_catches_up_is_no_leap():
    """The same at 0.012 px a frame: 0.05 px, two usual lags in both coordinates, may be a codec's."""
    steps = np.full(100, 0.012)
    steps[40:43], steps[43] = 0.0, 0.048
    assert not (doubted(drifting(steps, 2e-4)) != "").any()


def test_frames_that_rest_amid_a_reversal_are_refused_and_a_turning_point_is_not():
    """A thrown board: 1.2, 0.8, 0.4, 0, -0.4 px a frame; then two repeats there, of which the last is off."""
    thrown = 1.2 - 0.4 * np.arange(7)
    steps = np.concatenate((np.full(40, 1.2), thrown, np.full(40, thrown[-1])))
    assert not (doubted(drifting(steps, 2e-4)) != "").any()
    again = steps.copy()
    again[43:45], again[45] = 0.0, steps[43:46].sum()
    said = doubted(drifting(again, 2e-4))
    assert said[144] == REPEATED
    assert np.count_nonzero(said != "") <= 2


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_start_from_rest_is_not_refused(order):
    """At rest a codec repeats the same picture; then the board moves at constant speed, or accelerates."""
    seen = moving(400)
    since = np.maximum(np.arange(400) - 200, 0)[:, None]
    noise = np.random.default_rng(1).normal(0, 0.01, (400, 6))
    noise[:201] = noise[0] + np.random.default_rng(2).normal(0, 2e-4, (201, 6))
    seen.course[:] = np.minimum(0.3 * since**order, 2.0 * since) / np.sqrt(6) + noise
    assert not (doubted(seen) != "").any()


def test_a_course_is_the_rms_motion_of_the_corners():
    grid = np.stack(np.meshgrid(np.arange(7) * 20.0, np.arange(5) * 20.0, indexing="ij"), axis=-1)
    moved = grid @ np.array(((1.01, 0.02), (-0.02, 0.99))) + (0.3, -0.2)
    one, other = course_of(np.stack((grid, moved)))
    assert np.linalg.norm(other - one) == pytest.approx(np.sqrt(((moved - grid) ** 2).sum(axis=-1).mean()))


def test_the_printing_errors_of_a_board_are_estimated():
    rng = np.random.default_rng(2)
    prior = Misprint((7, 7))
    offsets = prior.lines() @ rng.normal(0, 2e-5, 14) + rng.normal(0, 4e-6, 98)
    for _ in range(60):
        prior = prior.learnt(offsets, np.diag(np.full(98, 1e-7**2)))
    assert prior.line_m == pytest.approx(2e-5, rel=0.5)  # 14 lines determine a sigma to 19 %
    assert prior.corner_m == pytest.approx(4e-6, rel=0.25)  # 84 degrees of freedom are left: 8 %


def board_with_a_frame() -> np.ndarray:
    """A board of 8 x 6 squares of 20 px at (60, 50), and beside it the line of a printed frame."""
    picture = np.full((240, 300), 220, np.uint8)
    for i in range(8):
        for j in range(6):
            if (i + j) % 2 == 0:
                picture[50 + 20 * j : 70 + 20 * j, 60 + 20 * i : 80 + 20 * i] = 30
    picture[40:180, 240:246] = 30
    return picture


def grid_of(u, v) -> np.ndarray:
    return np.stack(np.meshgrid(np.array(u, float) - 0.5, np.array(v, float) - 0.5, indexing="ij"), axis=-1)


def test_corners_of_a_printed_frame_beside_the_board_are_left_out():
    right = grid_of(range(80, 220, 20), range(70, 170, 20))
    wide = grid_of(range(80, 260, 20), range(70, 170, 20))
    np.testing.assert_array_equal(chequered(board_with_a_frame(), wide), right)
    np.testing.assert_array_equal(chequered(board_with_a_frame(), right), right)


def test_a_grid_of_every_second_row_is_refused():
    assert chequered(board_with_a_frame(), grid_of(range(80, 220, 40), range(70, 170, 20))) is None
