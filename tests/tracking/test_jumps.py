"""Frames that jump off their smooth course by more than is stated of them are stated as uncertain as that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from straw.tracking import jumps
from straw.tracking.board import Board
from straw.tracking.jumps import SHOWN, gain_of, gains, swift
from straw.tracking.noise import FOLLOWED_PX, Frames
from straw.tracking.synthetic import paint_video
from straw.tracking.track import track
from straw.tracking.views import LEAP_GAIN
from tests.tracking.test_track import REST

QUINTIC = np.array((-1, 6, -15, 20, -15, 6, -1)) / 20  # a frame less the quintic through three on either side
STATED = np.diag((5e-6, 4e-6, 3e-4)) ** 2


def leaps(errors):
    """Jumps (f - 6, 3) of poses (f, 3) off the course."""
    return np.column_stack([np.convolve(each, QUINTIC, mode="valid") for each in errors.T])


def found(size, kept=0.0, count=400, seed=0):
    """The gain for errors ``size`` times as large as stated, each frame keeping a share of the error before it."""
    drawn = np.random.default_rng(seed).normal(0, size, (count, 3)) @ np.sqrt(STATED)
    for k in range(1, count):
        drawn[k] = kept * drawn[k - 1] + np.sqrt(1 - kept**2) * drawn[k]
    jump = leaps(drawn)
    return gain_of(jump, np.tile(LEAP_GAIN * STATED, (len(jump), 1, 1)))


@pytest.mark.parametrize("size", [1.5, 3.0])
def test_the_gain_is_that_of_the_errors_variance_beyond_the_share_that_jumps_usually_show(size):
    assert found(size) == pytest.approx(size**2 / SHOWN, rel=0.15)


def test_errors_that_neighbours_share_and_errors_smaller_than_stated_leave_everything_as_stated():
    assert found(1.0, kept=0.9) == 1.0
    assert found(0.5) == 1.0


def test_a_few_impacts_do_not_raise_the_gain():
    jump = leaps(np.random.default_rng(1).normal(0, 1, (406, 3)) @ np.sqrt(STATED))
    plain = np.tile(LEAP_GAIN * STATED, (400, 1, 1))
    hit = jump.copy()
    hit[::20] *= 100
    assert gain_of(hit, plain) == pytest.approx(gain_of(jump, plain), rel=0.1)


def test_too_few_frames_tell_nothing():
    assert gain_of(np.full((10, 3), 1.0), np.tile(STATED, (10, 1, 1))) == 1.0


def test_keyframes_and_slow_frames_are_left_as_stated_but_those_that_copy_a_swift_one():
    speed_px = np.array((0.0, 0.05, 0.3, 0.8, 3.0, 3.0, 0.3, 0.05, np.nan, 0.05, 0.05))
    key = np.arange(11) == 6
    np.testing.assert_array_equal(gains(2.0, key, speed_px), (1, 1, 2, 2, 2, 1, 1, 1, 2, 2, 1))


def test_of_a_long_clip_stretches_from_its_beginning_to_its_end_are_judged():
    rng, n = np.random.default_rng(2), 50_000
    speed_px, key = rng.uniform(0, 2 * FOLLOWED_PX, n), np.arange(n) % 30 == 0
    none = np.zeros(n)
    frames = Frames(np.zeros((n, 2)), np.ones((n, 2)), np.zeros((n, 2)), key, none, speed_px, none, none)
    chosen = swift(frames)
    assert 200 < len(chosen) < 400
    assert chosen[0] < 100
    assert chosen[-1] > n - 100
    assert not key[chosen].any()
    assert (speed_px[chosen] < FOLLOWED_PX).all()
    assert not len(swift(replace(frames, speed_px=none)))


def test_a_moving_board_that_trembles_by_more_than_its_residuals_show_is_stated_as_uncertain(
    small, tmp_path, monkeypatch
):
    """Each picture is off the smooth course as if all corners had been predicted wrong alike, by 0.03 px and more."""
    tremble = np.random.default_rng(3).normal(0, 1, (400, 3)) * (10e-6, 7e-6, 6e-4)

    def smooth(time_s):
        since = np.clip(np.asarray(time_s) - 0.1, 0, None)
        return REST[0] + 0 * since, 0.0005 * (1 - np.cos(2 * np.pi * 7 * since)), REST[2] + 0 * since

    def motion(time_s):
        frame = np.round(np.asarray(time_s) * 240_000 / 1001).astype(int)
        off = np.where(np.asarray(time_s) > 0.1, tremble[frame].T, 0.0)
        return tuple(at + by for at, by in zip(smooth(time_s), off, strict=True))

    paint_video(tmp_path / "v.mp4", small, motion, 0.9, bitrate=20e6)

    def squares():
        trace = track(tmp_path / "v.mp4", replace(small, line_s=0.0), Board()).trace
        x, z, phi = smooth(trace.time_s)
        ratio = (
            (trace.x_m - x) / trace.sigma_x_m,
            (trace.z_m - z) / trace.sigma_z_m,
            (trace.phi_rad - phi) / trace.sigma_phi_rad,
        )
        moving = trace.valid & (np.abs(np.gradient(z)) > 60e-6)
        return (np.square(ratio)[:, moving]).mean()

    told = squares()
    assert 0.3 < told < 1.5
    monkeypatch.setattr(jumps, "SHOWN", np.inf)
    assert squares() > 3 * told
