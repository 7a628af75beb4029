"""Orders: how other processes of this machine find a run in progress, query its state, and hold, stop or vent it."""

from __future__ import annotations

import json
import os
import secrets
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from straw.rig.errors import RigError
from straw.rig.operator import ORDERS, Operator

SUFFIX = ".control"
ANSWER_S = 0.3
LARGEST = 4096


def control_of(recording: Path) -> Path:
    """The control file of a run in progress, beside its recording, whether that is ``.part`` or finished."""
    return recording.with_name(recording.name.removesuffix(".part") + SUFFIX)


class Orders:
    """Listens on a loopback port while entered; its address is in a file that only this user can read.

    One datagram is one order, ``{"ticket", "do", "who"}``; its answer is the run's state. A thread of its own waits for
    them, so that the run's loop is not delayed.
    """

    def __init__(self, recording: Path, operator: Operator, about: Mapping[str, Any]) -> None:
        self.path, self.operator = control_of(recording), operator
        self.about = {"pid": os.getpid(), "recording": str(recording.absolute()), "since_ns": time.time_ns(), **about}
        self.ticket = secrets.token_urlsafe(24)

    def __enter__(self) -> Self:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._ending = False
        said = {**self.about, "ticket": self.ticket, "port": self._socket.getsockname()[1]}
        try:
            _write_private(self.path, json.dumps(said))
        except OSError as error:
            self._socket.close()
            raise RigError(f"{self.path} cannot be written: {error.strerror}; check the folder") from None
        threading.Thread(target=self._listen, name="orders", daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._ending = True
        self._socket.close()
        with suppress(OSError):
            self.path.unlink()

    def _listen(self) -> None:
        while not self._ending:
            try:
                data, address = self._socket.recvfrom(LARGEST)
                asked = json.loads(data)
                if not secrets.compare_digest(str(asked["ticket"]), self.ticket):
                    continue
                answer = {"state": self.operator.order(str(asked["do"]), str(asked.get("who", ""))[:80])}
            except RigError as error:
                answer = {"error": str(error)}
            except (OSError, ValueError, KeyError, TypeError):  # closed, or not one of ours
                continue
            with suppress(OSError):
                self._socket.sendto(json.dumps(answer).encode(), address)


def read_control(path: Path) -> dict[str, Any] | None:
    """The contents of a control file; None where there is no usable one."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        return said if isinstance(said["port"], int) and isinstance(said["ticket"], str) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def send_order(control: Path, do: str, who: str = "", timeout_s: float = ANSWER_S) -> str:
    """Give an order to the run of a control file; the run's state. RigError where no run answers."""
    if do not in ORDERS:
        raise RigError(f"order {do!r} is unknown; known: {', '.join(ORDERS)}")
    said = read_control(control)
    if said is None:
        raise RigError(f"{control}: no run is going on there")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.settimeout(timeout_s)
        try:
            asking.connect(("127.0.0.1", said["port"]))
            asking.send(json.dumps({"ticket": said["ticket"], "do": do, "who": who}).encode())
            answer = json.loads(asking.recv(LARGEST))
        except (OSError, ValueError):
            raise RigError(f"{control}: the run's process {said.get('pid')} does not answer") from None
    if "error" in answer:
        raise RigError(str(answer["error"]))
    return str(answer["state"])


def running(recording: Path, timeout_s: float = ANSWER_S) -> dict[str, Any] | None:
    """The status of the run that writes a recording, with its ``state``; None when no run answers."""
    control = control_of(recording)
    said = read_control(control)
    if said is None:
        return None
    try:
        return {**said, "state": send_order(control, "state", timeout_s=timeout_s)}
    except RigError:
        return None


def _write_private(path: Path, text: str) -> None:
    """Whole or not at all, and for this user only: who can read the ticket can stop the run."""
    part = path.with_name(f"{path.name}.{os.getpid()}")
    with suppress(OSError):
        part.unlink()
    with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
        stream.write(text)
    part.replace(path)
