"""Parquet, with pyarrow, which is optional."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.tables.formats import Format
from straw.rig.tables.table import Column, Reading, Table
from straw.rig.tables.units import unit_in


def recognises(path: Path, data: bytes) -> bool:
    """By its first bytes."""
    return data.startswith(b"PAR1")


def arrow(name: str) -> tuple[Any, Any]:
    """pyarrow and pyarrow.parquet; RigError where they are not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise RigError(f"{name}: Parquet needs pyarrow, which is not installed: pip install 'straw[tables]'") from None
    return pyarrow, pyarrow.parquet


def load(path: Path, data: bytes) -> Any:
    """The file as a pyarrow table; RigError for a damaged one."""
    pa, parquet = arrow(path.name)
    try:
        return parquet.read_table(io.BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise RigError(f"{path.name}: is a damaged Parquet file ({' '.join(str(error).split())[:80]})") from None


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Columns of numbers, truth values, words and moments (as ns since 1970, UTC where they have a zone)."""
    pa, _ = arrow(path.name)
    held = load(path, data)
    columns: dict[str, Column] = {}
    for name in held.column_names:
        column, kind = held.column(name), held.column(name).type
        unit = unit_in(name)
        if pa.types.is_timestamp(kind):
            if column.null_count:
                raise RigError(f"{path.name}: column {name!r} lacks {column.null_count} times; fill or leave them out")
            nanoseconds = column.cast(pa.timestamp("ns", tz=kind.tz)).cast(pa.int64()).to_numpy()
            zone = "Z" if kind.tz else ""
            text = tuple(np.datetime_as_string(nanoseconds.astype("datetime64[ns]")) + zone) if not zone else None
            columns[name] = Column(name, nanoseconds.astype(float), text, nanoseconds, "ns")
        elif pa.types.is_integer(kind) and not column.null_count:
            whole = column.cast(pa.int64(), safe=False).to_numpy()
            columns[name] = Column(name, whole.astype(np.float64), None, whole, unit)
        elif pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind):
            values = column.cast(pa.float64()).to_numpy(zero_copy_only=False)
            columns[name] = Column(name, np.asarray(values, dtype=np.float64), unit=unit)
        elif pa.types.is_boolean(kind):
            values = [np.nan if value is None else float(value) for value in column.to_pylist()]
            columns[name] = Column(name, np.array(values, dtype=np.float64))
        elif pa.types.is_string(kind) or pa.types.is_large_string(kind):
            words = tuple(value or "" for value in column.to_pylist())
            columns[name] = Column(name, np.full(len(words), np.nan), words, unit=unit)
    if not columns or not held.num_rows:
        raise RigError(f"{path.name}: holds no rows of numbers")
    return Table(path, "Parquet", columns, np.arange(1, held.num_rows + 1), f"{held.num_rows} rows")


FORMAT = Format("parquet", "Parquet", recognises, read, rank=10)
