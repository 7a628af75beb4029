"""Readings of the gauge before the first command are evidence of its offset, and of nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.library import hypothesis
from straw.replay.diagnose.systems.straw.vented import VENTED_PA, vent_residual, vented
from straw.rig.run import PressureLog

STRAW = StrawParameters()
TOLD = PressureLog(np.array([0.0, 0.5]), np.array([0.0, 25e3]), np.full(2, np.nan), held=True)


def _read(offset_pa: float, drift_pa_per_s: float = 0.0) -> PressureLog:
    """A gauge with 30 Pa of noise at 200 Hz; the line is vented for half a second, then at 25 kPa."""
    time_s = np.arange(0.0, 1.0, 5e-3)
    noise = np.random.default_rng(2).normal(0, 30.0, len(time_s))
    shown = np.where(time_s < 0.5, offset_pa + drift_pa_per_s * time_s, 25e3 + offset_pa)
    return PressureLog(time_s, shown + noise, np.full(len(time_s), 30.0))


def test_an_offset_is_read_at_vent_where_noise_does_not_account_for_it():
    assert vented(_read(700.0), TOLD) == pytest.approx(700.0, abs=4 * 30 / np.sqrt(100))
    assert vented(_read(0.0), TOLD) is None
    assert vented(_read(700.0, drift_pa_per_s=-1400.0), TOLD) is None  # pressure left by the previous run
    assert vented(_read(700.0), None) is None  # the command at that time is unknown


def test_the_gauge_s_offset_explains_what_it_reads_at_vent_and_a_law_of_the_straw_does_not():
    for name, explains in (("gauge_offset", True), ("cohesion", False)):
        one = hypothesis((name,), STRAW.cells)
        unknowns = (*base_unknowns(STRAW), *one.unknowns)
        at = np.zeros(len(unknowns))
        left, slopes = vent_residual(700.0, 0.0, unknowns, at)
        assert left == pytest.approx(700.0 / VENTED_PA)
        if explains:
            at[-1] = unknowns[-1].at(700.0 / unknowns[-1].scale)
            assert vent_residual(700.0, 0.0, unknowns, at)[0] == pytest.approx(0.0, abs=1e-9)
            assert slopes[-1] == pytest.approx(-unknowns[-1].per_u(0.0) / VENTED_PA, rel=1e-5)
        else:
            assert not np.any(slopes)


def test_a_gauge_without_readings_at_vent_adds_no_misfit():
    unknowns = base_unknowns(STRAW)
    left, slopes = vent_residual(None, 0.0, unknowns, np.zeros(len(unknowns)))
    assert (left, slopes.tolist()) == (0.0, [0.0] * len(unknowns))
