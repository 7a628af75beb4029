"""Planted errors of a model are judged: those that the data resolve are reported, others are not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.compare.comparison import Comparison, compare
from straw.replay.metrics.noise import independent
from straw.replay.metrics.validation import RESOLVED, UNKNOWN, UNRESOLVED
from straw.rig.run import Run
from tests.replay.test_compare import recorded

STRAW = StrawParameters()
SIGMA = {"x_m": 25e-6, "z_m": 25e-6, "phi_rad": 1.5e-3}


@pytest.fixture(scope="module")
def noisy() -> Run:
    """A run made by the model, with noise of the sigma it states."""
    run, _ = recorded(STRAW)
    assert run.tip is not None
    chance = np.random.default_rng(8)
    changes = {name: getattr(run.tip, name) + chance.normal(0, s, len(run.tip)) for name, s in SIGMA.items()}
    changes |= {f"sigma_{name}": np.full(len(run.tip), s) for name, s in SIGMA.items()}
    return dataclasses.replace(run, tip=dataclasses.replace(run.tip, **changes))


def moved(run: Run, **by: float) -> Run:
    assert run.tip is not None
    changes = {name: getattr(run.tip, name) + shift for name, shift in by.items()}
    return dataclasses.replace(run, tip=dataclasses.replace(run.tip, **changes))


def verdict_of(c: Comparison, name: str) -> str:
    (found,) = (q.verdict for q in c.quantities if q.name == name)
    return found


def test_a_right_model_cannot_be_distinguished_from_the_noise(noisy: Run) -> None:
    c = compare(noisy, STRAW)
    assert [s.verdict for s in c.signals.values()] == [UNRESOLVED] * 3
    told = [q for q in c.quantities if q.verdict != UNKNOWN]
    # at two sigma one in twenty is off by chance: more than two of so few occur in one case in a hundred
    assert sum(q.verdict == RESOLVED for q in told) <= 2
    assert len(c.pairs) == 1
    assert c.pairs[0].measured is not None
    assert c.pairs[0].predicted is not None
    assert c.pairs[0].measured.cell == c.pairs[0].predicted.cell == 1


def test_two_sigma_are_exceeded_by_one_in_twenty_whether_noise_is_white_or_not() -> None:
    """Means of 2 x 2000 draws over the stated sigma: one in twenty beyond 2, within four times its own scatter."""
    chance = np.random.default_rng(0)
    for together in (1, 5):
        beyond = 0
        for _ in range(2000):
            white = chance.standard_normal(200 + together - 1)
            noise = np.convolve(white, np.ones(together) / np.sqrt(together), "valid")
            beyond += abs(noise.mean()) > 2 / np.sqrt(independent(noise))
        assert beyond / 2000 == pytest.approx(0.0455, abs=4 * np.sqrt(0.0455 * 0.9545 / 2000))


def test_an_offset_is_resolved_from_the_uncertainty_of_60_samples_of_the_end_upwards(noisy: Run) -> None:
    """A quarter of a second at 240 Hz: sigma / sqrt(60) = 3.2 um; the mean of the noise itself is taken out first."""
    (z,) = (q for q in compare(noisy, STRAW).quantities if q.name == "z at the end")
    assert z.u_data == pytest.approx(25e-6 / np.sqrt(60), rel=0.5)
    for sigmas, verdict in ((0.0, UNRESOLVED), (1.7, UNRESOLVED), (2.3, RESOLVED), (12.0, RESOLVED)):
        shifted = moved(noisy, z_m=z.error + sigmas * z.u_val)
        assert verdict_of(compare(shifted, STRAW), "z at the end") == verdict


def test_the_inputs_uncertainty_does_not_count_against_the_model(noisy: Run) -> None:
    """A channel 1 % narrower is distinguished from the run; not by its snap, if the radius is only known to 2 %."""
    less = STRAW.replace(r_ch_m=0.99 * STRAW.r_ch_m)
    start = "snap 1 (cell 1) start"
    assert verdict_of(compare(noisy, less), start) == RESOLVED
    # a whole sigma more would let both cells bend at once, and the snap could not be assigned
    known = compare(noisy, less, {"r_ch_m": 0.008 * STRAW.r_ch_m})
    assert known.inputs == ("r_ch_m",)
    assert verdict_of(known, start) == UNRESOLVED


def test_without_sigmas_there_is_no_statement() -> None:
    run, _ = recorded(STRAW)
    assert run.tip is not None
    unknown = np.full(len(run.tip), np.nan)
    bare = dataclasses.replace(run.tip, sigma_x_m=unknown, sigma_z_m=unknown, sigma_phi_rad=unknown)
    c = compare(dataclasses.replace(run, tip=bare), STRAW)
    assert [s.verdict for s in c.signals.values()] == [UNKNOWN] * 3
    assert verdict_of(c, "x at the end") == UNKNOWN


def test_a_snap_that_the_predicted_straw_does_not_make_is_reported_as_missing(noisy: Run) -> None:
    """A wall four times as stiff withstands 25 kPa."""
    stiff = STRAW.replace(E_pa=4 * np.asarray(STRAW.E_pa))
    c = compare(noisy, stiff)
    assert [(p.measured is None, p.predicted is None) for p in c.pairs] == [(False, True)]
    (start,) = (q for q in c.quantities if q.name.endswith("start"))
    assert (start.verdict, start.words) == (UNKNOWN, "not in the prediction")
