"""The final vent: repeated until the controller confirms it, and recorded."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError

RETRY_S = 0.2
PULSE_S = 0.2  # period of the guardian's heartbeat
SILENT_S = 1.0  # without a heartbeat for so long it counts as hanging: five in a row are missing


@dataclass(frozen=True)
class Orders:
    """Settings of a guardian: the driver it holds, how long the script may be silent, how long it keeps trying.

    ``heartbeat_s`` counts only while something may be under pressure; ``patience_s`` while a vent is not confirmed.
    """

    name: str
    port: str
    settings: dict[str, Any] = field(default_factory=dict)
    heartbeat_s: float = 2.0
    patience_s: float = 600.0


class Notes:
    """Reports what a process did after the script's end: on the terminal if there is one, and beside the recording."""

    def __init__(self, who: str) -> None:
        self.who = who
        self.path = ""

    def say(self, kind: str, text: str) -> None:
        """Print it, and append it to the file where there is one."""
        with contextlib.suppress(OSError, ValueError, AttributeError):  # the terminal was closed
            print(f"{self.who}: {text}", file=sys.stderr, flush=True)
        if self.path:
            with contextlib.suppress(OSError), Path(self.path).open("a", encoding="utf-8") as notes:
                notes.write(json.dumps({"wall_ns": time.time_ns(), "kind": kind, "text": text}) + "\n")


def vent_until_confirmed(
    vent: Callable[[], None],
    notes: Notes,
    patience_s: float,
    *,
    told_to_end: Callable[[], bool],
    failed: Callable[[], None] = lambda: None,
) -> bool:
    """Call ``vent`` until it raises no RigError; return whether it was confirmed.

    Gives up after ``patience_s``, or after the attempt during which it was told to end. ``failed`` is called after
    every attempt that failed.
    """
    give_up_s = time.monotonic() + patience_s
    said = ""
    while True:
        try:
            vent()
            return True
        except RigError as error:
            if str(error) != said:
                said = str(error)
                notes.say("vent", f"{error} (it keeps trying for up to {patience_s:g} s)")
        failed()
        if told_to_end():
            notes.say("vent", "told to end before the vent was confirmed")
            return False
        if time.monotonic() > give_up_s:
            notes.say("vent", f"gave up after {patience_s:g} s; the vent is not confirmed")
            return False
        time.sleep(RETRY_S)


class Silence:
    """Measures silence in slices, so that a computer that was suspended counts as one slice."""

    SLICE_S = 0.1

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        self._silent_s = 0.0

    def heard(self) -> None:
        """Start again at zero."""
        self._silent_s = 0.0

    def waited(self) -> bool:
        """One more slice passed in silence; return whether that is too long."""
        self._silent_s += self.SLICE_S
        return self._silent_s > self.limit_s
