"""Log: a file of JSON lines that only grows; each line is on the disk before what it announces happens."""

from __future__ import annotations

import json
import os
import socket
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

from straw.replay.errors import ReplayError
from straw.replay.output import finite

Line = dict[str, Any]


class Log:
    """``with Log(path) as log``: ``log.lines`` are its lines, ``log.write`` adds one. One process at a time.

    A line that a crash cut off stays in the file and is not read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: list[Line] = []
        self.torn = 0
        self._stream: BinaryIO | None = None

    def __enter__(self) -> Self:
        try:
            self._stream = self.path.open("ab+")
            _lock(self._stream, self.path)
            self._stream.seek(0)
            text = self._stream.read()
            if text and not text.endswith(b"\n"):
                self._append(b"\n")
        except OSError as error:
            self.__exit__(None, None, None)
            raise ReplayError(f"{self.path}: cannot be written: {error.strerror}; choose another --log") from None
        except ReplayError:
            self.__exit__(None, None, None)
            raise
        self.lines, self.torn = parsed(text)
        if self.torn and not self.lines:
            self.__exit__(None, None, None)
            raise ReplayError(f"{self.path}: is not a log of straw investigate; choose another --log")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if self._stream is not None:
            self._stream.close()  # which releases the lock, too
            self._stream = None

    def write(self, kind: str, **said: Any) -> Line:
        """Add a line and wait until it is on the disk; ReplayError where it cannot be."""
        line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds"), "kind": kind, **finite(said)}
        try:
            self._append(json.dumps(line, ensure_ascii=False, allow_nan=False).encode() + b"\n")
        except OSError as error:
            raise ReplayError(f"{self.path}: cannot be written: {error.strerror}; make room, then go on") from None
        self.lines.append(json.loads(json.dumps(line)))
        return line

    def _append(self, data: bytes) -> None:
        assert self._stream is not None
        self._stream.write(data)
        self._stream.flush()
        os.fsync(self._stream.fileno())


def parsed(text: bytes) -> tuple[list[Line], int]:
    """The lines of a log, and how many were cut."""
    lines: list[Line] = []
    torn = 0
    for row in text.splitlines():
        try:
            line = json.loads(row)
            if not isinstance(line["kind"], str):
                raise TypeError
            lines.append(line)
        except (ValueError, TypeError, KeyError):
            torn += 1
    return lines, torn


def read_lines(path: Path) -> tuple[list[Line], int]:
    """As `parsed`, for a file that another process may be writing; nothing where it cannot be read."""
    try:
        return parsed(path.read_bytes())
    except OSError:
        return [], 0


def log_of(folder: Path, specimen: str) -> Path:
    """Where the log of a specimen is unless another is named."""
    plain = "".join(c if c.isalnum() or c in "-_." else "-" for c in specimen)
    return folder / f"investigate-{plain}.jsonl"


def _lock(stream: BinaryIO, path: Path) -> None:
    """Lock the file while it is open; ReplayError where another process has locked it. A lock ends with its process."""
    try:
        if os.name == "posix":
            import fcntl

            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            import msvcrt

            stream.seek(2**30)  # a byte beyond the contents, as Windows prevents others from reading what is locked
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError:
        raise ReplayError(
            f"{path}: another straw investigate on {socket.gethostname()} is using it; wait, or give another --log"
        ) from None
