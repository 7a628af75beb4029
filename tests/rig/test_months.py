"""A protocol of sixty days, run on a stepped clock: on time to the last step, readable, recoverable, small."""

import sys
from pathlib import Path

import pytest

from tests.benchmarks.months import run_months

PERIOD_S = 7200.0


@pytest.mark.skipif(sys.platform != "linux", reason="memory at a moment is read from /proc")
def test_sixty_days_end_on_time_in_no_more_memory_than_their_tenth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("straw.rig.session_run.BEAT_S", PERIOD_S)  # ten million beats between the readings are left out
    found = run_months(60, PERIOD_S, tmp_path)
    assert (found.cycles, found.readings, found.missed) == (720, 720, 0)
    assert len(found.late_s) == 60
    # A cycle is due a period after the one before, and an exchange takes milliseconds: these must not add up.
    assert max(found.late_s) < 0.1
    assert found.resident_mb[-1] - found.resident_mb[0] < 4.0  # a page here and there, not a cost of each day
    assert found.recovered > 0.85 * 720
