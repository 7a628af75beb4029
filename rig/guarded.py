"""GuardedController: a controller whose port is held by a guardian process, so that a script that dies still vents."""

from __future__ import annotations

import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from rig.controller import Controller, make_controller
from rig.errors import LinkLostError
from rig.guardian import Orders
from rig.reading import Answer

# The directory this package came from, wherever that is: the guardian must run the same code as the script.
START = f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r}); from rig.guardian import main; main()"


class GuardedController(Controller):
    """The controller called ``name`` on ``port``, behind a guardian; used like any other.

    While anything may be under pressure the script has to be heard from every ``heartbeat_s`` seconds: each set and
    read counts, ``beat`` does where there is nothing to ask. A script that is silent for longer is vented, and its
    sets are refused until the controller is opened again. If a vent cannot be confirmed the guardian stays behind
    for up to ``patience_s`` and vents when the link returns. ``settings`` are the driver's.
    """

    def __init__(
        self, name: str, port: str, *, heartbeat_s: float = 2.0, patience_s: float = 600.0, **settings: Any
    ) -> None:
        driver = make_controller(name, port, **settings)  # checks the settings here; it is opened over there only
        self.name, self.span = driver.name, driver.span
        self.resolution_pa, self.byte_s = driver.resolution_pa, driver.byte_s
        super().__init__(channels=driver.channels, limits=driver.limits, sigma_pa=driver.sigma_pa)
        self._orders = Orders(name, port, settings, heartbeat_s, patience_s)
        self._process: subprocess.Popen[bytes] | None = None
        self._asked = 0

    @property
    def guardian_pid(self) -> int | None:
        """Process id of the guardian, None while there is none."""
        return self._process.pid if self._process else None

    @property
    def heartbeat_s(self) -> float:
        """How long the script may be silent, s."""
        return self._orders.heartbeat_s

    def _open(self) -> None:
        self._process = _start()
        try:
            self._exchange(self._orders)
        except BaseException:
            self._let_go()
            raise

    def _close(self) -> None:
        if self._process is None:
            return
        with suppress(Exception):  # gone already, or it finds out by the closed pipe
            self._call("close")
        self._let_go()

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
        """Say that the script is alive, for pauses in which it neither sets nor reads."""
        with self._lock:
            self._call("beat")

    def record_in(self, path: Path) -> None:
        """Where the guardian notes what it did after the script's end."""
        self._call("note", str(path.absolute()))

    def snapshot(self) -> dict[str, str]:
        """What the driver says of itself, and how it is guarded."""
        said: dict[str, str] = self._call("snapshot")
        return {**said, "guardian": f"heartbeat {self._orders.heartbeat_s:g} s"}

    def _call(self, what: str, *arguments: Any) -> Any:
        return self._exchange((what, arguments))

    def _exchange(self, message: Any) -> Any:
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            raise LinkLostError(f"{self.name} is not open; open it first")
        try:
            self._asked += 1
            pickle.dump((self._asked, message), process.stdin)
            process.stdin.flush()
            answered = 0
            while answered != self._asked:  # Ctrl-C may have left an answer unread
                answered, answer = pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            raise LinkLostError(
                f"{self.name}: its guardian process {process.pid} was lost; somebody ended it: start again"
            ) from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _let_go(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # unsent words to a guardian that is gone
                stream.close() if stream else None
        try:
            process.wait(timeout=1.0)
        except subprocess.TimeoutExpired:
            process.returncode = 0  # it stays behind to vent when the link returns, and is nobody's zombie after us


def _start() -> subprocess.Popen[bytes]:
    """A guardian out of reach of what ends the script: other session and group, on Windows other console and job."""

    def started(flags: int) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-c", START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # POSIX
            creationflags=flags,  # Windows
        )

    apart, freed = (
        sum(getattr(subprocess, name, 0) for name in names)
        for names in (("DETACHED_PROCESS", "CREATE_NEW_PROCESS_GROUP"), ("CREATE_BREAKAWAY_FROM_JOB",))
    )
    try:
        return started(apart | freed)
    except OSError:
        if not freed:
            raise
        return started(apart)  # the job does not let its processes go
