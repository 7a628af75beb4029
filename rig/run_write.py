"""RunWriter: a recording while it is made; a queue before the file, so that a live loop never waits for the disk."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from straw.rig.errors import RigError
from straw.rig.manifest import seal
from straw.rig.reading import Command, Reading
from straw.rig.run_file import RunFile
from straw.rig.schema import TOPICS, check, encode

FLUSH_S = 0.5  # a killed program loses what is newer than this, plus the disk's delay: less than a second


class RunWriter:
    """A live recording: ``add`` only queues, a thread writes and flushes twice a second.

    Used as a context manager it always finishes the file: what was recorded before an error is kept.
    """

    def __init__(
        self, path: str | Path, metadata: Mapping[str, str], attachments: Mapping[str, bytes] | None = None
    ) -> None:
        for topic in TOPICS:
            encode(topic, 1, {})  # so that no live loop waits for protobuf to be loaded
        self._file = RunFile(path, metadata, attachments)
        self.path = self._file.path
        self._queue: deque[tuple[str, int, dict[str, Any], int]] = deque()
        self._ending = threading.Event()
        self._failure: BaseException | None = None
        self._finished = False
        self._thread = threading.Thread(target=self._write, name=f"writer {self.path.name}", daemon=True)
        self._thread.start()

    @property
    def failed(self) -> bool:
        """Whether writing failed; ``add`` and ``finish`` raise the reason."""
        return self._failure is not None

    @property
    def kept(self) -> Path:
        """The path of the recording once it is finished; the ``.part`` if writing failed."""
        return self._file.part if self.failed else self.path

    def add(self, topic: str, happened_ns: int, **values: Any) -> None:
        """Queue one message that happened at ``happened_ns`` (ns since the Unix epoch); never waits for the disk.

        An error of an earlier message is raised here, so that a run on a full disk stops.
        """
        if self._failure is not None:
            raise self._failure
        if self._finished:
            raise RigError(f"recording {self.path} is finished; what happens later needs a recording of its own")
        check(topic, happened_ns, values)
        self._queue.append((topic, happened_ns, values, time.time_ns()))

    def command(self, command: Command) -> None:
        """Queue a command that was given to a controller."""
        self._told("/pressure/command", command)

    def reading(self, reading: Reading) -> None:
        """Queue what a controller read."""
        self._told("/pressure/measured", reading, sigma_pa=reading.sigma_pa, flow_m3_s=reading.flow_m3_s)

    def _told(self, topic: str, what: Command | Reading, **more: float) -> None:
        self.add(
            topic,
            what.wall_ns,
            pressure_pa=what.pressure_pa,
            channel=what.channel,
            monotonic_ns=what.monotonic_ns,
            half_width_ns=what.half_width_ns,
            raw=what.raw,
            **more,
        )

    def event(self, kind: str, text: str, happened_ns: int | None = None) -> None:
        """Queue an event, now if no time is given."""
        self.add("/events", time.time_ns() if happened_ns is None else happened_ns, kind=kind, text=text)

    def finish(self, closing: Mapping[str, str] | None = None) -> None:
        """Write what is queued and finish the file; an error of the writing thread is raised here."""
        if self._finished:
            return
        self._finished = True
        self._ending.set()
        self._thread.join()
        if self._failure is not None:
            self._file.abandon()
            raise self._failure
        self._file.finish(closing)
        seal(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.finish()

    def _write(self) -> None:
        file, queue = self._file, self._queue
        try:
            ending = False
            while not ending:
                # Waking up costs more than writing: at 1 kHz a thread that wakes for each message doubles the cost.
                ending = self._ending.wait(FLUSH_S)
                while queue:
                    topic, happened_ns, values, log_ns = queue.popleft()
                    file.add(topic, happened_ns, encode(topic, happened_ns, values), log_ns)
                file.flush()
        except BaseException as error:  # raised by add() and finish(), as a thread cannot raise to its caller
            self._failure = error
