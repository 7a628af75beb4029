"""Clock: one monotonic clock tied once to the wall, so that every sample carries both without an NTP jump between."""

from __future__ import annotations

import time


class Clock:
    """Monotonic nanoseconds and the wall time (ns since the Unix epoch) they stand for.

    The tie is made once, at construction: a wall clock that is stepped during a run must not tear the run apart.
    """

    def __init__(self) -> None:
        # The tightest of a few brackets ties the two clocks to within about a microsecond.
        brackets = []
        for _ in range(5):
            before, wall, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
            brackets.append((after - before, wall - (before + after) // 2))
        self._wall_minus_monotonic_ns = min(brackets)[1]

    def monotonic_ns(self) -> int:
        """Now, on the monotonic clock (ns)."""
        return time.monotonic_ns()

    def wall_ns(self, monotonic_ns: int | None = None) -> int:
        """The wall time (ns since the Unix epoch) of a monotonic instant, or of now."""
        return (self.monotonic_ns() if monotonic_ns is None else monotonic_ns) + self._wall_minus_monotonic_ns
