"""GuardedController: a controller whose port is held by a guardian process, which vents when the script dies."""

from __future__ import annotations

import pickle
import queue
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from straw.rig.controller import Controller
from straw.rig.detached import start_detached
from straw.rig.drivers import make_controller
from straw.rig.errors import LinkLostError
from straw.rig.final_vent import SILENT_S, Orders, Silence
from straw.rig.ports import remember
from straw.rig.reading import Answer

START_S = 20.0  # until the first heartbeat: a slow disk, a virus scanner
GONE_S = 1.0  # how long a guardian may take to end after it was asked to or killed
RELEASE_S = 3.0  # after a guardian's death its standby holds the port while it vents
Answers = queue.SimpleQueue[tuple[int, Any] | None]


class GuardedController(Controller):
    """The controller called ``name`` on ``port``, behind a guardian; used like any other.

    While anything may be under pressure the script must call at least every ``heartbeat_s`` seconds: each set and read
    counts, and ``beat`` in pauses. If the script is silent for longer, the guardian vents and refuses its sets and
    reads until the controller is opened again. If a vent cannot be confirmed, the guardian stays for up to
    ``patience_s`` and vents when the link returns. A guardian without a heartbeat of its own is ended, and its standby
    vents. Unless ``remembered`` is False, as for an emulator of one's own, ``straw rig vent`` finds the port again.
    ``settings`` are the driver's.
    """

    def __init__(
        self,
        name: str,
        port: str,
        *,
        heartbeat_s: float = 2.0,
        patience_s: float = 600.0,
        remembered: bool = True,
        **settings: Any,
    ) -> None:
        if name.endswith(".py"):
            name = str(Path(name).resolve())  # the guardian may be started in another folder
        driver = make_controller(name, port, **settings)  # checks the settings here; only the guardian opens it
        self.name, self.port, self.span = driver.name, port, driver.span
        self.resolution_pa, self.byte_s = driver.resolution_pa, driver.byte_s
        super().__init__(channels=driver.channels, limits=driver.limits, sigma_pa=driver.sigma_pa)
        self._orders = Orders(name, port, settings, heartbeat_s, patience_s)
        self._process: subprocess.Popen[bytes] | None = None
        self._answers: Answers = queue.SimpleQueue()
        self._asked = 0
        self._lost_s = float("-inf")
        self._record = ""
        self._remembered = remembered
        self._is_remembered = False

    @property
    def guardian_pid(self) -> int | None:
        """Process id of the guardian, None while there is none."""
        return self._process.pid if self._process else None

    @property
    def heartbeat_s(self) -> float:
        """How long the script may be silent, s."""
        return self._orders.heartbeat_s

    def _open(self) -> None:
        while True:
            self._process = start_detached("straw.rig.guardian", answers=True)
            self._answers = queue.SimpleQueue()
            threading.Thread(target=_listen, args=(self._process.stdout, self._answers), daemon=True).start()
            try:
                self._exchange(self._orders, START_S)
                self._remember(self._process.pid)  # nothing is under pressure yet
                if self._record:
                    self._call("note", self._record)
                return
            except LinkLostError:
                self._let_go()
                if time.monotonic() > self._lost_s + RELEASE_S:
                    raise
            except BaseException:
                self._let_go()
                raise

    def _close(self) -> None:
        if self._process is None:
            return
        with suppress(Exception):  # it has ended already, or ends by the closed pipe
            self._call("close")
        self._let_go()

    def _remember(self, guardian_pid: int) -> None:
        if self._remembered:
            remember(self.port, self._orders.name, self._orders.settings, guardian_pid)
            self._is_remembered = True

    def _send(self, channel: int, pressure_pa: float) -> bytes:
        raw: bytes = self._call("set", channel, pressure_pa)
        return raw

    def _read(self) -> Answer:
        answer: Answer = self._call("read")
        return answer

    def _vent(self, channel: int) -> None:
        self._call("vent", channel)

    def _trigger(self, high: bool) -> None:
        self._call("trigger", high)

    def beat(self) -> None:
        """Signal that the script is alive, in pauses in which it neither sets nor reads."""
        with self._lock:
            self._call("beat")

    def record_in(self, path: Path) -> None:
        """Where the guardian records what it did after the script's end."""
        self._record = str(path.absolute())
        self._call("note", self._record)

    def snapshot(self) -> dict[str, str]:
        """The driver's own snapshot, and how it is guarded."""
        said: dict[str, str] = self._call("snapshot")
        return {**said, "guardian": f"heartbeat {self._orders.heartbeat_s:g} s"}

    def _call(self, what: str, *arguments: Any) -> Any:
        return self._exchange((what, arguments))

    def _exchange(self, message: Any, first_s: float = 0.0) -> Any:
        """One request to the guardian; LinkLostError when it has ended, or without a heartbeat for ``SILENT_S``."""
        process = self._process
        if process is None or process.stdin is None:
            raise LinkLostError(f"{self.name} is not open; open it first")
        self._asked += 1
        try:
            pickle.dump((self._asked, message), process.stdin)
            process.stdin.flush()
        except OSError:
            raise self._lost(process, "ended unexpectedly") from None
        silence = Silence(first_s or SILENT_S)
        while True:
            try:
                said = self._answers.get(timeout=Silence.SLICE_S)
            except queue.Empty:
                if silence.waited():
                    process.kill()
                    why = f"gave no sign of life for {silence.limit_s:g} s (stopped, or its driver hangs) and was ended"
                    raise self._lost(process, why) from None
                continue
            if said is None:
                raise self._lost(process, "ended unexpectedly")
            number, answer = said
            if number == self._asked:
                break
            silence = Silence(SILENT_S)  # a heartbeat, or an answer that Ctrl-C left unread
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _lost(self, process: subprocess.Popen[bytes], how: str) -> LinkLostError:
        self._lost_s = time.monotonic()
        return LinkLostError(
            f"{self.name}: its guardian process {process.pid} {how}; its standby vents; start again, and make sure "
            f"with: {self.vent_command}"
        )

    def _let_go(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        with suppress(OSError):  # unsent requests to a guardian that has ended
            process.stdin.close() if process.stdin else None
        try:
            process.wait(timeout=GONE_S)
            if self._is_remembered:
                self._remember(0)
        except subprocess.TimeoutExpired:
            process.returncode = 0  # it stays to vent when the link returns, and must not become a zombie


def _listen(stream: BinaryIO, answers: Answers) -> None:
    """Unpickle the guardian's answers, in a thread, so that a guardian that hangs blocks nothing."""
    with suppress(EOFError, OSError, pickle.UnpicklingError), stream:
        while True:
            answers.put(pickle.load(stream))
    answers.put(None)
