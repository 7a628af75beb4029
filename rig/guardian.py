"""Guardian: a process of its own that holds the port and has its last word: when the script dies or hangs, it vents.

The script talks to it through two pipes (``rig/guarded.py`` is the other end), which the operating system closes when
the script ends, however it ends: SIGKILL, a crash, the task manager. The driver and its limits live here, so nothing a
script does to its own objects reaches the instrument. It shares neither terminal nor process group with the script
(on Windows neither console nor job), so that the Ctrl-C or the closed window that ends the script does not end it.
What it cannot survive: its own death by force together with the script's, and the computer's. If it alone dies, the
script sees the link lost, starts another one, and vents through that.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

from rig.controller import Controller, make_controller
from rig.errors import LimitError, LinkLostError, RigError
from rig.interrupts import NAMES

RETRY_S = 0.2
Reply = Callable[[int, Any], None]  # (number of the request, answer)
Requests: TypeAlias = "queue.SimpleQueue[tuple[int, Any] | None]"  # None: the script has ended


@dataclass(frozen=True)
class Orders:
    """What a guardian is told once: the driver it holds, how long the script may be silent, how long it keeps trying.

    ``heartbeat_s`` counts only while something may be under pressure; ``patience_s`` while a vent is not confirmed.
    """

    name: str
    port: str
    settings: dict[str, Any] = field(default_factory=dict)
    heartbeat_s: float = 2.0
    patience_s: float = 600.0


class Guardian:
    """Obeys one script, request by request, until that ends; the last thing it does is vent."""

    def __init__(self, orders: Orders, requests: Requests) -> None:
        self.orders = orders
        self.requests = requests
        self.controller: Controller = make_controller(orders.name, orders.port, **orders.settings)
        self.under_pressure: set[int] = set()  # channels that may be
        self.refuses = ""
        self.note = ""
        self._does: dict[str, Callable[..., Any]] = {
            "set": self._set,
            "read": self.controller._read,
            "trigger": self.controller._trigger,
            "vent": self._vent,
            "snapshot": self.controller.snapshot,
            "note": lambda path: setattr(self, "note", path),
            "beat": lambda: None,
        }

    def serve(self, number: int, reply: Reply) -> None:
        """Open, obey, and vent at the end whatever the end is."""
        try:
            self.controller.open()
        except Exception as error:
            reply(number, error)
            return
        reply(number, None)
        self._obey(reply)
        self._last_word()

    def _obey(self, reply: Reply) -> None:
        while True:
            try:
                request = self.requests.get(timeout=self.orders.heartbeat_s if self.under_pressure else None)
            except queue.Empty:
                self.refuses = f"the script was silent for {self.orders.heartbeat_s:g} s, so its guardian vented"
                self._say("heartbeat", self.refuses)
                self._last_word()
                continue
            if request is None:  # the script ended without a word
                self._say("guardian", "the script ended without closing the controller")
                self.under_pressure.update(self.controller.channels)
                return
            number, (what, arguments) = request
            if what == "close":
                reply(number, None)
                return
            try:
                answer = self._does[what](*arguments)
            except Exception as error:
                answer = error
            reply(number, answer)

    def _set(self, channel: int, pressure_pa: float) -> bytes:
        if self.refuses:
            raise LimitError(f"{self.refuses}; nothing was sent; open the controller again")
        self.under_pressure.add(channel)
        return self.controller.set_pressure(channel, pressure_pa).raw

    def _vent(self, channel: int) -> None:
        try:
            self.controller.vent_channel(channel)
        except LinkLostError as error:  # a lost link to the instrument is no lost guardian: no use in starting another
            raise RigError(f"{error}; its guardian, process {os.getpid()}, keeps trying") from None
        self.under_pressure.discard(channel)

    def _last_word(self) -> None:
        """Vent, again and again if need be: a lost link may return."""
        if not self.under_pressure:
            self.controller._close()
            return
        give_up_s = time.monotonic() + self.orders.patience_s
        said = ""
        while True:
            try:
                self.controller.vent()
                self.under_pressure.clear()
                self._say("vent", "confirmed by the controller, asked by the guardian")
                return
            except RigError as error:
                if str(error) != said:
                    said = str(error)
                    self._say("vent", f"{error} (the guardian keeps trying)")
            if time.monotonic() > give_up_s:
                self._say("vent", f"the guardian gave up after {self.orders.patience_s:g} s")
                return
            time.sleep(RETRY_S)

    def _say(self, kind: str, text: str) -> None:
        """To whoever still watches the terminal, and beside the recording that the script can no longer write."""
        with contextlib.suppress(OSError, ValueError):
            print(f"guardian of {self.orders.name} on {self.orders.port}: {text}", file=sys.stderr, flush=True)
        if self.note:
            with contextlib.suppress(OSError), Path(self.note).open("a", encoding="utf-8") as notes:
                notes.write(json.dumps({"wall_ns": time.time_ns(), "kind": kind, "text": text}) + "\n")


def main() -> None:
    """Serve the script at the other end of stdin and stdout."""
    # Streams of its own: what a thread still reads from at the end must not be sys.stdin, or Python aborts there.
    words, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a vendor's library prints must not get between the replies
    requests: Requests = queue.SimpleQueue()
    for name in NAMES:
        if number := getattr(signal, name, None):
            signal.signal(number, lambda *_: requests.put(None))  # told to end: as if the script had ended
    number, orders = pickle.load(words)
    threading.Thread(target=_listen, args=(words, requests), daemon=True).start()

    def reply(number: int, answer: Any) -> None:
        try:
            pickle.dump((number, answer), replies)
            replies.flush()
        except OSError:
            requests.put(None)  # nobody is left to hear it

    try:
        guardian = Guardian(orders, requests)
    except RigError as error:
        reply(number, error)
        return
    guardian.serve(number, reply)


def _listen(stream: BinaryIO, requests: Requests) -> None:
    try:
        while True:
            requests.put(pickle.load(stream))
    except (EOFError, OSError, pickle.UnpicklingError):  # a script killed in the middle of a word has ended, too
        requests.put(None)
