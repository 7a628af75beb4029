"""DeepLabCut's CSV and H5: scorer, bodyparts, coords on top; x, y and likelihood of each body part in px.

The H5 is pandas' ``to_hdf(key="df_with_missing", format="table")`` (or "fixed"): it is read with h5py alone, and the
pickled column names in it by an unpickler that can only make lists, tuples and strings.
"""

from __future__ import annotations

import csv
import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.tables.formats import Format
from straw.rig.tables.formats._hdf import is_hdf, open_hdf
from straw.rig.tables.formats._numbers import is_nothing, number
from straw.rig.tables.formats._text import decode, head
from straw.rig.tables.table import Column, Point, Reading, Table


def recognises(path: Path, data: bytes) -> bool:
    """CSV by its first words, H5 by pandas' table in it."""
    if is_hdf(data):
        return b"MATLAB 7.3" not in data[:128] and (b"df_with_missing" in data or b"pandas_type" in data)
    lines = head(data, 2)
    return len(lines) == 2 and lines[0].startswith("scorer,") and lines[1].split(",")[0] in ("bodyparts", "individuals")


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Columns "part x", "part y", "part likelihood" in px, v downwards, and "frame"."""
    keys, frames, values, lines = _from_hdf(path, data) if is_hdf(data) else _from_csv(path, data, reading)
    levels = {len(key) for key in keys}
    if levels - {3, 4}:
        raise RigError(f"{path.name}: its columns have {levels} levels of names; DeepLabCut's have 3 or 4")
    animals = {key[1] for key in keys if len(key) == 4}
    columns = {"frame": Column("frame", frames)}
    parts: dict[str, dict[str, str]] = {}
    for key, column in zip(keys, values, strict=True):
        part = f"{key[1]} {key[2]}" if len(animals) > 1 else key[-2]
        name = f"{part} {key[-1]}"
        columns[name] = Column(name, column, unit="px" if key[-1] in ("x", "y") else "")
        parts.setdefault(part, {})[key[-1]] = name
    points = {p: Point(n["x"], n["y"], n.get("likelihood", "")) for p, n in parts.items() if {"x", "y"} <= n.keys()}
    roles = {"frame": "frame"}
    if len(points) == 1:
        only = next(iter(points.values()))
        roles |= {only.x: "x", only.y: "z"}
        if only.likelihood:
            roles[only.likelihood] = "likelihood"
    said = f"{len(frames)} frames of {len(points)} body parts: {', '.join(list(points)[:8])}"
    return Table(path, "DeepLabCut", columns, lines, said, roles=roles, points=points, y_down=True)


def _from_csv(path: Path, data: bytes, reading: Reading) -> tuple[list[tuple[str, ...]], Any, list[Any], Any]:
    rows = list(csv.reader(io.StringIO(decode(data, path.name, reading.encoding))))
    rows = [row for row in rows if row]
    above = 4 if len(rows) > 1 and rows[1][0] == "individuals" else 3
    if len(rows) <= above:
        raise RigError(f"{path.name}: has no frames below its heading; analyse the video first")
    width = len(rows[above])
    if any(len(row) < width for row in rows[:above]):
        raise RigError(f"{path.name}: its heading has fewer columns than its frames; export it again")
    keys = list(zip(*(row[1:width] for row in rows[:above]), strict=True))
    body = rows[above:]
    numbers = np.full((len(body), width), np.nan)
    for k, row in enumerate(body):
        if len(row) != width:
            raise RigError(f"{path.name}: line {above + k + 1} has {len(row)} cells, the others {width}; repair it")
        for at, cell in enumerate(row):
            value = float("nan") if is_nothing(cell) else number(cell, ".", "")
            if value is None:
                if at == 0:
                    raise RigError(
                        f"{path.name}: line {above + k + 1} is a labelled picture ({cell!r}), no frame of a video; "
                        "give the file that analyze_videos wrote"
                    )
                raise RigError(f"{path.name}: line {above + k + 1}: {cell!r} is not a number; repair or cut the line")
            numbers[k, at] = value
    lines = np.arange(above + 1, above + 1 + len(body))
    return keys, numbers[:, 0], list(numbers[:, 1:].T), lines


class _Words(pickle.Unpickler):
    """Unpickles lists, tuples, numbers and strings; anything else is refused."""

    def find_class(self, module: str, name: str) -> Any:
        raise pickle.UnpicklingError(f"{module}.{name}")


def _from_hdf(path: Path, data: bytes) -> tuple[list[tuple[str, ...]], Any, list[Any], Any]:
    with open_hdf(path, data) as file:
        groups = [group for group in file.values() if hasattr(group, "attrs") and "pandas_type" in group.attrs]
        if not groups:
            raise RigError(f"{path.name}: holds no table of DeepLabCut's; give the file that analyze_videos wrote")
        group = groups[0]
        try:
            if "table" in group:
                rows = group["table"][:]
                keys = _names(group["table"].attrs["values_block_0_kind"])
                if rows["index"].dtype.kind == "S":
                    raise RigError(
                        f"{path.name}: holds labelled pictures, no video; give the file that analyze_videos wrote"
                    )
                frames, values = rows["index"].astype(float), np.asarray(rows["values_block_0"], dtype=float)
            else:
                levels = [f"axis0_level{k}" for k in range(4)]
                words = [[w.decode() for w in group[level][:]] for level in levels if level in group]
                labels = [group[f"axis0_label{k}"][:] for k in range(len(words))]
                keys = [tuple(w[i] for w, i in zip(words, at, strict=True)) for at in zip(*labels, strict=True)]
                frames, values = group["axis1"][:].astype(float), np.asarray(group["block0_values"], dtype=float)
        except (KeyError, ValueError, TypeError, pickle.UnpicklingError, EOFError) as error:
            raise RigError(
                f"{path.name}: its table is not as DeepLabCut writes it ({type(error).__name__}); use the CSV"
            ) from None
    if values.shape != (len(frames), len(keys)):
        raise RigError(f"{path.name}: has {len(keys)} names for {values.shape[-1]} columns; export the CSV instead")
    return keys, frames, list(values.T), np.arange(1, len(frames) + 1)


def _names(pickled: Any) -> list[tuple[str, ...]]:
    raw = pickled if isinstance(pickled, bytes) else bytes(pickled)
    return [tuple(map(str, key)) for key in _Words(io.BytesIO(raw), encoding="utf-8").load()]


FORMAT = Format("deeplabcut", "DeepLabCut CSV and H5", recognises, read, rank=10)
