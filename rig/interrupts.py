"""Interrupts: Ctrl-C and kill set a flag that the loop checks, so that nothing can interrupt the vent."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from types import FrameType, TracebackType
from typing import Any, Self

NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # not every system has all of them


class Interrupts:
    """While entered, stop signals only set ``pending``; call ``check`` wherever stopping is safe.

    ``says`` is printed at once when the first one comes. Outside the main thread Python allows no handlers; then
    signals do not arrive here and this does nothing.
    """

    def __init__(self, says: str = "") -> None:
        self._says = says
        self.pending: signal.Signals | None = None
        self._before: dict[signal.Signals, Any] = {}

    def check(self) -> None:
        """Raise the first signal's exception: KeyboardInterrupt for Ctrl-C, SystemExit(128 + number) for the others."""
        if self.pending is signal.SIGINT:
            raise KeyboardInterrupt
        if self.pending is not None:
            raise SystemExit(128 + self.pending)

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in NAMES:
                if number := getattr(signal, name, None):
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.pending is None and self._says:
            with suppress(OSError):
                os.write(2, f"\nstraw: {self._says}\n".encode())  # print is not safe in signal handlers
        self.pending = self.pending or signal.Signals(number)
