"""Pulse: a file, rewritten twice a second, that shows a page that a loop's process is alive and what it does."""

from __future__ import annotations

import json
import os
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

PULSE = "pulse.json"
BEATS_S = 0.5
#: An older pulse is that of a dead or stopped process: ten beats, as a busy machine skips some.
DEAD_S = 5.0


class Pulse:
    """While entered, ``pulse.json`` in a folder holds the process' id and its last activity."""

    def __init__(self, place: Path) -> None:
        self.path = place / PULSE
        self._said: dict[str, Any] = {"pid": os.getpid(), "since_ns": time.time_ns(), "doing": "begin"}
        self._ends, self._lock = threading.Event(), threading.Lock()

    def tell(self, doing: str, done: int = 0, total: int = 0, **more: Any) -> None:
        """Set the activity and its progress; ``asked``: a question that waits for an answer."""
        before = self._said
        kept = {key: before[key] for key in ("pid", "since_ns")}
        self._said = {**kept, "doing": doing, "done": done, "total": total, **more}
        if self._said.get("asked") != before.get("asked"):
            self._beat()  # at once, so that an answered question is not answered again

    def __enter__(self) -> Self:
        self._beat()
        self._thread = threading.Thread(target=self._beats, name="pulse", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._ends.set()
        self._thread.join()
        with suppress(OSError):
            self.path.unlink()

    def _beats(self) -> None:
        while not self._ends.wait(BEATS_S):
            self._beat()

    def _beat(self) -> None:
        part = self.path.with_suffix(".part")
        with self._lock, suppress(OSError):  # a full disk is reported by whatever must write
            part.write_text(json.dumps(self._said), encoding="utf-8")
            part.replace(self.path)


def read_pulse(place: Path) -> dict[str, Any] | None:
    """The last state of a loop's process; None where none is alive."""
    path = place / PULSE
    try:
        if time.time() - path.stat().st_mtime > DEAD_S:
            return None
        said = json.loads(path.read_text(encoding="utf-8"))
        return said if isinstance(said, dict) and isinstance(said["pid"], int) else None
    except (OSError, ValueError, KeyError):
        return None
