"""Metrics find planted errors of known size."""

from __future__ import annotations

import numpy as np
import pytest

from replay.metrics import metrics_of

TIME_S = np.arange(0, 10, 1 / 240)
SIGNAL = np.exp(-0.15 * TIME_S) * np.sin(2 * np.pi * 0.7 * TIME_S)
UNKNOWN = np.full_like(TIME_S, np.nan)


def test_a_gain_of_two_percent_and_a_sign_flip_give_the_rms_of_the_test_vectors() -> None:
    """Facts on recordings: gain +2 % -> RMSE .0080, sign flip -> .7954, on a signal with 1 % noise."""
    assert metrics_of(TIME_S, SIGNAL, UNKNOWN, 1.02 * SIGNAL).rmse == pytest.approx(0.0080, abs=1e-4)
    assert metrics_of(TIME_S, SIGNAL, UNKNOWN, -SIGNAL).rmse == pytest.approx(0.7954, abs=1e-3)


def test_a_constant_offset_is_all_bias() -> None:
    m = metrics_of(TIME_S, SIGNAL, UNKNOWN, SIGNAL + 0.25)
    assert m.bias == pytest.approx(0.25)
    assert m.rmse == pytest.approx(0.25)
    assert m.nrmse_of_range == pytest.approx(0.25 / np.ptp(SIGNAL))


def test_the_largest_error_is_found_with_its_time() -> None:
    predicted = SIGNAL.copy()
    predicted[777] -= 3.0
    m = metrics_of(TIME_S, SIGNAL, UNKNOWN, predicted)
    assert (m.max_abs, m.max_at_s) == (pytest.approx(3.0), TIME_S[777])


def test_noise_of_the_stated_sigma_has_chi_square_one_and_ninety_five_percent_within_two_sigma() -> None:
    sigma = np.full_like(TIME_S, 0.02)
    measured = SIGNAL + np.random.default_rng(5).normal(0, sigma)
    m = metrics_of(TIME_S, measured, sigma, SIGNAL)
    n = len(TIME_S)  # independent samples: both figures scatter by their binomial and chi-square sigma
    assert m.within_2_sigma == pytest.approx(0.9545, abs=4 * np.sqrt(0.9545 * 0.0455 / n))
    assert m.reduced_chi2 == pytest.approx(1.0, abs=4 * np.sqrt(2 / n))


def test_without_sigmas_nothing_is_said_in_sigmas() -> None:
    m = metrics_of(TIME_S, SIGNAL, UNKNOWN, SIGNAL)
    assert np.isnan(m.within_2_sigma)
    assert np.isnan(m.reduced_chi2)
