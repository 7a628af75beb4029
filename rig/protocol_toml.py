"""Reads the TOML form of a PressureProtocol: every key and value is checked here, and nothing is guessed."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.limits import STRAW_LIMITS, PressureLimits
from straw.rig.protocol import Floats, PressureProtocol
from straw.rig.segments import Points, compile_entries
from straw.rig.toml_place import At

UNITS_PA = {"Pa": 1.0, "mbar": 100.0, "kPa": 1000.0}
SECTIONS = ("prefix", "main", "suffix")
TOP_KEYS = ("name", "pressure_unit", "initial_deployed", "specimen", "cycle", "channel", "limits", "also", *SECTIONS)


def load_protocol(path: str | Path) -> PressureProtocol:
    """Read a protocol file; raises RigError with one line naming file, section, entry and cure."""
    path = Path(path)
    try:
        text = path.read_bytes().decode()
    except OSError as error:
        raise RigError(f"protocol {path} cannot be read: {error.strerror or error}; check the name") from None
    except UnicodeDecodeError:
        raise RigError(f"protocol {path} is not a text file; a protocol is TOML, see rig/protocols") from None
    return protocol_from_toml(text, path.name)


def _limits(at: At, document: dict[str, Any], unit_pa: float) -> PressureLimits:
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


def _deployed(at: At, value: object) -> tuple[int, ...]:
    if not isinstance(value, list):
        at.fail("initial_deployed must list the deployed cells, e.g. [1, 4], or [] when all are folded")
    cells = tuple(at.integer(cell, "a cell in initial_deployed", 1) for cell in value)
    if len(set(cells)) != len(cells):
        at.fail(f"initial_deployed = {value} names a cell twice")
    return tuple(sorted(cells))


def _table(
    at: At, document: dict[str, Any], limits: PressureLimits, unit_pa: float, lengths_s: tuple[float, ...] = ()
) -> tuple[tuple[Floats, Floats], tuple[float, ...]]:
    """Times (s) and pressures (Pa) of the three sections one after the other, and how long each is.

    ``lengths_s``: their required lengths; a missing section is then a hold at 0.
    """
    points: Points = []
    found_s: list[float] = []
    for number, section in enumerate(SECTIONS):
        entries = document.get(section, [])
        segment = compile_entries(at, entries, f"[[{section}]]", lambda p: limits.why_not(p * unit_pa))
        if lengths_s and not segment and lengths_s[number]:
            segment = [(0.0, 0.0), (lengths_s[number], 0.0)]
        length_s = segment[-1][0] if segment else 0.0
        if lengths_s and abs(length_s - lengths_s[number]) > 1e-6:
            at.fail(f"{section} lasts {length_s:g} s, that of the first channel {lengths_s[number]:g} s; add a hold")
        points += [(sum(found_s) + t, p * unit_pa) for t, p in segment]
        found_s.append(length_s)
    return (np.array([t for t, _ in points]), np.array([p for _, p in points])), tuple(found_s)


def _also(
    at: At, tables: object, lengths_s: tuple[float, ...], limits: PressureLimits, unit_pa: float
) -> Iterator[tuple[int, Floats, Floats]]:
    """Channel, times and pressures of the other channels."""
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        at.fail("also must be written as [[also]] tables: channel = 2, and prefix, main, suffix of its own")
    for number, table in enumerate(tables, 1):
        here = at.inside(f"[[also]] {number}")
        here.known_keys(table, ("channel", *SECTIONS))
        if "channel" not in table:
            here.fail("channel is missing; add channel = 2, for example")
        (time_s, pa), _ = _table(here, table, limits, unit_pa, lengths_s)
        yield here.integer(table["channel"], "channel", 1), time_s, pa


def protocol_from_toml(text: str, name: str) -> PressureProtocol:
    """The protocol written in ``text``; ``name`` says where it came from in errors. Raises RigError with one line."""
    at = At(name)
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

    main, lengths_s = _table(at, document, limits, unit_pa)
    if not document["main"]:
        at.fail("main is empty; add at least one [[main]] entry")

    try:
        called = at.string(document.get("name", PurePath(name).stem), "name")
        deployed = _deployed(at, document["initial_deployed"])
        channel = at.integer(document.get("channel", 1), "channel", 1)
        return PressureProtocol(
            name=called,
            time_s=main[0],
            pressure_pa=main[1],
            zero_s=lengths_s[0],
            initial_deployed=deployed,
            specimen=at.string(document.get("specimen", ""), "specimen"),
            cycle=at.integer(document.get("cycle", 0), "cycle", 0),
            channel=channel,
            limits=limits,
            text=text,
            also=tuple(
                PressureProtocol(called, time_s, pa, lengths_s[0], deployed, channel=other, limits=limits)
                for other, time_s, pa in _also(at, document.get("also", []), lengths_s, limits, unit_pa)
            ),
        )
    except RigError as error:
        raise RigError(str(error) if str(error).startswith(name) else f"{name}: {error}") from None
