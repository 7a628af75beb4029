"""ELVEFLOW ESI logs: tab-separated, a heading, time in s, for each channel target and reading or reading alone in mbar.

Layouts as public readers of such logs expect them: the ESI reader of SAXS beamline software (heading first, tabs,
Latin-1; 'time [s]', 'Pressure 1 [mbar]', 'Volume flow rate 1 [µL/min]') and the R package picoinjector, whose
``logfile_read_pressure`` skips the heading and takes time, then target and reading of channels 1 to 4, then nothing.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from straw.rig.tables.formats import Format
from straw.rig.tables.formats._text import cells, decode, grid, head, table
from straw.rig.tables.table import Column, Reading, Table

_CHANNEL = re.compile(r"(?:pressure|press|p|ch|channel|ob1)\D{0,12}([1-4])\b", re.IGNORECASE)
_TARGET = re.compile(r"target|set|command|consign|regul", re.IGNORECASE)


def recognises(path: Path, data: bytes) -> bool:
    """A first line with tabs that names a time and pressures in mbar, or OB1 or Elveflow by name."""
    lines = head(data, 1)
    if not lines or "\t" not in lines[0]:
        return False
    words = lines[0].casefold()
    named = any(word in words for word in ("elveflow", "ob1", "esi "))
    pressures = len(re.findall(r"mbar", words)) + len(re.findall(r"\bp[1-4][ _](?:target|read)", words))
    return "time" in words and (named or (pressures >= 1 and bool(_CHANNEL.search(lines[0].replace("_", " ")))))


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Pressures are in mbar, as ESI has no other unit in its logs; the first channel with a reading is the run's."""
    text = decode(data, path.name, reading.encoding)
    found = grid(text, path.name, replace(reading, separator=reading.separator or "\t"))
    heading = [cell for cell in cells(found.top[-1], "\t") if cell] if found.top else []
    if len(heading) == len(found.names):
        found.names = heading
    raw = table(path, "ESI", found, reading)
    columns: dict[str, Column] = {}
    roles: dict[str, str] = {}
    for k, (name, column) in enumerate(raw.columns.items()):
        channel = _CHANNEL.search(name.replace("_", " "))
        if k == 0:
            column = replace(column, unit=column.unit or "s")
            roles[name] = "time"
        elif channel and "flow" not in name.casefold():
            column = replace(column, unit=column.unit or "mbar")
            kind = "command" if _TARGET.search(name) else "pressure"
            if kind not in roles.values():
                roles[name] = kind
        columns[name] = column
    return replace(raw, columns=columns, roles=roles)


FORMAT = Format("esi", "ELVEFLOW ESI logs", recognises, read, rank=30)
