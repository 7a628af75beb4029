"""Ports through which this computer has driven controllers, kept on disk so that they can be found and vented."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

STATE_ENV = "STRAW_STATE_DIR"
FORGET_S = 90 * 86400.0  # after so long without use, an entry no longer shows what is connected


@dataclass(frozen=True)
class Known:
    """A port, the controller on it, its driver's settings, and the guardian that holds it (0: none does)."""

    port: str
    controller: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    guardian_pid: int = 0
    used_ns: int = 0  # since the Unix epoch


def state_folder() -> Path:
    """The folder of the stored ports: STRAW_STATE_DIR, or the user's state folder on this system."""
    if given := os.environ.get(STATE_ENV):
        return Path(given)
    from platformdirs import user_state_path

    return user_state_path("straw", appauthor=False)


def remember(port: str, controller: str, settings: Mapping[str, Any], guardian_pid: int) -> None:
    """Store who holds a port; a failure to write (a full disk, no rights) does not stop a run."""
    plain = {key: value for key, value in settings.items() if _is_plain(value)}
    known = Known(port, controller, plain, guardian_pid, time.time_ns())
    path = _file_of(port)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(asdict(known)), encoding="utf-8")
        part.replace(path)


def known_ports() -> list[Known]:
    """The stored ports, last used first."""
    found = []
    for path in (state_folder() / "ports").glob("*.json"):
        with suppress(OSError, ValueError, TypeError, AttributeError):
            data = json.loads(path.read_text(encoding="utf-8"))
            data["settings"] = {k: tuple(v) if isinstance(v, list) else v for k, v in data["settings"].items()}
            known = Known(**data)
            if time.time_ns() - known.used_ns < FORGET_S * 1e9:
                found.append(known)
    return sorted(found, key=lambda known: -known.used_ns)


def is_guarded(known: Known) -> bool:
    """Whether its guardian still runs: a process with that id that is a guardian, as ids are reused."""
    return known.guardian_pid > 0 and "straw.rig.guardian" in _command_line(known.guardian_pid)


def _command_line(pid: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    if os.name != "posix":
        return ""
    with suppress(OSError, subprocess.TimeoutExpired):  # macOS
        return subprocess.run(
            ["ps", "-o", "command=", "-p", str(pid)], capture_output=True, text=True, timeout=2.0
        ).stdout
    return ""


def _file_of(port: str) -> Path:
    return state_folder() / "ports" / f"{hashlib.sha256(port.encode()).hexdigest()[:16]}.json"


def _is_plain(value: object) -> bool:
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return isinstance(value, str | int | float | bool)
