"""Metrics recover planted errors of known size; residuals called noise have the statistics of noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from straw.replay.metrics import metrics_of
from straw.replay.metrics.noise import independent
from straw.replay.metrics.ringdown import ring_down
from straw.replay.metrics.signal import sprague_geers_from
from straw.replay.metrics.snaps import match, named, snaps_of
from straw.replay.metrics.validation import RESOLVED, UNKNOWN, UNRESOLVED, Quantity, signal_verdict

TIME_S = np.arange(0, 10, 1 / 240)
UNKNOWN_SIGMA = np.full_like(TIME_S, np.nan)


def decaying(time_s: np.ndarray) -> np.ndarray:
    """The signal of the test vectors."""
    return np.exp(-0.15 * time_s) * np.sin(2 * np.pi * 0.7 * time_s)


SIGNAL = decaying(TIME_S)


@pytest.mark.parametrize(
    ("predicted", "expected"),
    [
        # Facts on recordings. P of the late one follows from the facts' own psi vector: 0.7 Hz x 20.83 ms x 2 = 0.0292.
        (1.02 * SIGNAL, {"rmse": 0.0080, "sprague_geers_m": 0.0200, "sprague_geers_c": 0.0200, "lag_s": 0.0}),
        (decaying(TIME_S - 5 / 240), {"rmse": 0.0366, "sprague_geers_p": 2 * 0.7 * 5 / 240, "lag_s": 0.02084}),
        (-SIGNAL, {"rmse": 0.7954, "sprague_geers_p": 1.0}),
        (decaying(TIME_S - 1 / 0.7), {"rmse": 0.0950, "sprague_geers_m": 0.2390, "sprague_geers_p": 0.0}),
    ],
    ids=["gain", "late", "flipped", "a period late"],
)
def test_the_test_vectors_hold_to_a_thousandth(predicted: np.ndarray, expected: dict[str, float]) -> None:
    found = metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, predicted)
    assert {name: getattr(found, name) for name in expected} == pytest.approx(expected, abs=1e-3)


def test_the_published_example_of_sprague_and_geers_is_reproduced() -> None:
    assert sprague_geers_from(143.5, 143.5, 77.0) == pytest.approx((0.0, 0.319714, 0.319714), abs=1e-6)


def test_a_sign_flip_is_reported_as_such_and_not_as_a_lag() -> None:
    flipped = metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, -SIGNAL)
    assert flipped.lag_at_bound
    assert flipped.lag_bound_s < 0.5 / 0.7
    assert not metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, decaying(TIME_S - 0.1)).lag_at_bound


def test_the_lags_sigma_is_the_scatter_of_lags() -> None:
    """Forty draws with noise correlated over 5 samples: their scatter is known to 11 %, and 4 times that is allowed."""
    chance, found = np.random.default_rng(3), []
    for _ in range(40):
        white = chance.standard_normal(len(TIME_S) + 4)
        noise = 0.02 * np.convolve(white, np.ones(5) / np.sqrt(5), "valid")
        found.append(metrics_of(TIME_S, SIGNAL + noise, UNKNOWN_SIGMA, decaying(TIME_S - 0.02)))
    lags = np.array([m.lag_s for m in found])
    stated = np.mean([m.lag_sigma_s for m in found])
    assert lags.mean() == pytest.approx(0.02, abs=4 * stated / np.sqrt(40))
    assert lags.std() == pytest.approx(stated, rel=0.45)
    assert np.mean([m.rmse_after_lag for m in found]) == pytest.approx(0.02, rel=0.03)


def test_a_prediction_that_stands_still_has_no_lag() -> None:
    assert np.isnan(metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, np.zeros_like(SIGNAL)).lag_s)


def test_a_constant_offset_is_all_bias() -> None:
    m = metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, SIGNAL + 0.25)
    assert m.bias == pytest.approx(0.25)
    assert m.rmse == pytest.approx(0.25)
    assert m.nrmse_of_range == pytest.approx(0.25 / np.ptp(SIGNAL))


def test_the_largest_error_is_found_with_its_time() -> None:
    predicted = SIGNAL.copy()
    predicted[777] -= 3.0
    m = metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, predicted)
    assert (m.max_abs, m.max_at_s) == (pytest.approx(3.0), TIME_S[777])


def test_the_overlap_leaves_out_what_only_one_covers() -> None:
    both = (TIME_S < 4) | (TIME_S >= 6)
    m = metrics_of(TIME_S[both], SIGNAL[both], UNKNOWN_SIGMA[both], SIGNAL[both])
    assert m.overlap_s == pytest.approx(8.0, abs=0.02)


@pytest.mark.parametrize("together", [1, 8])
def test_noise_of_the_stated_sigma_passes_as_noise_however_correlated(together: int) -> None:
    """Reduced chi-square of 60 draws: its scatter is the one stated (known to 9 % from 60 draws), its mean is 1."""
    chance, sigma, found = np.random.default_rng(5), np.full_like(TIME_S, 0.02), []
    for _ in range(60):
        white = chance.standard_normal(len(TIME_S) + together - 1)
        noise = 0.02 * np.convolve(white, np.ones(together) / np.sqrt(together), "valid")
        found.append(metrics_of(TIME_S, SIGNAL + noise, sigma, SIGNAL))
    chi2, stated = np.array([m.reduced_chi2 for m in found]), np.mean([m.reduced_chi2_sigma for m in found])
    assert chi2.mean() == pytest.approx(1.0, abs=4 * stated / np.sqrt(60))
    assert chi2.std() == pytest.approx(stated, rel=0.4)
    assert np.mean([m.within_2_sigma for m in found]) == pytest.approx(0.9545, abs=0.005)


def test_without_sigmas_no_figure_is_in_sigmas() -> None:
    m = metrics_of(TIME_S, SIGNAL, UNKNOWN_SIGMA, SIGNAL)
    assert np.isnan(m.within_2_sigma)
    assert np.isnan(m.reduced_chi2)
    assert np.isnan(m.reduced_chi2_sigma)


def test_correlated_samples_have_a_smaller_effective_number() -> None:
    """Sums of 8 neighbours: 8 times fewer for the mean, 1 + 2 sum (1 - k/8)^2 = 5.4 times fewer for squares."""
    white = np.random.default_rng(1).standard_normal(200_007)
    summed = np.convolve(white, np.ones(8), "valid")
    assert len(summed) / independent(summed) == pytest.approx(8, rel=0.1)
    assert len(summed) / independent(summed, squares=True) == pytest.approx(5.375, rel=0.1)


def test_a_planted_ring_down_is_found_within_its_sigma() -> None:
    t = np.arange(0, 0.8, 1 / 240)
    chance = np.random.default_rng(2)
    clean = 0.01 * np.exp(-6.0 * t) * np.cos(2 * np.pi * 15.5 * t + 1) + 0.5 - 0.02 * t
    found = ring_down(t, clean + chance.normal(0, 4e-4, len(t)))
    assert found is not None
    assert found.frequency_hz == pytest.approx(15.5, abs=4 * found.frequency_sigma_hz)
    assert found.decay_per_s == pytest.approx(6.0, abs=4 * found.decay_sigma_per_s)
    assert found.frequency_sigma_hz < 0.1
    assert ring_down(t, 0.5 + chance.normal(0, 4e-4, len(t))) is None


def bent(hinges_m: list[float], starts_s: list[float], noise_rad: float = 0.0) -> tuple[np.ndarray, ...]:
    """A tip 50 mm out that swings by 0.3 rad about a hinge for 0.2 s, at each of the starts; rising within 20 ms."""
    phi, x, z = np.full_like(TIME_S, np.pi / 2), np.full_like(TIME_S, 0.05), np.zeros_like(TIME_S)
    for hinge_m, start_s in zip(hinges_m, starts_s, strict=True):
        turn = 0.3 * np.interp(TIME_S, start_s + np.array([-0.01, 0.01, 0.2, 0.22]), [0, 1, 1, 0])
        phi, x, z = phi + turn, x + hinge_m * (np.cos(turn) - 1), z - hinge_m * np.sin(turn)
    noise = np.random.default_rng(4).normal(0, noise_rad, len(TIME_S)) if noise_rad else 0.0
    return x, z, phi + noise


def test_snaps_are_found_with_their_time_and_their_hinge() -> None:
    found = snaps_of(TIME_S, *bent([0.045, 0.03], [2.0, 4.0], 1.5e-3), 0.15)
    # the straight edge passes half its height at the planted start
    assert [s.start_s for s in found] == pytest.approx([2.0, 4.0], abs=4 * max(s.sigma_s for s in found))
    assert [s.hinge_m for s in found] == pytest.approx([0.045, 0.03], rel=0.02)
    assert [s.turn_rad for s in found] == pytest.approx([0.3, 0.3], abs=4 * 1.5e-3)


def test_noise_alone_is_not_taken_for_a_snap() -> None:
    assert snaps_of(TIME_S, *bent([], [], 0.02), 0.05) == []


def test_snaps_are_paired_in_time_and_assigned_to_cells_by_their_hinge() -> None:
    said = [
        replace(s, cell=c) for s, c in zip(snaps_of(TIME_S, *bent([0.045, 0.03], [2, 4]), 0.15), (1, 4), strict=True)
    ]
    seen = snaps_of(TIME_S, *bent([0.031, 0.045, 0.04], [2.1, 4.1, 8.0]), 0.15)  # the other way round, and one more
    pairs = match(named(seen, said), said)
    assert [(p.measured and p.measured.cell, p.predicted and p.predicted.cell) for p in pairs] == [
        (4, 1),
        (1, 4),
        (1, None),
    ]
    assert [p.late_s for p in pairs[:2]] == pytest.approx([-0.1, -0.1], abs=1e-3)
    assert np.isnan(pairs[2].late_s)


def test_an_error_below_the_uncertainty_is_not_called_validated() -> None:
    small = Quantity("x", "m", 1.0, 1.09, 0.03, 0.04, 0.0)  # u_val = 0.05
    assert (small.verdict, small.u_val) == (UNRESOLVED, pytest.approx(0.05))
    assert "valid" not in small.words
    large = Quantity("x", "m", 1.0, 1.11, 0.03, 0.04, 0.0)
    assert large.verdict == RESOLVED
    assert "off by 0.11 ± 0.1 m" in large.words
    assert Quantity("x", "m", 1.0, 1.1, float("nan"), 0.0, 0.0).verdict == UNKNOWN
    assert "not in the measurement" in Quantity("x", "m", float("nan"), 1.1, 0.1, 0.0, 0.0).words


def test_the_verdict_on_a_signal_follows_its_noise() -> None:
    noise, u_val = np.random.default_rng(6).normal(0, 0.1, 1000), np.full(1000, 0.1)
    assert signal_verdict(noise, u_val) == UNRESOLVED
    assert signal_verdict(noise + 0.1, u_val) == RESOLVED
    assert signal_verdict(noise, np.full(1000, np.nan)) == UNKNOWN
