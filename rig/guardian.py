"""Guardian: a process of its own that holds the port, and vents when the script dies or hangs.

The script talks to it through two pipes (``rig/guarded.py`` is the other end), which the operating system closes when
the script ends, however it ends: SIGKILL, a crash, the task manager. The driver and its limits live here, so nothing a
script does to its own objects reaches the instrument. It shares neither terminal nor process group with the script
(on Windows neither console nor job), so that the Ctrl-C or the closed window that ends the script does not end it.
It sends a heartbeat to the script and its standby (``rig/standby.py``): without one it is ended, and the standby, which
also survives when guardian and script are both killed, vents.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import threading
import time
from collections.abc import Callable
from typing import Any, BinaryIO

from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.errors import LimitError, LinkLostError, RigError
from straw.rig.final_vent import PULSE_S, Notes, Orders, vent_until_confirmed
from straw.rig.interrupts import NAMES
from straw.rig.script_requests import Requests
from straw.rig.standby import Standby

STUCK_S = 0.5  # a driver inside one call for longer counts as hanging; it waits for answers in slices of 0.02 s
Reply = Callable[[int, Any], None]  # (number of the request, answer); number 0 is a heartbeat


class Guardian:
    """Serves one script, request by request, until the script ends; its last action is the vent."""

    def __init__(self, orders: Orders, requests: Requests) -> None:
        self.orders = orders
        self.requests = requests
        self.controller: Controller = make_controller(orders.name, orders.port, **orders.settings)
        self.controller.progress = self._got_on
        self.under_pressure: set[int] = set()  # channels that may be
        self.refuses = ""
        self.notes = Notes(f"guardian of {orders.name} on {orders.port}")
        self.told_to_end = False
        self._fresh_until_s = time.monotonic() + STUCK_S
        self._idle = self._may_hurry = False
        self._standby = Standby(orders)
        self._does: dict[str, Callable[..., Any]] = {
            "set": self._set,
            "read": self._read,
            "trigger": self.controller._trigger,
            "vent": self._vent,
            "snapshot": self.controller.snapshot,
            "note": self._note,
            "beat": lambda: None,
        }

    def serve(self, number: int, reply: Reply) -> None:
        """Open, serve, and vent at the end, however it ends."""
        threading.Thread(target=self._pulse, args=(reply,), daemon=True).start()
        try:
            self.controller.open()
        except Exception as error:
            self._standby.dismiss()
            reply(number, error)
            return
        reply(number, None)
        self._obey(reply)
        self._final_vent(final=True)
        self._standby.dismiss()

    def _obey(self, reply: Reply) -> None:
        while True:
            self._idle = True
            try:
                request = self.requests.get(self.orders.heartbeat_s if self.under_pressure else None)
            except queue.Empty:
                self._got_on()
                self._idle = False
                self.refuses = f"the script was silent for {self.orders.heartbeat_s:g} s, so its guardian vented"
                self.notes.say("heartbeat", self.refuses)
                self._final_vent()
                continue
            self._got_on()
            self._idle = False
            if isinstance(request, str):
                self.notes.say("guardian", request)
                self.under_pressure.update(self.controller.channels)
                return
            number, (what, arguments) = request
            if what == "close":
                # its vent failed: the script has reported it, and whoever reads its output need not wait for this
                # process
                if self.under_pressure:
                    self.notes.say("guardian", f"process {os.getpid()} keeps trying to vent in the background")
                    _leave_terminal()
                reply(number, None)
                return
            try:
                self._may_hurry = what in ("set", "read", "trigger")
                answer = self._does[what](*arguments)
            except Exception as error:
                answer = error
            self._may_hurry = False
            reply(number, answer)

    def _set(self, channel: int, pressure_pa: float) -> bytes:
        self._check_trusted()
        self.under_pressure.add(channel)
        return self.controller.set_pressure(channel, pressure_pa).raw

    def _read(self) -> Any:
        self._check_trusted()
        return self.controller._read()

    def _check_trusted(self) -> None:
        if self.refuses:
            raise LimitError(f"{self.refuses}; nothing was sent; open the controller again")

    def _vent(self, channel: int) -> None:
        try:
            self.controller.vent_channel(channel)
        # the link to the instrument is lost, not the guardian: another guardian would not help
        except LinkLostError as error:
            raise RigError(f"{error}; its guardian, process {os.getpid()}, keeps trying") from None
        self.under_pressure.discard(channel)

    def _note(self, path: str) -> None:
        self.notes.path = path
        self._standby.note(path)

    def _final_vent(self, final: bool = False) -> None:
        """Vent, again and again if need be: a lost link may return."""
        if not self.under_pressure:
            self.controller._close()
            return

        def failed() -> None:
            self._got_on()
            if final:  # whoever reads the command's output must not wait for this process
                _leave_terminal()

        if vent_until_confirmed(
            self.controller.vent,
            self.notes,
            self.orders.patience_s,
            told_to_end=lambda: self.told_to_end,
            failed=failed,
        ):
            self.under_pressure.clear()
            self.notes.say("vent", "confirmed by the controller, asked by the guardian")

    def _got_on(self, next_s: float = 0.0) -> None:
        """The driver made progress; its next step may take ``next_s``. A queued vent ends any other wait."""
        self._fresh_until_s = time.monotonic() + STUCK_S + next_s
        if self._may_hurry and self.requests.urgent:
            self._may_hurry = False
            raise RigError("abandoned: a vent was requested meanwhile")

    def _pulse(self, reply: Reply) -> None:
        """Send a heartbeat: to the standby always, to the script while it waits for an answer."""
        while True:
            if self._idle or time.monotonic() < self._fresh_until_s:
                self._standby.pulse()
                if not self._idle:
                    reply(0, None)
            time.sleep(PULSE_S)


def main() -> None:
    """Serve the script at the other end of stdin and stdout."""
    # Streams of its own: a thread must not still read sys.stdin at the end, or Python aborts.
    words, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of a vendor's library must not get between the replies
    requests = Requests()
    lock = threading.Lock()
    guardians: list[Guardian] = []

    def reply(number: int, answer: Any) -> None:
        try:
            with lock:
                pickle.dump((number, answer), replies)
                replies.flush()
        except OSError:
            if number:  # the reader has ended
                requests.put("the script ended without closing the controller")

    def told_to_end(number: int, _: object) -> None:
        for guardian in guardians:
            guardian.told_to_end = True
        requests.put(f"the guardian was told to end ({signal.Signals(number).name})")

    for name in NAMES:
        if number := getattr(signal, name, None):
            signal.signal(number, told_to_end)
    asked, orders = pickle.load(words)
    try:
        guardians.append(Guardian(orders, requests))
    except RigError as error:
        reply(asked, error)
        return
    threading.Thread(target=_listen, args=(words, requests), daemon=True).start()
    guardians[0].serve(asked, reply)


def _listen(stream: BinaryIO, requests: Requests) -> None:
    try:
        while True:
            requests.put(pickle.load(stream))
    except (EOFError, OSError, pickle.UnpicklingError):  # a script killed in the middle of a request has ended, too
        requests.put("the script ended without closing the controller")


def _leave_terminal() -> None:
    with contextlib.suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        os.close(nowhere)
