"""Clocks: one monotonic clock tied once to the wall, and one that is advanced by hand."""

from __future__ import annotations

import threading
import time


class Clock:
    """Monotonic nanoseconds and the wall time (ns since the Unix epoch) they stand for.

    They are tied once, at construction, so that a step of the wall clock during a run does not show in the recording.
    """

    def __init__(self) -> None:
        # The tightest of a few brackets ties the two clocks to within about a microsecond.
        brackets = []
        for _ in range(5):
            before, wall, after = self.monotonic_ns(), time.time_ns(), self.monotonic_ns()
            brackets.append((after - before, wall - (before + after) // 2))
        self._wall_minus_monotonic_ns = min(brackets)[1]

    def monotonic_ns(self) -> int:
        """Now, on the monotonic clock (ns)."""
        return time.monotonic_ns()

    def monotonic_s(self) -> float:
        """Now, on the monotonic clock (s)."""
        return self.monotonic_ns() * 1e-9

    def wall_ns(self, monotonic_ns: int | None = None) -> int:
        """The wall time (ns since the Unix epoch) of a monotonic instant, or of now."""
        return (self.monotonic_ns() if monotonic_ns is None else monotonic_ns) + self._wall_minus_monotonic_ns

    def sleep(self, time_s: float) -> None:
        """Let time pass (s)."""
        time.sleep(max(time_s, 0.0))


class SteppedClock(Clock):
    """Advances only when something sleeps on it, so that a minute of emulated rig takes as long as its computation.

    An emulator and the program that drives it must share one. Then the wire's latency, the program's waits and the
    straw's motion are one time line, the same on every computer.
    """

    def __init__(self) -> None:
        self._now_ns = 10**9  # loops and viewers misread a time of zero
        self._lock = threading.Lock()
        super().__init__()

    def monotonic_ns(self) -> int:
        """Now (ns)."""
        return self._now_ns

    def sleep(self, time_s: float) -> None:
        """Move on by ``time_s`` at once."""
        with self._lock:
            self._now_ns += max(round(time_s * 1e9), 0)
