"""Standby: a second process behind the guardian, which vents when guardian and script are both gone or hang.

The guardian starts it, and holds the only end of its pipe: when that closes without a word, the guardian was killed.
Then, or when the guardian gives no sign of life (stopped, or inside a vendor's library that does not return) and had to
be ended, the standby opens the port, which is then free, and vents. It is detached from the tree of
processes, so that killing the script with all its children does not reach it. It cannot help if it is killed as well,
or when the computer fails; see rig/README.md.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import threading
from contextlib import suppress
from typing import Any, BinaryIO

from straw.rig.detached import start_detached
from straw.rig.drivers import make_controller
from straw.rig.errors import RigError
from straw.rig.final_vent import SILENT_S, Notes, Orders, Silence, vent_until_confirmed
from straw.rig.interrupts import NAMES

RESTARTS = 3
LATER_S = 0.3  # after the script's own deadline, so that the script, which writes the record, acts first
Word = tuple[str, Any]


class Standby:
    """The guardian's handle on the standby: start it, keep it informed, dismiss it when all is well."""

    def __init__(self, orders: Orders) -> None:
        self._orders = orders
        self._note = ""
        self._starts = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._begin()

    def note(self, path: str) -> None:
        """Where to record what it did."""
        self._note = path
        self._tell("note", path)

    def pulse(self) -> None:
        """Send a heartbeat; a standby that has ended is replaced."""
        if not self._tell("pulse", None) and self._starts < RESTARTS:
            self._begin()

    def dismiss(self) -> None:
        """Nothing is under pressure: end the standby."""
        self._tell("dismissed", None)
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()

    def _begin(self) -> None:
        self._starts += 1
        self._process = start_detached("straw.rig.standby", answers=False)
        assert self._process.stdin is not None
        self._tell("orders", (self._orders, os.getpid()))
        self._tell("note", self._note)
        with suppress(OSError, AttributeError):  # a stopped standby must not stop the guardian
            os.set_blocking(self._process.stdin.fileno(), False)
        threading.Thread(target=self._process.wait, daemon=True).start()  # its first process ends at once

    def _tell(self, what: str, value: Any) -> bool:
        """Whether the standby received it."""
        if self._process is None or self._process.stdin is None:
            return False
        try:
            os.write(self._process.stdin.fileno(), pickle.dumps((what, value)))
        except BlockingIOError:
            return True  # it is stopped
        except (OSError, ValueError):
            return False
        return True


def main() -> None:
    """Listen to the guardian on stdin until it dismisses us, or is gone."""
    if hasattr(os, "fork") and os.fork():
        os._exit(0)  # end the intermediate process, so that the standby has no parent among the script's processes
    told: list[int] = []
    for name in NAMES:
        if number := getattr(signal, name, None):
            signal.signal(number, lambda number, _: told.append(number))
    words: queue.SimpleQueue[Word | None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(os.fdopen(os.dup(0), "rb"), words), daemon=True).start()
    first = words.get()
    if first is None:
        return
    orders, guardian_pid = first[1]
    try:
        controller = make_controller(orders.name, orders.port, **orders.settings)
    except RigError:
        return  # the guardian says it
    import serial  # noqa: F401  now, not when every millisecond counts

    notes = Notes(f"standby of {orders.name} on {orders.port}")
    why = _watch(words, guardian_pid, notes)
    if not why:
        return
    notes.say("standby", f"{why}: the standby vents")
    told.clear()

    def vent() -> None:
        controller.open()  # which vents
        controller._close()

    if vent_until_confirmed(vent, notes, orders.patience_s, told_to_end=lambda: bool(told)):
        notes.say("vent", "confirmed by the controller, asked by the standby")


def _watch(words: queue.SimpleQueue[Word | None], guardian_pid: int, notes: Notes) -> str:
    """Why the standby has to act; empty when it was dismissed."""
    silence = Silence(SILENT_S + LATER_S)
    while True:
        try:
            word = words.get(timeout=Silence.SLICE_S)
        except queue.Empty:
            if not silence.waited():
                continue
            with suppress(OSError):
                os.kill(guardian_pid, getattr(signal, "SIGKILL", signal.SIGTERM))
            return f"guardian {guardian_pid} gave no sign of life for {silence.limit_s:g} s and was ended"
        silence.heard()
        if word is None:
            return f"guardian {guardian_pid} was killed"
        what, value = word
        if what == "dismissed":
            return ""
        if what == "note":
            notes.path = value


def _listen(stream: BinaryIO, words: queue.SimpleQueue[Word | None]) -> None:
    try:
        while True:
            words.put(pickle.load(stream))
    except (EOFError, OSError, pickle.UnpicklingError):
        words.put(None)
