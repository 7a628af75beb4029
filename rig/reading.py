"""Reading, Command: what passes between a controller and the program, with its time and the time's uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field


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
