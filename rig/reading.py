"""Reading, Command: what passes between a controller and the program, with its time and the time's uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from straw.rig.clock import Clock


@dataclass(frozen=True)
class Stamp:
    """When something happened: half-way between the request and the first byte of the answer, plus or minus half of
    that."""

    monotonic_ns: int
    wall_ns: int
    half_width_ns: int


@dataclass(frozen=True)
class Reading(Stamp):
    """One measured gauge pressure (Pa) of one channel, with the raw bytes it came in; sigma NaN when unknown.

    ``flow_m3_s`` is what a flow sensor on the channel shows, NaN without one.
    """

    channel: int
    pressure_pa: float
    sigma_pa: float
    raw: bytes
    flow_m3_s: float = math.nan


@dataclass(frozen=True)
class Command(Stamp):
    """One set pressure (Pa) as the instrument got it, after rounding to what it can take, and its raw answer."""

    channel: int
    pressure_pa: float
    raw: bytes = b""


@dataclass(frozen=True)
class Answer:
    """What a driver got for one request for readings: Pa by channel, the raw bytes, m^3/s by channel."""

    pressure_pa: Mapping[int, float]
    raw: bytes
    flow_m3_s: Mapping[int, float] = field(default_factory=dict)


def stamp_of(clock: Clock, before_ns: int, answer_s: float) -> dict[str, Any]:
    """Fields of the ``Stamp`` of an exchange that began at ``before_ns`` (monotonic) and whose answer is just here.

    The instrument measured before it began to answer, and the bytes of the answer take milliseconds: ``answer_s``.
    """
    after_ns = max(before_ns, clock.monotonic_ns() - round(answer_s * 1e9))
    middle_ns = (before_ns + after_ns) // 2
    return {
        "monotonic_ns": middle_ns,
        "wall_ns": clock.wall_ns(middle_ns),
        "half_width_ns": (after_ns - before_ns + 1) // 2,
    }
