"""Segments of a protocol file: hold, ramp, rows, sine, chirp, prbs, repeat, each compiled to breakpoints."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from straw.rig.toml_place import At

Points = list[tuple[float, float]]  # (s from the segment's start, pressure in the file's unit), straight in between
WhyNot = Callable[[float], str | None]
#: Points per period of a sine: chords deviate by at most 0.1 % of the amplitude, 1 - cos(pi / 72).
#: (At the start of a slow linear chirp by 0.3 %.)
POINTS_PER_PERIOD = 72
MOST_POINTS = 1_000_000


def compile_entries(at: At, entries: object, name: str, why_not: WhyNot) -> Points:
    """Breakpoints of a list of entries, one after the other; ``name`` is what the file calls the list.

    ``why_not`` gives the reason why a pressure is not allowed, or None.
    """
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        at.fail(f"{name.strip('[]')} must be written as {name} entries, one table per segment")
    points: Points = []
    start_s = 0.0
    for number, entry in enumerate(entries, 1):
        here = at.inside(f"{name} entry {number}")
        here.known_keys(entry, (*SEGMENTS, "repeat", "for_s", "do"))
        kinds = [kind for kind in (*SEGMENTS, "repeat") if kind in entry]
        if len(kinds) != 1:
            here.fail(f"has {' and '.join(kinds) or 'none'} of {', '.join(SEGMENTS)}, repeat; write exactly one")
        if kinds == ["repeat"]:
            segment = _repeat(here, entry, why_not)
        else:
            here.known_keys(entry, (*SEGMENTS, "for_s"))
            segment = SEGMENTS[kinds[0]](here, entry)
            ends = min(p for _, p in segment), max(p for _, p in segment)
            for t, p in segment if any(map(why_not, ends)) else ():
                if reason := why_not(p):
                    here.fail(f"at {t:g} s {reason}; lower it, or set [limits] on purpose")
        points += [(start_s + t, p) for t, p in segment]
        start_s += segment[-1][0]
        if len(points) > MOST_POINTS:
            here.fail(f"makes a table of more than {MOST_POINTS} points; shorten it, or repeat less often")
    return points


def _duration(at: At, entry: dict[str, Any]) -> float:
    if "for_s" not in entry:
        at.fail("for_s is missing; give the segment's duration in seconds")
    return at.positive(entry["for_s"], "for_s")


def _hold(at: At, entry: dict[str, Any]) -> Points:
    pressure = at.number(entry["hold"], "hold")
    return [(0.0, pressure), (_duration(at, entry), pressure)]


def _ramp(at: At, entry: dict[str, Any]) -> Points:
    ends = entry["ramp"]
    if not isinstance(ends, list) or len(ends) != 2:
        at.fail(f"ramp = {ends!r} must be [from, to]")
    return [(0.0, at.number(ends[0], "ramp from")), (_duration(at, entry), at.number(ends[1], "ramp to"))]


def _rows(at: At, entry: dict[str, Any]) -> Points:
    rows = entry["rows"]
    if not isinstance(rows, list) or not rows or not all(isinstance(row, list) and len(row) == 2 for row in rows):
        at.fail("rows must be [[seconds, pressure], ...] with at least one row")
    table = [(at.number(t, f"row {i} time"), at.number(p, f"row {i} pressure")) for i, (t, p) in enumerate(rows, 1)]
    if table[0][0] != 0.0:
        at.fail(f"row 1 is at {table[0][0]:g} s; the first row starts the segment, write 0")
    for i, ((t0, _), (t1, _)) in enumerate(pairwise(table), 2):
        if t1 <= t0:
            at.fail(f"row {i} at {t1:g} s does not come after row {i - 1} at {t0:g} s; sort the rows")
    end_s = _duration(at, entry) if "for_s" in entry else table[-1][0]
    if end_s <= 0.0 or end_s < table[-1][0]:
        at.fail(f"the segment ends at {end_s:g} s, before its last row; add for_s after the last row")
    points: Points = []
    for (t, p), (t_next, _) in zip(table, [*table[1:], (end_s, 0.0)], strict=True):
        points += [(t, p), (t_next, p)]  # set and hold until the next row
    return points


def _sine(at: At, entry: dict[str, Any]) -> Points:
    table = _table(at, entry, "sine", ("mean", "amplitude", "frequency_hz", "phase_deg"))
    frequency_hz = at.positive(table["frequency_hz"], "sine frequency_hz")
    start = math.radians(at.number(table.get("phase_deg", 0.0), "sine phase_deg"))
    length_s = _duration(at, entry)
    _check_points(at, frequency_hz * length_s)
    phase = start + _phases(2 * math.pi * frequency_hz * length_s)
    return _wave(at, table, (phase - start) / (2 * math.pi * frequency_hz), phase, length_s)


def _chirp(at: At, entry: dict[str, Any]) -> Points:
    """A sine that starts at its mean and whose frequency runs from one to the other, as ``scipy.signal.chirp``."""
    table = _table(at, entry, "chirp", ("mean", "amplitude", "from_hz", "to_hz", "sweep"))
    f0, f1 = (at.positive(table[key], f"chirp {key}") for key in ("from_hz", "to_hz"))
    sweep = at.string(table.get("sweep", "logarithmic"), "chirp sweep")
    length_s = _duration(at, entry)
    _check_points(at, max(f0, f1) * length_s)
    if f0 == f1:
        at.fail(f"chirp from {f0:g} to {f1:g} Hz does not sweep; write a sine")
    if sweep == "linear":
        slope = (f1 - f0) / length_s
        turns = _phases(math.pi * (f0 + f1) * length_s) / (2 * math.pi)
        time_s = (np.sqrt(f0**2 + 2 * slope * turns) - f0) / slope
    elif sweep == "logarithmic":
        pace = math.log(f1 / f0) / length_s
        turns = _phases(2 * math.pi * (f1 - f0) / pace) / (2 * math.pi)
        time_s = np.log1p(turns * pace / f0) / pace
    else:
        at.fail(f"chirp sweep = {sweep!r} is unknown; write linear or logarithmic")
    return _wave(at, table, time_s, 2 * math.pi * turns, length_s)


def _phases(end: float) -> Any:
    """Phases (rad) from 0 to ``end``, evenly spaced so that every extreme is included, and the end itself."""
    step = 2 * math.pi / POINTS_PER_PERIOD
    return np.append(np.arange(0.0, end - 1e-9 * step, step), end)


def _wave(at: At, table: dict[str, Any], time_s: Any, phase: Any, length_s: float) -> Points:
    mean, amplitude = at.number(table.get("mean", 0.0), "mean"), at.number(table["amplitude"], "amplitude")
    time_s[-1] = length_s  # exactly where the next segment starts
    return list(zip(time_s.tolist(), (mean + amplitude * np.sin(phase)).tolist(), strict=True))


def _prbs(at: At, entry: dict[str, Any]) -> Points:
    """Maximum-length sequence of ``2**order - 1`` bits, low or high for ``bit_s`` each, from a seeded start."""
    from scipy.signal import max_len_seq

    table = _table(at, entry, "prbs", ("low", "high", "bit_s", "order", "seed"))
    low, high, bit_s = (at.number(table[key], f"prbs {key}") for key in ("low", "high", "bit_s"))
    order, seed = at.integer(table.get("order", 7), "prbs order", 2), at.integer(table.get("seed", 1), "prbs seed", 1)
    if order > 20:
        at.fail(f"prbs order = {order} must be at most 20")
    length_s = _duration(at, entry)
    count = math.ceil(length_s / at.positive(bit_s, "prbs bit_s") - 1e-9)
    _check_points(at, count / POINTS_PER_PERIOD * 2)
    state = [int(bit) for bit in np.binary_repr(seed % (2**order - 1) or 1, order)]
    bits, _ = max_len_seq(order, state=state, length=count)
    points: Points = []
    for k, bit in enumerate(bits.tolist()):
        pressure = high if bit else low
        points += [(k * bit_s, pressure), (min((k + 1) * bit_s, length_s), pressure)]
    return points


def _repeat(at: At, entry: dict[str, Any], why_not: WhyNot) -> Points:
    times = at.integer(entry["repeat"], "repeat", 1)
    if "for_s" in entry or not entry.get("do"):
        at.fail("repeat = a number of times needs do = [{ hold = ..., for_s = ... }, ...], and no for_s")
    once = compile_entries(at, entry["do"], "do", why_not)
    _check_points(at, times * len(once) / POINTS_PER_PERIOD)
    return [(k * once[-1][0] + t, p) for k in range(times) for t, p in once]


def _table(at: At, entry: dict[str, Any], kind: str, keys: tuple[str, ...]) -> dict[str, Any]:
    table = entry[kind]
    if not isinstance(table, dict):
        at.fail(f"{kind} = {table!r} must be a table of {', '.join(keys)}")
    at.inside(kind).known_keys(table, keys)
    optional = ("mean", "phase_deg", "sweep", "order", "seed")
    if missing := [key for key in keys if key not in table and key not in optional]:
        at.fail(f"{kind} lacks {' and '.join(missing)}")
    return table


def _check_points(at: At, periods: float) -> None:
    if periods * POINTS_PER_PERIOD > MOST_POINTS:
        at.fail(f"makes a table of more than {MOST_POINTS} points; make it shorter or slower")


SEGMENTS: dict[str, Callable[[At, dict[str, Any]], Points]] = {
    "hold": _hold,
    "ramp": _ramp,
    "rows": _rows,
    "sine": _sine,
    "chirp": _chirp,
    "prbs": _prbs,
}
"""Kinds of segment: a new one is one function from its entry to breakpoints."""
