"""A disk that fills up during a run of the lab: the straw is vented, one line says so, what was recorded is kept."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import namedtuple
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from straw.replay.lab import bench, processes
from straw.replay.lab.queue import Queue
from straw.rig.run_read import read_run
from tests.replay.lab import ServedLab

LONG = 'name = "long"\npressure_unit = "kPa"\ninitial_deployed = [1]\nmain = [{ hold = 5, for_s = 60 }]\n'
#: Stands for a full disk: writes beyond this file size fail.
LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000))
from straw.replay.cli import main
sys.exit(main(sys.argv[1:]))
"""


def limited(words: Sequence[str], stream: BinaryIO) -> subprocess.Popen[bytes]:
    without = [word for word in words if word not in ("--live", "127.0.0.1:0", "--watched")]  # a page is slow to answer
    return subprocess.Popen([sys.executable, "-P", "-c", LIMITED, *without], stdout=stream, stderr=stream)


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files by POSIX means")
def test_a_full_disk_vents_and_is_reported_in_one_line_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "started", limited)
    with ServedLab(tmp_path, emulate=True) as lab:
        lab.post("queue", do="add", toml=LONG)
        lab.post("arm", on=True)
        lab.post("start")
        rig = lab.lab.bench
        lab.until(lambda: rig.queue.held, 60)
        said = rig.queue.held
        assert "File too large; check space" in said
        assert "vent confirmed" in said
        assert "\n" not in said
        lab.until(lambda: rig.said[-1][1].endswith(said))
        assert not rig.armed  # nothing starts by itself on a full disk,
        assert [item.name for item in rig.queue.items] == ["long"]  # and what was not run stays in the queue
        (part,) = tmp_path.glob("*.mcap.part")
        lab.until(lambda: lab.get("/api/runs?where=cut")["total"] == 1)
        kept = read_run(tmp_path / lab.post("recover", name=part.name)["path"])
        assert kept.pressure is not None
        assert len(kept.pressure) > 50


def test_where_a_full_disk_also_loses_the_message_the_lab_reports_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(processes.shutil, "disk_usage", lambda folder: usage(0))
    assert "is full; make room" in processes.silent_end(2, tmp_path / "run.log")
    monkeypatch.setattr(processes.shutil, "disk_usage", lambda folder: usage(10**9))
    assert "full" not in processes.silent_end(2, tmp_path / "run.log")


def test_a_queue_that_cannot_be_written_is_kept_in_memory_and_leaves_no_partial_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    queue = Queue(tmp_path / "queue.json")
    queue.add(LONG, "s", 1, 0.0)
    before = (tmp_path / "queue.json").read_bytes()

    def full(self: Path, text: str, encoding: str) -> int:
        self.write_bytes(b"[")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    queue.add(LONG, "s", 1, 0.0)
    assert len(queue.items) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["queue.json"]
    assert (tmp_path / "queue.json").read_bytes() == before
