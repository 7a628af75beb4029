"""A track is checked against the run's model: mirrored motion and slow motion are said, a motion that agrees is not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.film.expected import against_model
from straw.rig.run import PressureLog, Run
from straw.tracking.camera import Camera
from straw.tracking.lens import Lens
from straw.tracking.trace import TipTrace

STRAW = StrawParameters()
CAMERA = Camera(Lens("fisheye", 1920, 1080, 1e3, 1e3, 960.0, 540.0, (0.0, 0.0, 0.0, 0.0)))
FRAME_S = 1 / 240


@pytest.fixture(scope="module")
def filmed() -> tuple[Run, TipTrace]:
    """A run that snaps, and its tip as filmed at 240 frames/s, with noise and a stretch without the board."""
    log_s = np.arange(-0.1, 1.0, 0.005)
    pressure = PressureLog(log_s, np.interp(log_s, [0, 0.1], [0, -25e3]), np.full(len(log_s), np.nan))
    run = Run(
        path=Path("made.mcap"), sha256="", run_id="made", specimen="", initial_deployed=(1, 4), cycle=0, cells=9,
        zero_time_ns=0, metadata={}, attachments={}, command=None, pressure=pressure, tip=None, predictions={},
        events=(), lost=(),
    )  # fmt: skip
    time_s = np.arange(0.0, 1.0, FRAME_S)
    moved = simulate(STRAW, pressure, np.concatenate([[-0.1], time_s]), (1, 4))
    valid, rng = (time_s < 0.3) | (time_s > 0.4), np.random.default_rng(0)
    x, z, phi = (
        np.where(valid, getattr(moved, name)[1:] + rng.normal(0, noise, len(time_s)), np.nan)
        for name, noise in (("x_m", 1e-5), ("z_m", 1e-5), ("phi_rad", 2e-4))
    )
    sigma = np.full(len(time_s), 1e-5)
    return run, TipTrace(time_s, x, z, phi, sigma, sigma, sigma, valid, np.arange(len(time_s)))


def test_a_motion_that_agrees_is_not_mentioned(filmed: tuple[Run, TipTrace]) -> None:
    assert against_model(*filmed, STRAW, CAMERA) == []


def test_a_straw_that_lacks_some_physics_is_not_taken_for_a_wrong_film(filmed: tuple[Run, TipTrace]) -> None:
    assert against_model(*filmed, STRAW.replace(r_ch_m=0.3e-3), CAMERA) == []


def test_a_mirrored_motion_names_the_cameras_settings(filmed: tuple[Run, TipTrace]) -> None:
    run, tip = filmed
    first = np.flatnonzero(tip.valid)[0]
    mirrored = dataclasses.replace(tip, x_m=2 * tip.x_m[first] - tip.x_m, phi_rad=-tip.phi_rad)
    (said,) = against_model(run, mirrored, STRAW, CAMERA)
    assert "X (" in said
    assert "board_x_in_image 'down'" in said
    assert "mount 'face'" in said


def test_a_film_saved_at_an_eighth_of_its_rate_is_recognised_and_its_rate_given(filmed: tuple[Run, TipTrace]) -> None:
    run, tip = filmed
    (said,) = against_model(run, dataclasses.replace(tip, time_s=8 * tip.time_s), STRAW, CAMERA)
    assert "slow motion" in said
    assert float(said.split("--fps ")[1]) == pytest.approx(240, rel=0.1)


def test_a_run_without_a_log_of_the_pressure_says_nothing(filmed: tuple[Run, TipTrace]) -> None:
    run, tip = filmed
    assert against_model(dataclasses.replace(run, pressure=None), tip, STRAW, CAMERA) == []
