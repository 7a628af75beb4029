"""A protocol of sixty days, run on a stepped clock: on time to the last step, readable, recoverable, small."""

import sys
from pathlib import Path

import pytest

from tests.benchmarks.months import run_months

PERIOD_S = 7200.0


@pytest.mark.skipif(sys.platform != "linux", reason="memory at a moment is read from /proc")
def test_sixty_days_end_on_time_in_no_more_memory_than_six_days(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # without the ten million heartbeats between the readings
    monkeypatch.setattr("straw.rig.session_run.BEAT_S", PERIOD_S)
    found = run_months(60, PERIOD_S, tmp_path)
    assert (found.cycles, found.readings, found.missed) == (720, 720, 0)
    assert len(found.late_s) == 60
    # A cycle is due one period after the previous one, and an exchange takes milliseconds: these must not accumulate.
    assert max(found.late_s) < 0.1
    assert found.resident_mb[-1] - found.resident_mb[0] < 4.0  # a few pages of memory, but no growth with the days
    assert found.recovered > 0.85 * 720
