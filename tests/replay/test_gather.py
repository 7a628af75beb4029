"""Recordings are joined to what was derived from them; where they cannot be, the error says why."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from straw.replay.compare.gather import gather
from straw.replay.errors import ReplayError
from straw.rig.run_derived import write_tip
from straw.rig.run_read import read_run
from straw.tracking.trace import TipTrace
from tests.replay.test_cli import recording

TRACKS = {"a.mcap": 0.0, "b.mcap": 0.1}


def tracked(raw: Path, path: Path, later_s: float = 0.0) -> Path:
    """A track of a run; the zero of its file is ``later_s`` after the run's."""
    run = read_run(raw)
    n = 50
    time_s, same = np.arange(n) / 240, np.full(n, 1e-5)
    trace = TipTrace(time_s, same, same, same, same, same, same, np.ones(n, bool), np.arange(n))
    write_tip(path, trace, run.metadata, run.sha256, run.zero_time_ns + round(later_s * 1e9))
    return path


def test_a_track_is_aligned_with_the_pressure_of_its_run_by_the_absolute_clock(tmp_path: Path) -> None:
    recording(tmp_path / "raw.mcap", tip=False)
    tip = tracked(tmp_path / "raw.mcap", tmp_path / "tip.mcap", later_s=0.25)
    for order in ([tmp_path / "raw.mcap", tip], [tip, tmp_path / "raw.mcap"]):
        (run,) = gather(order)
        assert run.pressure is not None
        assert run.tip is not None
        assert run.tip.time_s[0] == pytest.approx(0.25, abs=1e-9)


def test_two_tracks_of_one_run_are_an_error(tmp_path: Path) -> None:
    recording(tmp_path / "raw.mcap", tip=False)
    tips = [tracked(tmp_path / "raw.mcap", tmp_path / name, later_s) for name, later_s in TRACKS.items()]
    with pytest.raises(ReplayError, match=r"b\.mcap: a second track of .*raw\.mcap"):
        gather([tmp_path / "raw.mcap", *tips])


def test_a_track_without_its_run_is_an_error_with_its_cure(tmp_path: Path) -> None:
    recording(tmp_path / "raw.mcap", tip=False)
    with pytest.raises(ReplayError, match="the run it was tracked from"):
        gather([tracked(tmp_path / "raw.mcap", tmp_path / "tip.mcap")])


def test_the_same_recording_twice_is_an_error(tmp_path: Path) -> None:
    recording(tmp_path / "raw.mcap")
    shutil.copy(tmp_path / "raw.mcap", tmp_path / "copy.mcap")
    for other in ("raw.mcap", "copy.mcap"):
        with pytest.raises(ReplayError, match=rf"{other}: the same recording as .*raw\.mcap; give it once"):
            gather([tmp_path / "raw.mcap", tmp_path / other])
