"""A tolerance by channel as a user writes it, and whether a remainder is within it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from straw.replay.diagnose.recording import Channel
from straw.replay.errors import ReplayError

#: Factors to SI of units that may follow a number.
UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "mrad": 1e-3, "deg": math.radians(1.0), "Pa": 1.0, "kPa": 1e3}


@dataclass(frozen=True)
class Tolerance:
    """RMS above noise that may remain: SI by channel, or a share of what the channel moves in the runs held out."""

    si: Mapping[str, float]
    share: float | None = None

    def limit(self, name: str, moves: float) -> float:
        """What may remain in a channel with this range of motion; infinite without a tolerance."""
        if self.share is not None:
            return self.share * moves
        return self.si.get(name, float("inf"))

    def holds(self, remainder: Mapping[str, float], moves: Mapping[str, float]) -> bool:
        """Whether a remainder (RMS above noise, by channel) is within it in every channel."""
        return all(left <= self.limit(name, moves[name]) for name, left in remainder.items())


def parse_tolerance(text: str, channels: Sequence[Channel]) -> Tolerance:
    """``x=0.1mm,z=0.1mm,phi=2mrad``, or a share of the motion, ``2%``; ReplayError for what cannot be read."""
    if share := re.fullmatch(r"\s*([\d.]+)\s*%\s*", text):
        percent = _positive(share[1], text)
        if percent > 100:
            raise ReplayError(f"--tolerance {text.strip()}: more than all of the motion; give a share up to 100%")
        return Tolerance({}, percent / 100)
    known = {c.short: c for c in channels}
    si = {}
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\w+)\s*=\s*([\d.eE+-]+)\s*([A-Za-z]*)\s*", part)
        if not found or found[1] not in known:
            raise ReplayError(
                f"--tolerance {part.strip() or repr(text)}: give CHANNEL=VALUE with its unit, for example "
                f"x=0.1mm,phi=2mrad, or a share of the motion, for example 2%; channels: {', '.join(known)}"
            )
        channel, unit = known[found[1]], found[3]
        si_unit = channel.name.rpartition("_")[2]
        if unit not in UNITS or not unit.lower().endswith(("deg", si_unit) if si_unit == "rad" else (si_unit,)):
            what = f"{unit} is none of {channel.short}'s units" if unit else "has no unit"
            raise ReplayError(f"--tolerance {part.strip()}: {what}; write {si_unit} or {channel.shown_unit}")
        if channel.name in si:
            raise ReplayError(f"--tolerance {text}: {channel.short} is given twice; give it once")
        si[channel.name] = _positive(found[2], part) * UNITS[unit]
    return Tolerance(si)


def _positive(number: str, text: str) -> float:
    try:
        value = float(number)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise ReplayError(f"--tolerance {text.strip()}: {number} is no finite number above zero")
    return value
