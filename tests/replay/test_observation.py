"""How the diagnosis sees a recording: faults of its instruments, whitened noise, snaps, and time warped at them."""

from __future__ import annotations

import numpy as np
import pytest

from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.diagnose.systems.straw.misfit import bend_basis, whitened
from straw.replay.diagnose.systems.straw.snaps import cell_snaps, crossings, levels_of


def test_faults_of_clock_camera_and_gauge_are_cancelled_by_their_opposites():
    pose = np.array([[0.05, 0.03], [-0.01, 0.02], [1.6, 1.2]])
    turned = Instrument(camera_roll_rad=0.02, length_scale=0.01).seen(pose, np.zeros(2))
    back = Instrument(camera_roll_rad=-0.02, length_scale=1 / 1.01 - 1).seen(turned, np.zeros(2))
    np.testing.assert_allclose(back, pose, atol=1e-15)
    late = Instrument(clock_offset_s=0.06, clock_drift=0.01)
    np.testing.assert_allclose(late.true_time(np.array([0.06, 1.07])), [0.0, 1.0])
    assert Instrument(gauge_offset_pa=100.0, gauge_gain=0.1).true_pressure(
        np.array([1200.0]), np.zeros(1)
    ) == pytest.approx(1000.0)


def test_the_tip_offset_lies_along_the_tip_axis():
    pose = np.array([[0.0], [0.0], [np.pi / 2]])
    seen = Instrument(tip_offset_m=1e-3).seen(pose, np.zeros(1))
    np.testing.assert_allclose(seen[:2, 0], [1e-3, 0.0], atol=1e-18)


def test_noise_of_a_track_is_white_with_unit_variance_once_whitened():
    rng = np.random.default_rng(0)
    n, fade = 20_000, np.exp(-1 / 240 / 0.05)
    slow = np.zeros(n)
    for k in range(1, n):
        slow[k] = fade * slow[k - 1] + np.sqrt(1 - fade**2) * rng.normal()
    noise = np.sqrt(0.38) * slow + np.sqrt(0.62) * rng.normal(size=n)
    white = whitened(np.tile(noise, (3, 1)), np.arange(n) / 240)[0]
    assert np.std(white) == pytest.approx(1.0, abs=4 / np.sqrt(2 * n))
    lag = np.array([np.mean(white[k:] * white[: n - k]) for k in range(1, 20)])
    assert np.max(np.abs(lag)) < 4 / np.sqrt(n)


def test_snaps_are_found_where_phi_leaves_its_rest_value_and_returns_and_ringing_is_no_further_snap():
    t = np.arange(0, 3, 1 / 240)
    phi = (
        1.6
        + 0.3 * ((t > 1.0) & (t < 1.2))
        + 0.12 * np.exp(-5 * np.clip(t - 1.2, 0, None)) * np.sin(90 * (t - 1.2)) * (t > 1.2)
    )
    found = crossings(t, phi, levels_of(phi))
    assert len(found) == 2
    np.testing.assert_allclose(found, [1.0, 1.2], atol=1 / 240)


def test_a_cell_that_snaps_straight_through_is_timed_between_the_samples_of_its_passage():
    time_s = np.arange(0.0, 1.0, 2e-3)
    for passes_s in (0.4, 0.4005, 0.4013):
        zeta = 2e-3 * np.tanh((time_s - passes_s) / 0.02)[:, None]
        np.testing.assert_allclose(cell_snaps(time_s, zeta, np.empty(0)), [passes_s, passes_s], atol=1e-6)


def test_a_tip_at_rest_has_no_snap():
    t = np.arange(0, 3, 1 / 240)
    phi = 1.6 + 1.5e-3 * np.random.default_rng(1).normal(size=len(t))
    assert len(crossings(t, phi, levels_of(phi))) == 0


def test_time_is_warped_at_the_snaps_and_not_far_from_them():
    t = np.linspace(0, 4, 401)
    snaps_s, late_s = np.array([2.0, 2.1]), np.array([0.03, 0.05])
    late = bend_basis(t, snaps_s, late_s) @ late_s
    assert late[200] == pytest.approx(0.03)
    assert late[210] == pytest.approx(0.05)
    assert late[0] == late[-1] == 0.0
    assert np.all(np.diff(t + late) > 0)
