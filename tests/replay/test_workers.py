"""Worker processes of a command end when it does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

#: A command with a worker that is busy for longer than the test and writes its process id.
COMMAND = """
import os, sys, time
from straw.replay.workers import workers

def busy(path):
    open(path, "w").write(str(os.getpid()))
    time.sleep(60)

if __name__ == "__main__":
    with workers(2) as pool:
        pool.submit(busy, sys.argv[1]).result()
"""


def running(process: int) -> bool:
    """Whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks /proc whether a process still runs")
def test_a_worker_in_the_middle_of_a_job_ends_when_its_command_is_killed(tmp_path: Path) -> None:
    script, written = tmp_path / "command.py", tmp_path / "worker"
    script.write_text(COMMAND)
    with subprocess.Popen([sys.executable, str(script), str(written)]) as command:
        late = time.monotonic() + 60
        while not (written.exists() and written.read_text()) and time.monotonic() < late:
            time.sleep(0.05)
        worker = int(written.read_text())
        assert running(worker)
        os.kill(command.pid, signal.SIGKILL)
    late = time.monotonic() + 30
    while running(worker) and time.monotonic() < late:
        time.sleep(0.05)
    assert not running(worker)
