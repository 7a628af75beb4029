"""Kinovea's trajectories as text (File > Export > Gnuplot): blocks of time, x and y, one for each tracked point.

As Kinovea's own ExporterTXTTrajectory writes them (two lines of heading, "# name" before each block in newer versions)
and as older ones did, with a time code of hours:minutes:seconds:hundredths. Its kinematics dialog exports plain CSV,
which the CSV format reads ("Time (ms)" first).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from straw.rig.errors import RigError
from straw.rig.tables.formats import Format
from straw.rig.tables.formats._numbers import number
from straw.rig.tables.formats._text import decode, head
from straw.rig.tables.table import Column, Point, Reading, Table

_HEADING = "#Kinovea Trajectory data export"


def recognises(path: Path, data: bytes) -> bool:
    """By the first line."""
    return any(line.strip() == _HEADING for line in head(data, 1))


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Each block is a point; coordinates are Kinovea's, y upwards where it was calibrated, in whatever unit it was."""
    text = decode(data, path.name, reading.encoding)
    blocks: list[tuple[str, list[tuple[int, list[str]]]]] = []
    name, open_block = "", False
    for k, line in enumerate(re.split(r"\r\n|\n|\r", text), 1):
        line = line.strip()
        if not line:
            open_block = False
        elif line.startswith("#"):
            name = "" if line == _HEADING or line.replace(" ", "") == "#TXY" else line.lstrip("# ")
        else:
            if not open_block:
                blocks.append((name or f"trajectory {len(blocks) + 1}", []))
                name, open_block = "", True
            blocks[-1][1].append((k, line.split()))
    if not blocks:
        raise RigError(f"{path.name}: holds no trajectory; track a point in Kinovea before exporting")
    columns: dict[str, Column] = {}
    points: dict[str, Point] = {}
    for block, rows in blocks:
        for k, row in rows:
            if len(row) != 3:
                raise RigError(f"{path.name}: line {k} is not time, x and y, as Kinovea writes them; repair or cut it")
        names = (f"{block} time", f"{block} x", f"{block} y")
        for at, column in enumerate(names):
            texts = tuple(row[at].replace(",", ".") if row[at].count(",") == 1 else row[at] for _, row in rows)
            values = [number(cell, ".", "") for cell in texts]
            bad = [k for k, value in enumerate(values) if value is None]
            if bad and at > 0:
                raise RigError(
                    f"{path.name}: line {rows[bad[0]][0]}: {rows[bad[0]][1][at]!r} is not a number; repair it"
                )
            numbers = np.array([np.nan if value is None else value for value in values])
            columns[column] = Column(column, numbers, texts)
        points[block] = Point(names[1], names[2], time=names[0])
    first = blocks[0][0]
    roles = {f"{first} time": "time"}
    if len(blocks) == 1:
        roles |= {f"{first} x": "x", f"{first} y": "z"}
    lines = np.array([k for k, _ in blocks[0][1]], dtype=np.int64)
    return Table(path, "Kinovea", columns, lines, f"{len(blocks)} trajectories", roles=roles, points=points)


FORMAT = Format("kinovea", "Kinovea trajectories (text)", recognises, read, rank=10)
