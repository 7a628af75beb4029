"""Commands started from the lab's pages: their progress is visible while they run, their output when they are done."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from straw.replay.lab import work
from straw.replay.lab.work import Jobs
from tests.replay.lab import ServedLab

#: Does 3 of 40, reports it as every command does, and continues when a file appears.
SLOW = """
import sys, time
from pathlib import Path
from straw.replay.progress import progress_bar
with progress_bar("fit") as update:
    update(3, 40)
    while not Path(sys.argv[1]).exists():
        time.sleep(0.02)
print("named")
"""


def test_the_progress_of_a_job_is_visible_while_others_wait_for_their_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "STRAW", (sys.executable, "-P", "-c", SLOW))
    monkeypatch.setattr(work, "MOST_JOBS", 1)
    jobs, go = Jobs(tmp_path / "work"), tmp_path / "go"
    first = jobs.start("first", [str(go)])
    ServedLab.until(lambda: jobs.as_data(first.id)["progress"])
    assert jobs.as_data(first.id)["progress"] == {"what": "fit", "done": 3, "total": 40}
    second = jobs.start("second", [str(go)])
    assert jobs.as_data(second.id)["waits"]
    go.touch()
    ServedLab.until(lambda: not jobs.as_data(second.id)["running"])
    said = jobs.as_data(first.id)
    assert (said["well"], said["said"].strip(), said["progress"]) == (True, "named", None)


def test_a_job_outlives_its_lab_and_is_found_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work, "STRAW", (sys.executable, "-P", "-c", SLOW))
    go = tmp_path / "go"
    job = Jobs(tmp_path / "work").start("slow", [str(go)])
    ServedLab.until(lambda: work.progress_in(job.folder))
    later = Jobs(tmp_path / "work")
    if os.name == "posix":
        assert (later.as_data(job.id)["running"], later.as_data(job.id)["progress"]["done"]) == (True, 3)
        other = Jobs(tmp_path / "work").start("other", [str(go)])
        ServedLab.until(lambda: work.progress_in(other.folder))
        later.stop(other.id)
        ServedLab.until(lambda: not later.as_data(other.id)["running"])
    go.touch()
    ServedLab.until(lambda: "named" in later.as_data(job.id)["said"])
    ServedLab.until(lambda: not later.as_data(job.id)["running"])
