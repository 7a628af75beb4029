"""Dates, times of day and time codes as integer nanoseconds, exactly as they are written."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from decimal import Decimal, InvalidOperation
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from straw.rig.errors import RigError

_EPOCH = datetime(1970, 1, 1)
_TIME = r"(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2})(?:[.,](?P<f>\d{1,9})\d*)?)?\s*(?P<ap>[AaPp][Mm])?"
_ZONE = r"\s*(?P<zone>Z|UTC|[+-]\d{2}:?\d{2})?"
_DATES = (
    re.compile(rf"(?P<Y>\d{{4}})[-/.](?P<M>\d{{1,2}})[-/.](?P<D>\d{{1,2}})(?:[T ]\s*{_TIME}{_ZONE})?$"),
    re.compile(rf"(?P<D>\d{{1,2}})\.(?P<M>\d{{1,2}})\.(?P<Y>\d{{4}})(?:[T ,]\s*{_TIME}{_ZONE})?$"),
    re.compile(rf"(?P<A>\d{{1,2}})[-/](?P<B>\d{{1,2}})[-/](?P<Y>\d{{4}})(?:[T ,]\s*{_TIME}{_ZONE})?$"),
)
_CLOCK = re.compile(rf"{_TIME}$")
_CODE = re.compile(r"(?P<h>\d+):(?P<m>\d{2}):(?P<s>\d{2}):(?P<c>\d{2})$")  # Kinovea: hundredths last


@dataclass(frozen=True)
class Moments:
    """``ns`` of each row; ``absolute`` when they are since 1970 in UTC. ``no_zone``: the zone had to be assumed.
    ``order`` says how 3/4/2024 was read, where that matters."""

    ns: list[int]
    absolute: bool
    no_zone: bool = False
    order: str = ""


def zone_of(name: str) -> tzinfo:
    """A time zone by its name, as Europe/Berlin, or as +02:00; RigError for any other."""
    if name in ("UTC", "Z"):
        return UTC
    if told := re.fullmatch(r"([+-])(\d{2}):?(\d{2})", name):
        minutes = int(told[2]) * 60 + int(told[3])
        if minutes <= 14 * 60:
            return timezone(timedelta(minutes=minutes if told[1] == "+" else -minutes))
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise RigError(f"time zone {name!r} is not known; write it as Europe/Berlin, UTC or +02:00") from None


def nanoseconds(text: str, unit_ns: int) -> int:
    """A decimal number of a unit as whole nanoseconds, exactly; ValueError where it is none."""
    try:
        value = Decimal(text)
        if not value.is_finite():
            raise ValueError
        return int((value * unit_ns).to_integral_value())
    except InvalidOperation:
        raise ValueError from None


def is_moment(text: str) -> bool:
    """Whether a cell is a date, a time of day or a time code."""
    return any(one.match(text) for one in (*_DATES, _CLOCK, _CODE))


def moments(cells: Sequence[str], zone: tzinfo | None, order: str | None, where: str) -> Moments:
    """Read a column of dates or times; RigError, with the row, where a cell is neither.

    ``zone`` applies to those without one; None takes UTC and reports it. ``order`` is "dmy" or "mdy" for 3/4/2024; None
    takes the order that some row proves, else day first.
    """
    first = cells[0].strip()
    if _CODE.match(first):
        return Moments([_code(cell, k, where) for k, cell in enumerate(cells)], absolute=False)
    if _CLOCK.match(first):
        return Moments([_clock(cell, k, where) for k, cell in enumerate(cells)], absolute=False)
    pattern = next((one for one in _DATES if one.match(first)), None)
    if pattern is None:
        raise RigError(f"{where}: {first!r} in row 1 is neither a number nor a date; name another column for the time")
    found = [pattern.match(cell.strip()) for cell in cells]
    bad = next((k for k, one in enumerate(found) if one is None), None)
    if bad is not None:
        raise RigError(f"{where}: {cells[bad]!r} in row {bad + 1} is not a date like the others; repair or cut the row")
    told = ""
    if pattern is _DATES[2]:
        firsts, seconds = ([int(one[key]) for one in found if one] for key in ("A", "B"))
        proof = "dmy" if max(firsts) > 12 else "mdy" if max(seconds) > 12 else ""
        order = order or proof or "dmy"
        told = "" if proof else order
    out = []
    no_zone = False
    known: dict[tuple[str, ...], int] = {}  # one lookup of the zone for each minute is enough
    for k, one in enumerate(found):
        assert one is not None
        part = one.groupdict()
        if "A" in part:
            part["D"], part["M"] = (part["A"], part["B"]) if order == "dmy" else (part["B"], part["A"])
        key = tuple(str(part[name]) for name in ("Y", "M", "D", "h", "m", "ap", "zone"))
        no_zone |= part["zone"] is None
        if key not in known:
            known[key] = _minute_ns(part, zone, f"{where}: row {k + 1}")
        seconds_ns = int(part["s"] or 0) * 10**9 + int((part["f"] or "0").ljust(9, "0"))
        out.append(known[key] + seconds_ns)
    return Moments(out, True, no_zone and zone is None, told)


def _minute_ns(part: dict[str, str | None], zone: tzinfo | None, where: str) -> int:
    try:
        hour = int(part["h"] or 0)
        if part["ap"]:
            hour = hour % 12 + (12 if part["ap"].casefold() == "pm" else 0)
        day = [int(part[name] or 0) for name in ("Y", "M", "D")]
        naive = datetime(day[0], day[1], day[2], hour, int(part["m"] or 0))
    except ValueError as error:
        raise RigError(f"{where}: {error}; if day and month are swapped, give --date-order") from None
    its = zone_of(part["zone"]) if part["zone"] else zone or UTC
    offset = naive.replace(tzinfo=its).utcoffset() or timedelta()
    return int((naive - offset - _EPOCH) / timedelta(seconds=1)) * 10**9


def _clock(cell: str, row: int, where: str) -> int:
    found = _CLOCK.match(cell.strip())
    if not found:
        raise RigError(
            f"{where}: {cell!r} in row {row + 1} is not a time of day like the others; repair or cut the row"
        )
    hour = int(found["h"])
    if found["ap"]:
        hour = hour % 12 + (12 if found["ap"].casefold() == "pm" else 0)
    seconds = hour * 3600 + int(found["m"]) * 60 + int(found["s"] or 0)
    return seconds * 10**9 + int((found["f"] or "0").ljust(9, "0"))


def _code(cell: str, row: int, where: str) -> int:
    found = _CODE.match(cell.strip())
    if not found:
        raise RigError(f"{where}: {cell!r} in row {row + 1} is not a time code like the others; repair or cut the row")
    return (int(found["h"]) * 3600 + int(found["m"]) * 60 + int(found["s"])) * 10**9 + int(found["c"]) * 10**7
