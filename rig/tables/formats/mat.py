"""MAT files of MATLAB and Octave: versions 4 to 7 with SciPy, 7.3 (which is HDF5) with h5py, which is optional."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.tables.formats import Format
from straw.rig.tables.formats._hdf import is_hdf, open_hdf
from straw.rig.tables.table import Column, Reading, Table
from straw.rig.tables.units import unit_in


def recognises(path: Path, data: bytes) -> bool:
    """By MATLAB's header; version 4 has none, so its suffix decides."""
    return data.startswith(b"MATLAB") or (path.suffix.casefold() == ".mat" and not data[:4].isalpha())


def read(path: Path, data: bytes, reading: Reading) -> Table:
    """Every vector is a column, also inside structs (``log.t``), and every column of a matrix (``log(:,2)``)."""
    columns: dict[str, Column] = {}
    single: list[str] = []
    for name, values in _from_hdf(path, data) if is_hdf(data) else _from_mat(path, data):
        if values.size == 1:
            single.append(f"{name} = {values.reshape(-1)[0]:g}")
            continue
        if values.ndim == 2 and min(values.shape) > 1:
            for k in range(values.shape[1]):
                key = f"{name}(:,{k + 1})"
                columns[key] = Column(key, values[:, k].astype(np.float64), whole=_whole(values[:, k]))
        elif values.ndim <= 2 and values.size:
            flat = values.reshape(-1)
            columns[name] = Column(name, flat.astype(np.float64), whole=_whole(flat), unit=unit_in(name))
    if not columns:
        raise RigError(
            f"{path.name}: holds no vectors of numbers; tables and timetables are MATLAB's alone: save their columns, "
            "as in t = T.time; p = T.p; save('run.mat', 't', 'p')"
        )
    longest = max(len(column) for column in columns.values())
    notes = (f"single numbers in it: {', '.join(single[:8])}",) if single else ()
    about = f"{len(columns)} vectors"
    return Table(path, "MAT", columns, np.arange(1, longest + 1), about, notes=notes)


def _whole(values: Any) -> Any:
    return values.astype(np.int64) if values.dtype.kind in "iu" else None


def _from_mat(path: Path, data: bytes) -> Iterator[tuple[str, Any]]:
    from scipy.io import loadmat

    try:
        stream: Any = io.BytesIO(data)
        held = loadmat(stream, squeeze_me=True, struct_as_record=True)
    except Exception as error:  # SciPy raises half a dozen kinds of exception for a damaged file
        raise RigError(
            f"{path.name}: is not a MAT file that can be read ({type(error).__name__}); save it again"
        ) from None
    for name, value in held.items():
        if not name.startswith("__"):
            yield from _inside(name, value)


def _inside(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    array = np.asarray(value)
    if array.dtype.names and array.size == 1:
        for field in array.dtype.names:
            yield from _inside(f"{name}.{field}", array.reshape(-1)[0][field])
    elif array.dtype.kind in "iufb":
        yield name, array


def _from_hdf(path: Path, data: bytes) -> Iterator[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []

    def visit(name: str, item: Any) -> None:
        if name.startswith("#") or not hasattr(item, "dtype") or item.dtype.kind not in "iufb":
            return
        if item.attrs.get("MATLAB_class", b"double") in (b"char", b"cell") or "MATLAB_empty" in item.attrs:
            return
        found.append((name.replace("/", "."), np.asarray(item).T))  # MATLAB counts along columns, HDF5 along rows

    with open_hdf(path, data) as file:
        file.visititems(visit)
    yield from found


FORMAT = Format("mat", "MAT files", recognises, read, rank=20)
