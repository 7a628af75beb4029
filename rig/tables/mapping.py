"""Mapping: what the user states about tables: the columns' roles and units, clocks, and the run's metadata."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping as Map
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.tables.roles import ROLES
from straw.rig.tables.table import Reading, Table
from straw.rig.toml_place import At

BACK = ("drop", "sort", "wrap", "part:N")
#: DeepLabCut's own pcutoff (config.yaml of its projects).
LEAST_LIKELIHOOD = 0.6
_READING = tuple(one.name for one in fields(Reading))


@dataclass(frozen=True)
class Use:
    """One column in a role: the run gets (value - zero) * factor, in SI of the unit ("" is the heading's)."""

    column: str
    unit: str = ""
    zero: float = 0.0
    factor: float = 1.0
    channel: int = 1


@dataclass(frozen=True)
class TableMap:
    """What is stated about one table; ``uses`` holds () for a role to be left out. See ``straw import --help``."""

    file: str = ""
    reading: Reading = field(default_factory=Reading)
    uses: Map[str, tuple[Use, ...]] = field(default_factory=dict)
    rate_hz: float | None = None
    offset_s: float | None = None
    back: str | None = None
    mm_per_px: float | None = None
    origin_px: tuple[float, float] | None = None
    points: tuple[str, str] | None = None
    points_unit: str = ""
    least_likelihood: float = LEAST_LIKELIHOOD
    tip_offset_mm: float = 0.0
    date_order: str | None = None


@dataclass(frozen=True)
class Mapping:
    """What is stated about all tables; ``metadata`` goes to straw.run as it is."""

    tables: tuple[TableMap, ...] = ()
    start: str = ""
    time_zone: str = ""
    metadata: Map[str, str] = field(default_factory=dict)
    as_stated: bool = False


_RUN = ("specimen", "initial_deployed", "cycle", "cells", "run_id", "channel")
_TABLE = (
    "rate_hz",
    "offset_s",
    "back",
    "mm_per_px",
    "origin_px",
    "points",
    "points_unit",
    "least_likelihood",
    "tip_offset_mm",
    "date_order",
)


def load_mapping(path: Path) -> Mapping:
    """A mapping file; RigError, with the place, where it is not valid."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RigError(f"mapping {path} cannot be read: {error.strerror or error}; check the name") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RigError(f"mapping {path} is not TOML: {' '.join(str(error).split())}") from None
    at = At(f"mapping {path}")
    at.known_keys(data, (*_RUN, "start", "time_zone", "metadata", "table", "as_stated"))
    metadata = {str(key): str(value) for key, value in _dict(at, data.get("metadata", {}), "metadata").items()}
    for key in _RUN:
        if key in data:
            value = data[key]
            metadata[key] = ",".join(map(str, value)) if isinstance(value, list) else str(value)
    entries = data.get("table", [])
    if isinstance(entries, dict):
        entries = [entries]
    if not isinstance(entries, list):
        at.fail("table must be [[table]]")
    tables = [_table(at.inside(f"table {k}"), _dict(at, one, "table")) for k, one in enumerate(entries, 1)]
    tables = [replace(one, reading=_beside(one.reading, path.parent)) for one in tables]
    return Mapping(
        tuple(tables), str(data.get("start", "")), str(data.get("time_zone", "")), metadata, bool(data.get("as_stated"))
    )


def _table(at: At, data: dict[str, Any]) -> TableMap:
    at.known_keys(data, ("file", *_READING, *_TABLE, *ROLES))
    reading = {key: data[key] for key in _READING if key in data}
    for key, value in reading.items():
        at.integer(value, key, 0) if key == "skip" else at.string(value, key)
    numbers: dict[str, Any] = {
        k: at.number(data[k], k) for k in ("offset_s", "least_likelihood", "tip_offset_mm") if k in data
    }
    numbers |= {k: at.positive(data[k], k) for k in ("rate_hz", "mm_per_px") if k in data}
    uses = {role: _uses(at.inside(role), data[role]) for role in ROLES if role in data}
    origin, points = data.get("origin_px"), data.get("points")
    for key, value in (("origin_px", origin), ("points", points)):
        if value is not None and not (isinstance(value, list) and len(value) == 2):
            at.fail(f"{key} must be a list of two")
    return TableMap(
        file=str(data.get("file", "")),
        reading=Reading(**reading),
        uses=uses,
        back=checked_back(str(data["back"])) if "back" in data else None,
        date_order=at.string(data["date_order"], "date_order") if "date_order" in data else None,
        origin_px=(at.number(origin[0], "origin_px"), at.number(origin[1], "origin_px")) if origin else None,
        points_unit=at.string(data.get("points_unit", ""), "points_unit"),
        points=(str(points[0]), str(points[1])) if points else None,
        **numbers,
    )


def _beside(reading: Reading, folder: Path) -> Reading:
    """A reader's file is looked for from the mapping's folder."""
    if reading.format is None or not reading.format.endswith(".py"):
        return reading
    return replace(reading, format=str(folder / reading.format))


def _uses(at: At, value: Any) -> tuple[Use, ...]:
    if value in ("none", []):
        return ()
    out = []
    for k, one in enumerate(value if isinstance(value, list) else [value], 1):
        if isinstance(one, str):
            out.append(Use(one, channel=k))
            continue
        data = _dict(at, one, "it")
        at.known_keys(data, ("column", "unit", "zero", "factor", "channel"))
        if "column" not in data:
            at.fail('names no column; write { column = "...", unit = "..." }')
        numbers = {key: at.number(data[key], key) for key in ("zero", "factor") if key in data}
        channel = at.integer(data.get("channel", k), "channel", 1)
        out.append(Use(str(data["column"]), str(data.get("unit", "")), channel=channel, **numbers))
    return tuple(out)


def _dict(at: At, value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        at.fail(f"{what} = {value!r} must be a table")
    return value


def checked_back(text: str) -> str:
    """What to do where time runs back; RigError for any other word."""
    if text in ("drop", "sort", "wrap") or (text.startswith("part:") and text[5:].isdecimal() and int(text[5:]) > 0):
        return text
    raise RigError(f"back = {text!r}: expected one of {', '.join(BACK)}")


def split_table(text: str, tables: list[Table]) -> tuple[Table | None, str]:
    """A flag's value and the table it names before a colon, as in ``tip.csv:Time in s``."""
    for table in tables:
        for name in (str(table.path), table.name):
            if text.startswith(name + ":"):
                return table, text[len(name) + 1 :]
    return None, text


def split_unit(text: str, table: Table) -> Use | None:
    """A column and its unit, as ``P1 in mbar``; None where the table has no such column."""
    if table.find(text):
        return Use(text)
    column, word, unit = text.rpartition(" in ")
    return Use(column, unit.strip()) if word and table.find(column) else None


def to_toml(mapping: Mapping) -> str:
    """The mapping as the text of an equivalent file."""
    run = dict(mapping.metadata)
    lines = [f"{key} = {_text(run.pop(key))}" for key in _RUN if key in run]
    lines += [f"{key} = {_text(value)}" for key in ("start", "time_zone") if (value := getattr(mapping, key))]
    lines += ["as_stated = true"] if mapping.as_stated else []
    if run:
        lines += ["", "[metadata]", *(f"{_text(key)} = {_text(value)}" for key, value in run.items())]
    for one in mapping.tables:
        lines += ["", "[[table]]", f"file = {_text(one.file)}"]
        for key in _READING:
            if value := getattr(one.reading, key):
                lines.append(f"{key} = {value if isinstance(value, int) else _text(value)}")
        for role, uses in one.uses.items():
            said = [_use(use, k) for k, use in enumerate(uses, 1)]
            lines.append(f"{role} = " + (said[0] if len(said) == 1 else f"[{', '.join(said)}]"))
        for key in _TABLE:
            value = getattr(one, key)
            if (
                value in (None, "")
                or (key == "least_likelihood" and value == LEAST_LIKELIHOOD)
                or (key == "tip_offset_mm" and not value)
            ):
                continue
            if isinstance(value, tuple):
                value = f"[{', '.join(_text(v) if isinstance(v, str) else repr(v) for v in value)}]"
            lines.append(f"{key} = {_text(value) if isinstance(value, str) and value[:1] != '[' else value}")
    return "\n".join(lines).lstrip("\n") + "\n"


def _use(use: Use, k: int) -> str:
    said = [f"column = {_text(use.column)}"]
    said += [f"unit = {_text(use.unit)}"] if use.unit else []
    said += [f"zero = {use.zero!r}"] if use.zero else []
    said += [f"factor = {use.factor!r}"] if use.factor != 1.0 else []
    said += [f"channel = {use.channel}"] if use.channel != k else []
    return f"{{ {', '.join(said)} }}"


def _text(value: str) -> str:
    import json

    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
