"""LED burst: a code on the trigger output that a camera sees, for the fit t_video = a + b t_host."""

from __future__ import annotations

from collections.abc import Iterator

from straw.rig.controller import Controller
from straw.rig.reading import Stamp

#: Barker's code of 13: its autocorrelation has a single peak, so a burst is found only once.
CODE = (1, 1, 1, 1, 1, 0, 0, 1, 1, 0, 1, 0, 1)
BIT_S = 0.05  # a dozen frames at 240 frames/s, and long compared with any delay of the line
BURST_S = (len(CODE) + 2) * BIT_S


def blink(controller: Controller) -> Iterator[tuple[Stamp, bool]]:
    """Blink the code once; each change with the time at which the controller acknowledged it."""
    level = False
    start_s = controller.clock.monotonic_s()
    for k, bit in enumerate((*CODE, 0), 1):
        if bool(bit) != level:
            level = bool(bit)
            yield controller.trigger(level), level
        controller.clock.sleep(start_s + k * BIT_S - controller.clock.monotonic_s())
