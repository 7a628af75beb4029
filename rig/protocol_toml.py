"""Reads the TOML form of a PressureProtocol: every key and value is checked here, and nothing is guessed."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import PurePath
from typing import Any, NoReturn

import numpy as np

from rig.errors import RigError
from rig.limits import STRAW_LIMITS, PressureLimits
from rig.protocol import PressureProtocol

UNITS_PA = {"Pa": 1.0, "mbar": 100.0, "kPa": 1000.0}
SECTIONS = ("prefix", "main", "suffix")
TOP_KEYS = ("name", "pressure_unit", "initial_deployed", "specimen", "cycle", "channel", "limits", *SECTIONS)

Points = list[tuple[float, float]]  # (s from the segment's start, pressure in the file's unit)


class _At:
    """A place in the file, so that every complaint can name it."""

    def __init__(self, where: str) -> None:
        self.where = where

    def fail(self, problem: str) -> NoReturn:
        raise RigError(" ".join(f"{self.where}: {problem}".split()))

    def inside(self, place: str) -> _At:
        return _At(f"{self.where}: {place}")

    def known_keys(self, table: dict[str, Any], allowed: tuple[str, ...]) -> None:
        for key in table:
            if key not in allowed:
                self.fail(f"unknown key {key!r}; known here: {', '.join(allowed)}")

    def number(self, value: object, what: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(f"{what} = {value!r} is not a number; write one without quotes")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.fail(f"{what} = {number} is not a finite number; write one")
        return number

    def integer(self, value: object, what: str, least: int) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            self.fail(f"{what} = {value!r} must be a whole number of at least {least}")
        return value

    def string(self, value: object, what: str) -> str:
        if not isinstance(value, str):
            self.fail(f"{what} = {value!r} must be text in quotes")
        return value

    def duration(self, entry: dict[str, Any]) -> float:
        if "for_s" not in entry:
            self.fail("for_s is missing; say how many seconds the segment lasts")
        seconds = self.number(entry["for_s"], "for_s")
        if seconds <= 0.0:
            self.fail(f"for_s = {seconds:g} must be above 0")
        return seconds


def _hold(at: _At, entry: dict[str, Any]) -> Points:
    pressure = at.number(entry["hold"], "hold")
    return [(0.0, pressure), (at.duration(entry), pressure)]


def _ramp(at: _At, entry: dict[str, Any]) -> Points:
    ends = entry["ramp"]
    if not isinstance(ends, list) or len(ends) != 2:
        at.fail(f"ramp = {ends!r} must be [from, to]")
    return [(0.0, at.number(ends[0], "ramp from")), (at.duration(entry), at.number(ends[1], "ramp to"))]


def _rows(at: _At, entry: dict[str, Any]) -> Points:
    rows = entry["rows"]
    if not isinstance(rows, list) or not rows or not all(isinstance(row, list) and len(row) == 2 for row in rows):
        at.fail("rows must be [[seconds, pressure], ...] with at least one row")
    table = [(at.number(t, f"row {i} time"), at.number(p, f"row {i} pressure")) for i, (t, p) in enumerate(rows, 1)]
    if table[0][0] != 0.0:
        at.fail(f"row 1 is at {table[0][0]:g} s; the first row starts the segment, write 0")
    for i, ((t0, _), (t1, _)) in enumerate(pairwise(table), 2):
        if t1 <= t0:
            at.fail(f"row {i} at {t1:g} s does not come after row {i - 1} at {t0:g} s; sort the rows")
    end_s = at.duration(entry) if "for_s" in entry else table[-1][0]
    if end_s <= 0.0 or end_s < table[-1][0]:
        at.fail(f"the segment ends at {end_s:g} s, before its last row; add for_s after the last row")
    points: Points = []
    for (t, p), (t_next, _) in zip(table, [*table[1:], (end_s, 0.0)], strict=True):
        points += [(t, p), (t_next, p)]  # set and hold until the next row
    return points


SEGMENTS: dict[str, Callable[[_At, dict[str, Any]], Points]] = {"hold": _hold, "ramp": _ramp, "rows": _rows}
"""Kinds of segment: a new one is one function from its entry to breakpoints."""


def _limits(at: _At, document: dict[str, Any], unit_pa: float) -> PressureLimits:
    table = document.get("limits", {})
    if not isinstance(table, dict):
        at.fail("limits must be a table: [limits] min = ..., max = ...")
    at.known_keys(table, ("min", "max", "max_rate"))
    given = {key: at.number(value, key) * unit_pa for key, value in table.items()}
    try:
        return PressureLimits(
            given.get("min", STRAW_LIMITS.min_pa), given.get("max", STRAW_LIMITS.max_pa), given.get("max_rate")
        )
    except RigError as error:
        at.fail(str(error))


def _deployed(at: _At, value: object) -> tuple[int, ...]:
    if not isinstance(value, list):
        at.fail("initial_deployed must list the deployed cells, e.g. [1, 4], or [] when all are folded")
    cells = tuple(at.integer(cell, "a cell in initial_deployed", 1) for cell in value)
    if len(set(cells)) != len(cells):
        at.fail(f"initial_deployed = {value} names a cell twice")
    return tuple(sorted(cells))


def compile_toml(text: str, name: str) -> PressureProtocol:
    """The protocol written in ``text``; raises RigError with one line naming the place in ``name``."""
    at = _At(name)
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        at.fail(f"not valid TOML: {error}")
    at.known_keys(document, TOP_KEYS)
    for key in ("pressure_unit", "initial_deployed", "main"):
        if key not in document:
            at.fail(f"{key} is missing; add it (see rig/protocols/fold-25kPa.toml)")
    unit = document["pressure_unit"]
    if not isinstance(unit, str) or unit not in UNITS_PA:
        at.fail(f"pressure_unit = {unit!r} is unknown; use one of {', '.join(UNITS_PA)}")
    unit_pa = UNITS_PA[unit]
    limits = _limits(at.inside("[limits]"), document, unit_pa)

    points: Points = []
    start_s = zero_s = 0.0
    for section in SECTIONS:
        if section == "main":
            zero_s = start_s
        entries = document.get(section, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            at.fail(f"{section} must be written as [[{section}]] entries, one per segment")
        for number, entry in enumerate(entries, 1):
            here = at.inside(f"[[{section}]] entry {number}")
            here.known_keys(entry, (*SEGMENTS, "for_s"))
            kinds = [kind for kind in SEGMENTS if kind in entry]
            if len(kinds) != 1:
                here.fail(f"has {' and '.join(kinds) or 'none'} of {', '.join(SEGMENTS)}; write exactly one")
            segment = SEGMENTS[kinds[0]](here, entry)
            for t, p in segment:
                if reason := limits.why_not(p * unit_pa):
                    here.fail(f"at {t:g} s {reason}; lower it, or set [limits] on purpose")
            points += [(start_s + t, p * unit_pa) for t, p in segment]
            start_s += segment[-1][0]
    if not document["main"]:
        at.fail("main is empty; add at least one [[main]] entry")

    try:
        return PressureProtocol(
            name=at.string(document.get("name", PurePath(name).stem), "name"),
            time_s=np.array([t for t, _ in points]),
            pressure_pa=np.array([p for _, p in points]),
            zero_s=zero_s,
            initial_deployed=_deployed(at, document["initial_deployed"]),
            specimen=at.string(document.get("specimen", ""), "specimen"),
            cycle=at.integer(document.get("cycle", 0), "cycle", 0),
            channel=at.integer(document.get("channel", 1), "channel", 1),
            limits=limits,
            text=text,
        )
    except RigError as error:
        raise RigError(str(error) if str(error).startswith(name) else f"{name}: {error}") from None
