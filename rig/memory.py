"""How much memory there is for a recording: what does not fit is refused with a way to read it, not killed for it."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from straw.rig.errors import RigError

#: Memory that reading takes, in sizes of the columns: times in seconds, and what is computed between (test_long_runs).
PEAK = 3.0
#: Samples kept of an interval.
KEPT = 3


class TooLongError(RigError):
    """A recording whose samples do not fit into memory; ``every_s`` is a step with which they do."""

    def __init__(self, message: str, every_s: float) -> None:
        super().__init__(message)
        self.every_s = every_s


def too_long(path: Path, samples: float, sample_bytes: float, span_s: float) -> TooLongError:
    """The error for a recording that holds about so many samples over ``span_s``."""
    there, needed = available_bytes(), PEAK * samples * sample_bytes
    # Half of the memory is left to what is done with them.
    least_s = max(2 * PEAK * KEPT * span_s * sample_bytes / max(there, 1), 1e-9)
    power = 10.0 ** math.floor(math.log10(least_s))
    every_s = next((step * power for step in (1, 2, 5) if step * power >= least_s), 10 * power)
    return TooLongError(
        f"recording {path} holds {samples:,.0f} samples, whose reading takes {needed / 1e9:.1f} GB of memory, of which"
        f" {there / 1e9:.1f} GB are free; read it thinned: read_run(path, every_s={every_s:g})",
        every_s,
    )


def available_bytes() -> int:
    """Memory that programs can still take; where the system does not tell, what the computer has."""
    listed = Path("/proc/meminfo")
    if listed.exists():
        for line in listed.read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    if sys.platform == "win32":
        return _windows()
    import os

    return int(os.sysconf("SC_PHYS_PAGES")) * int(os.sysconf("SC_PAGE_SIZE"))


def _windows() -> int:
    """``ullAvailPhys`` of GlobalMemoryStatusEx."""
    import ctypes

    numbers = (ctypes.c_uint64 * 8)()  # length and load (32 bits each), then total and available bytes, ...
    numbers[0] = ctypes.sizeof(numbers)
    windows: object = getattr(ctypes, "windll")  # noqa: B009  unknown to mypy elsewhere
    windows.kernel32.GlobalMemoryStatusEx(numbers)  # type: ignore[attr-defined]
    return int(numbers[2])
