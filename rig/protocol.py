"""PressureProtocol: a TOML file of holds, ramps and rows, compiled to a table that model, emulator and rig all run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from straw.rig.errors import RigError
from straw.rig.limits import STRAW_LIMITS, PressureLimits

Floats = NDArray[np.float64]
LONGEST_S = 1e9  # 32 years: up to there seconds as floats tell a tenth of a microsecond apart


@dataclass(frozen=True, eq=False)
class PressureProtocol:
    """Commanded gauge pressure against time: breakpoints, straight in between, where a repeated time is a step.

    ``time_s`` starts at 0 and never decreases; ``pressure_pa`` belongs to it. Straight lines between points that pass
    the limits pass them too, so checking the table checks the run. ``zero_s`` is where the main part begins.
    """

    name: str
    time_s: Floats
    pressure_pa: Floats
    zero_s: float
    initial_deployed: tuple[int, ...]
    specimen: str = ""
    cycle: int = 0
    channel: int = 1
    limits: PressureLimits = STRAW_LIMITS
    text: str = field(default="", repr=False)
    also: tuple[PressureProtocol, ...] = ()
    """The other channels' tables, of the same length on the same clock."""

    def __post_init__(self) -> None:
        time_s, pressure_pa = self.time_s, self.pressure_pa
        if time_s.ndim != 1 or len(time_s) < 2 or time_s.shape != pressure_pa.shape:
            raise RigError(f"protocol {self.name}: time_s and pressure_pa must be two rows of equal length, 2 or more")
        if not np.all(np.isfinite(time_s)) or time_s[0] != 0.0 or np.any(np.diff(time_s) < 0.0) or time_s[-1] <= 0.0:
            raise RigError(f"protocol {self.name}: time_s must start at 0 and increase to the protocol's end")
        if time_s[-1] > LONGEST_S:
            raise RigError(f"protocol {self.name}: lasts {time_s[-1]:g} s, longer than {LONGEST_S:g} s; check for_s")
        if not 0.0 <= self.zero_s <= time_s[-1]:
            raise RigError(f"protocol {self.name}: zero_s {self.zero_s:g} lies outside 0..{time_s[-1]:g} s")
        self.check_limits(self.limits)
        channels = [part.channel for part in self.parts]
        for part in self.also:
            if abs(part.duration_s - self.duration_s) > 1e-6:
                raise RigError(
                    f"protocol {self.name}: channel {part.channel} lasts {part.duration_s:g} s, channel {self.channel} "
                    f"{self.duration_s:g} s; make them equal, with a hold"
                )
            if channels.count(part.channel) > 1:
                raise RigError(f"protocol {self.name}: channel {part.channel} is driven twice; write it once")

    @property
    def parts(self) -> tuple[PressureProtocol, ...]:
        """One table a channel: this one, then ``also``."""
        return (self, *self.also)

    def __call__(self, time_s: ArrayLike) -> Floats:
        """Commanded pressure (Pa) at seconds since the start; the first value before it, the last one after the end."""
        t = np.asarray(time_s, dtype=np.float64)
        left = np.searchsorted(self.time_s, t, side="right") - 1  # at a step the new value counts
        i = np.clip(left, 0, len(self.time_s) - 2)
        t0, t1 = self.time_s[i], self.time_s[i + 1]
        share = np.clip((t - t0) / np.where(t1 > t0, t1 - t0, 1.0), 0.0, 1.0)
        straight = self.pressure_pa[i] + share * (self.pressure_pa[i + 1] - self.pressure_pa[i])
        after = left >= len(self.time_s) - 1
        return np.asarray(np.where(after, self.pressure_pa[-1], np.where(left < 0, self.pressure_pa[0], straight)))

    @property
    def duration_s(self) -> float:
        """Length of the whole protocol in seconds."""
        return float(self.time_s[-1])

    @property
    def steps_s(self) -> Floats:
        """Times (s) at which the commanded pressure jumps, the start from vented included."""
        before = np.concatenate([[0.0], self.pressure_pa[:-1]])
        at = np.concatenate([[True], np.diff(self.time_s) == 0.0])
        return np.asarray(self.time_s[at & (before != self.pressure_pa)])

    @property
    def metadata(self) -> dict[str, str]:
        """The protocol's metadata of a run, with the keys of the record ``straw.run``."""
        return {
            "specimen": self.specimen,
            "initial_deployed": ",".join(map(str, self.initial_deployed)),
            "cycle": str(self.cycle),
            "channel": str(self.channel),
            "protocol": self.name,
        }

    def check_limits(self, limits: PressureLimits) -> None:
        """Raise RigError, naming time and pressure, unless every point of the table is within ``limits``."""
        ends_pa = float(self.pressure_pa.min()), float(self.pressure_pa.max())
        # otherwise all points are allowed, and need not be checked one by one
        beyond = any(map(limits.why_not, ends_pa))
        for t, p in zip(self.time_s, self.pressure_pa, strict=True) if beyond else ():
            if reason := limits.why_not(float(p)):
                raise RigError(f"protocol {self.name}: at {t:g} s {reason}; lower it, or widen the limits on purpose")
        rate = limits.max_rate_pa_s
        if rate is None:
            return
        dt = np.diff(self.time_s, prepend=0.0)
        dp = np.abs(np.diff(self.pressure_pa, prepend=0.0))
        for i in np.flatnonzero(dp > rate * dt * (1.0 + 1e-9))[:1]:
            width, change = float(dt[i]), float(dp[i])
            how = f"{change / width / 1e3:g} kPa/s" if width else f"a step of {change / 1e3:g} kPa"
            raise RigError(
                f"protocol {self.name}: up to {self.time_s[i]:g} s there is {how}, limit {rate / 1e3:g} kPa/s; "
                "use a slower ramp"
            )
