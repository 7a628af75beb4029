"""CSV, TSV and other text tables of loggers and spreadsheets, one row a line; also serial logs of a terminal."""

from __future__ import annotations

from pathlib import Path

from straw.rig.tables.formats import Format
from straw.rig.tables.formats._text import decode, grid, is_text, table
from straw.rig.tables.table import Reading, Table


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Any separator, decimal mark and heading."""
    return table(path, "CSV", grid(decode(data, path.name, reading.encoding), path.name, reading), reading)


FORMAT = Format("csv", "CSV, TSV, TXT, serial logs", lambda path, data: is_text(data), read, rank=90)
