"""Bench: the rig's state for the operator's panel: what runs, what is armed, what is queued, and the vent."""

from __future__ import annotations

import subprocess
import threading
import time
from datetime import datetime
from pathlib import Path
from typing import Any

from straw.replay.lab.control import Control
from straw.replay.lab.library import Library
from straw.replay.lab.processes import STRAW, going_on, interrupt, plain, started
from straw.replay.lab.queue import Item, Queue
from straw.rig.errors import RigError
from straw.rig.orders import control_of as control_file
from straw.rig.orders import send_order
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.rig_file import RigFile

#: A rig that was armed but not started within this time is disarmed.
ARMED_S = 300.0
#: A run that does not take a vent order within this time gets a signal as well.
PATIENCE_S = 0.25
TICK_S = 0.2


class Bench:
    """One rig. Runs are processes of their own, which are started and found here and do not depend on this process."""

    def __init__(self, library: Library, rig: RigFile | None, emulate: bool, state: Path | None, host: str) -> None:
        self.library, self.rig, self.host = library, rig, host
        self.emulated = emulate or (rig is not None and rig.emulated)
        self.state = state
        self.queue = Queue(state / "queue.json" if state else None)
        self.control = Control()
        self.said: list[tuple[str, str]] = []  # (time of day, what happened), newest last
        self._armed_s = -ARMED_S
        self._lock = threading.RLock()
        self._process: subprocess.Popen[bytes] | None = None
        self._recording: Path | None = None
        self._item = ""
        self._seen = False  # whether the run that was started here has responded
        self._run: dict[str, Any] | None = None
        self._closed = threading.Event()

    def open(self) -> None:
        """Begin to watch: find a run in progress, and start what is queued when it may start."""
        threading.Thread(target=self._watch, name="bench", daemon=True).start()

    def close(self) -> None:
        """Stop watching; a run in progress continues."""
        self._closed.set()

    @property
    def ready(self) -> bool:
        """Whether there is a rig."""
        return self.emulated or self.rig is not None

    @property
    def armed(self) -> bool:
        """Whether something may start."""
        return time.monotonic() - self._armed_s < ARMED_S

    @property
    def busy(self) -> bool:
        """Whether something runs, or would be started by the queue."""
        return self._process is not None or self._run is not None or (self.queue.next is not None and self.armed)

    def arm(self, who: str, on: bool) -> bool:
        """Arm or disarm; return whether it is armed."""
        name = self.control.check(who)
        if on and not self.ready:
            raise RigError("there is no rig: start the lab with --rig rig.toml, or with --emulate")
        self._armed_s = time.monotonic() if on else -ARMED_S
        self._say(f"{'armed' if on else 'disarmed'} by {name}")
        return on

    def start(self, who: str) -> int:
        """Let the queue run; how many protocols wait in it."""
        name = self.control.check(who)
        if not self.armed:
            raise RigError("the rig is not armed; arm it first")
        if not self.queue.items:
            raise RigError("the queue is empty; add a protocol first")
        self.queue.release()
        self._say(f"the queue was started by {name}")
        return len(self.queue.items)

    def order(self, who: str, do: str) -> str:
        """Hold, resume or stop the run in progress; RigError when there is none."""
        name = self.control.check(who)
        if do == "vent":
            return str(self.vent(name)["says"])
        if self._run is None:
            raise RigError("nothing runs")
        if do == "stop":
            self.queue.hold(f"a run was stopped by {name}")
        state = send_order(control_file(Path(self._run["recording"])), do, name, timeout_s=1.0)
        self._say(f"{do} by {name}: {state}")
        return state

    def vent(self, name: str) -> dict[str, Any]:
        """Vent whatever can be under pressure, by every available way; anyone may call it at any time, repeatedly."""
        self._armed_s = -ARMED_S
        self.queue.hold(f"vented by {name}") if self.queue.items or self._item else None
        runs = self._all_running()
        told = [self._vent_run(run, name) for run in runs]
        process = self._process
        if not runs and process is not None and process.poll() is None:  # between its start and its first response
            interrupt(process.pid)
            told = [
                "the run is being finished, and has vented"
                if self._seen
                else "the run that was starting was told to end"
            ]
        if not told:
            told = [self._vent_idle()]
        text = f"VENT by {name}: {'; '.join(told)}"
        if not (self.said and self.said[-1][1] == text):  # one press arrives by several ways
            self._say(text)
        return {"says": "; ".join(told)}

    def _vent_run(self, run: dict[str, Any], name: str) -> str:
        recording = Path(run["recording"])
        try:
            send_order(control_file(recording), "vent", name, timeout_s=PATIENCE_S)
            return f"{recording.name} vents"
        except RigError:
            interrupt(int(run["pid"]))
            return f"{recording.name} did not answer and was told to end; its guardian vents when it does not"

    def _vent_idle(self) -> str:
        if self.rig is None or self.emulated:
            return "nothing runs, nothing is under pressure"
        threading.Thread(target=self._open_and_vent, daemon=True).start()
        return "nothing runs; the controller is opened and vented"

    def _open_and_vent(self) -> None:
        assert self.rig is not None
        command = [*STRAW, "rig", "check", "--rig", str(self.rig.path), "--pressure", "0"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
            lines = (done.stdout + done.stderr).strip().splitlines()
            self._say(lines[-1] if lines else "vented")
        except (OSError, subprocess.TimeoutExpired) as error:
            self._say(f"the vent is not confirmed: {error}; vent by hand")

    def as_data(self, who: str) -> dict[str, Any]:
        """The panel's state."""
        process = self._process
        starting = self._run is None and process is not None and process.poll() is None
        return {
            "ready": self.ready,
            "emulated": self.emulated,
            "rig": self.rig.name if self.rig else "emulator" if self.emulated else "",
            "limits": str(self.rig.limits) if self.rig else "",
            "camera": self.rig.camera.kind if self.rig and self.rig.camera else "",
            "armed": self.armed,
            "starting": starting and self._recording is not None and self._recording.name,
            "finishing": starting and self._seen,
            "run": self._run and {key: self._run.get(key) for key in SHOWN},
            "queue": {**self.queue.as_data(), "running": self._item},
            "control": self.control.as_data(who),
            "said": self.said[-30:],
        }

    def _watch(self) -> None:
        while not self._closed.wait(TICK_S):
            try:
                self._tick()
            except RigError as error:
                self.queue.hold(str(error))
                self._say(str(error))
            except Exception as error:  # an error in one tick must not end the panel
                self._say(f"{type(error).__name__}: {error}")

    def _tick(self) -> None:
        with self._lock:
            found = self._all_running()
            self._run = found[0] if found else None
            self._seen = self._seen or self._run is not None
            process = self._process
            if process is not None and process.poll() is not None:
                self._ended(process)
            busy = self._process is not None or self._run is not None
            item = self.queue.next
            if item is not None and self.armed and not busy:
                self._start(item)

    def _start(self, item: Item) -> None:
        protocol = protocol_from_toml(item.toml, "protocol")
        if self.rig is not None:
            protocol.check_limits(self.rig.limits)
        folder = self.library.folder
        name = f"{datetime.now():%Y%m%d-%H%M%S}-{plain(item.name)}"
        place = self.state or folder
        toml, log = place / f"{name}.toml", place / f"{name}.log"
        try:
            toml.write_text(item.toml, encoding="utf-8")
            stream = log.open("wb")
        except OSError as error:
            raise RigError(f"{toml} cannot be written: {error.strerror}; nothing was started") from None
        recording = folder / f"{name}.mcap"
        command = ["rig", "run", str(toml), "-o", str(recording), "--live", f"{self.host}:0", "--watched"]
        command += ["--rig", str(self.rig.path)] if self.rig else []
        if self.emulated:  # and what a perfect camera would have seen, as a track
            command += ["--emulate", "--tip", str(folder / f"{name}-tip.mcap")]
        if item.specimen:
            command += ["--specimen", item.specimen, "--cycle", str(self.next_cycle(item.specimen))]
        self._recording, self._item, self._log, self._seen = recording, item.id, log, False
        with stream:
            self._process = started(command, stream)
        self._say(f"{name} was started")

    def _ended(self, process: subprocess.Popen[bytes]) -> None:
        lines = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        said = lines[-1] if lines else f"the run ended with code {process.returncode}"
        recording, item = self._recording, self._item
        self._process = self._recording = None
        self._item = ""
        self.queue.ended(item, process.returncode == 0, said)
        if not self.queue.items or process.returncode != 0:
            self._armed_s = -ARMED_S
        else:
            self._armed_s = time.monotonic()  # a queue that continues stays armed
        self._say(f"{recording.name if recording else 'the run'}: {said}")
        self.library.look()

    def next_cycle(self, specimen: str) -> int:
        """How often a specimen was cycled so far: one more with every run of it."""
        runs = [e for e in self.library.entries if e.specimen == specimen and e.kind in ("run", "part")]
        return max((e.cycle + 1 for e in runs), default=0)

    def _all_running(self) -> list[dict[str, Any]]:
        """Runs that answer: the one started here, and any other in the folder."""
        parts = {self.library.path(e) for e in self.library.entries if e.kind in ("part", "running")}
        if self._recording is not None:
            parts.add(self._recording)
        found = [said for said in map(going_on, sorted(parts)) if said is not None]
        return list({said["pid"]: said for said in found}.values())

    def _say(self, text: str) -> None:
        self.said.append((f"{datetime.now():%H:%M:%S}", text))
        del self.said[:-200]


SHOWN = ("recording", "protocol", "specimen", "duration_s", "since_ns", "state", "url", "limits", "guardian")
