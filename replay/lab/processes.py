"""Processes: commands of straw that outlive the lab: how they are started, found again, and told to end."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from straw.rig.orders import control_of as control_file
from straw.rig.orders import read_control, running

#: Free bytes below which a disk counts as full, as files take whole blocks of some kB.
FULL = 100_000
STRAW = (sys.executable, "-P", "-m", "straw.replay.cli")


def started(words: Sequence[str], stream: BinaryIO) -> subprocess.Popen[bytes]:
    """A command of straw in a session of its own: it outlives this process, its terminal and its pages."""
    return subprocess.Popen(
        [*STRAW, *words],
        stdin=subprocess.DEVNULL,
        stdout=stream,
        stderr=stream,
        start_new_session=True,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )


def going_on(recording: Path) -> dict[str, Any] | None:
    """A run that answers, or whose process exists but does not answer."""
    said = running(recording)
    if said is None and os.name == "posix":
        said = read_control(control_file(recording))
        with suppress(OSError, ValueError, KeyError):
            if said is not None:
                os.kill(int(said["pid"]), 0)
                return {**said, "state": "does not answer"}
        return None
    return said


def plain(name: str) -> str:
    """A name as part of a file's."""
    return "".join(c if c.isalnum() or c in "-_." else "-" for c in name).strip("-.") or "run"


def silent_end(code: int, log: Path) -> str:
    """Explanation for a command that ended without a message: a full disk loses it, too."""
    with suppress(OSError):
        if shutil.disk_usage(log.parent).free < FULL:
            return f"the run ended with code {code} and could not say why: the disk of {log.parent} is full; make room"
    return f"the run ended with code {code} without a message; straw rig run in a terminal shows more"


def interrupt(pid: int) -> None:
    """As Ctrl-C: the run vents, finishes its file and ends."""
    number = getattr(signal, "CTRL_BREAK_EVENT", None) or signal.SIGINT
    with suppress(OSError):
        os.kill(pid, number)
